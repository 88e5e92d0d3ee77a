"""Writes networks with random weights, an input and PyTorch's output: what the runtime's network is tested against.

usage: make_oracle.py OUT_DIR             (small networks: the repository keeps the result in tests/nn/data)
       make_oracle.py OUT_DIR --presets   (every preset on a small input: written when tests run; status 77 where torch is missing)
Every model file has a second one beside it: NAME.safetensors, NAME_io.safetensors {input, output}.
"""
import argparse
import importlib.util
import os
import sys

SKIPPED = 77
if __name__ == "__main__" and any(importlib.util.find_spec(name) is None for name in ("numpy", "torch")):
    print(f"skipped: {sys.executable} has no torch")
    sys.exit(SKIPPED)

import numpy as np
import torch

import weights_file
from model import PRESETS, Vlse
from random_weights import randomise

CASES = {"hybrid_1": (4, 1, "hybrid"), "basic_2": (4, 2, "basic")}
SIZE = 64
DISPLACEMENT_SCALE = 16.0


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out")
    parser.add_argument("--presets", action="store_true", help="nano to paper in place of the small networks")
    args = parser.parse_args(argv)
    os.makedirs(args.out, exist_ok=True)
    generator = torch.Generator().manual_seed(7)
    cases = {name: (p.width, p.stacks, p.block) for name, p in PRESETS.items()} if args.presets else CASES
    for name, (width, stacks, block) in cases.items():
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
