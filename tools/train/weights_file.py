"""safetensors files without the package: writer, reader, and the metadata of a plumb model."""
import json
import os
import struct

import numpy as np
import torch

from model import HOURGLASS_DEPTH, MEAN, STD, STRIDE, Vlse, exported_state

SCHEMA = "plumb.model/1"
NAMES = {np.dtype(np.float32): "F32", np.dtype(np.float16): "F16", np.dtype(np.uint8): "U8"}
TYPES = {name: dtype for dtype, name in NAMES.items()}


def write(path, tensors, metadata):
    """Writes name -> numpy array (float32, float16, uint8) and string metadata; replaces `path` atomically."""
    header, offset = {"__metadata__": metadata}, 0
    for name, array in tensors.items():
        end = offset + array.nbytes
        header[name] = {"dtype": NAMES[array.dtype], "shape": list(array.shape), "data_offsets": [offset, end]}
        offset = end
    text = json.dumps(header, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 8)
    partial = path + ".partial"
    with open(partial, "wb") as f:
        f.write(struct.pack("<Q", len(text)) + text)
        for array in tensors.values():
            f.write(np.ascontiguousarray(array).tobytes())
    os.replace(partial, path)


def read(path):
    """(tensors, metadata) of a safetensors file."""
    with open(path, "rb") as f:
        data = f.read()
    (length,) = struct.unpack_from("<Q", data)
    header = json.loads(data[8 : 8 + length])
    metadata = header.pop("__metadata__", {})
    tensors = {}
    for name, entry in header.items():
        begin, end = (8 + length + o for o in entry["data_offsets"])
        tensors[name] = np.frombuffer(data[begin:end], TYPES[entry["dtype"]]).reshape(entry["shape"])
    return tensors, metadata


def metadata_of(model, preset, size, displacement_scale, **more):
    """The contract's metadata, all strings; `more` adds to it (score_threshold, top_k, nms_decay, description)."""
    values = {
        "schema": SCHEMA, "preset": preset, "width": model.width, "stacks": model.stacks, "depth": HOURGLASS_DEPTH,
        "block": model.block, "input_width": size, "input_height": size, "stride": STRIDE,
        "mean": ",".join(f"{v:.3f}" for v in MEAN), "std": ",".join(f"{v:.3f}" for v in STD),
        "displacement_scale": displacement_scale, **more,
    }
    return {k: str(v) for k, v in values.items()}


def save_model(path, model, metadata, half=True):
    """Exports the tensors that inference uses, as float16 or float32."""
    dtype = np.float16 if half else np.float32
    tensors = {k: v.detach().cpu().contiguous().numpy().astype(dtype) for k, v in exported_state(model).items()}
    for name, array in tensors.items():
        if not np.isfinite(array).all():
            raise ValueError(f"tensor {name} does not fit {array.dtype}")
    write(path, tensors, metadata)


def load_model(path):
    """(model in evaluation mode, metadata) of an exported file."""
    tensors, metadata = read(path)
    if metadata.get("schema") != SCHEMA:
        raise ValueError(f"{path} has schema {metadata.get('schema')}, not {SCHEMA}")
    model = Vlse(int(metadata["width"]), int(metadata["stacks"]), metadata["block"])
    state = {k: torch.from_numpy(v.astype(np.float32)) for k, v in tensors.items()}
    expected = set(exported_state(model))
    if set(state) != expected:
        raise ValueError(f"{path} lacks or adds tensors: {sorted(set(state) ^ expected)[:3]}")
    model.load_state_dict(state, strict=False)
    return model.eval(), metadata
