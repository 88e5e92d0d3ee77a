"""Writes small networks with random weights, an input and PyTorch's output: what the runtime's network is tested against.

usage: make_oracle.py OUT_DIR   (the repository keeps the result in tests/nn/data)
Every file is a model file with two further files beside it: NAME.safetensors, NAME_io.safetensors {input, output}.
"""
import argparse
import os

import numpy as np
import torch

import weights_file
from model import Vlse

CASES = {"hybrid_1": (4, 1, "hybrid"), "basic_2": (4, 2, "basic")}
SIZE = 64
DISPLACEMENT_SCALE = 16.0


@torch.no_grad()
def randomise(model, generator):
    """Weights that keep activations near unit size, and normalisation statistics far enough from (0, 1) to matter."""
    for name, tensor in model.state_dict().items():
        if not tensor.dtype.is_floating_point:
            continue
        noise = torch.randn(tensor.shape, generator=generator)
        if name.endswith("running_var"):
            tensor.copy_(0.5 + noise.abs())
        elif name.endswith("running_mean"):
            tensor.copy_(0.3 * noise)
        elif tensor.ndim == 4:
            gain = 0.3 if "conv3" in name or "remap" in name or "project" in name else 1.5  # sums must not explode
            tensor.copy_(noise * (gain / tensor[0].numel()) ** 0.5)
        elif ".bn" in name and name.endswith("weight"):
            tensor.copy_(0.8 + 0.3 * noise)
        else:
            tensor.copy_(0.2 * noise)


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out")
    args = parser.parse_args(argv)
    os.makedirs(args.out, exist_ok=True)
    generator = torch.Generator().manual_seed(7)
    for name, (width, stacks, block) in CASES.items():
        model = Vlse(width, stacks, block).eval()
        randomise(model, generator)
        metadata = weights_file.metadata_of(
            model, "test", SIZE, DISPLACEMENT_SCALE, score_threshold=0.05, top_k=200, nms_decay=0.8, description="random weights"
        )
        weights_file.save_model(os.path.join(args.out, f"{name}.safetensors"), model, metadata)
        # The file is the truth: what float16 rounded away is rounded away here as well.
        model, _ = weights_file.load_model(os.path.join(args.out, f"{name}.safetensors"))
        x = torch.randn(1, 3, SIZE, SIZE, generator=generator).half()
        with torch.no_grad():
            y = model.double()(x.double())
        arrays = {"input": x.numpy().astype(np.float16), "output": y.numpy().astype(np.float32)}
        weights_file.write(os.path.join(args.out, f"{name}_io.safetensors"), arrays, {"schema": "plumb.oracle/1"})


if __name__ == "__main__":
    main()
