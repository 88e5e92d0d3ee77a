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
from random_weights import randomise

CASES = {"hybrid_1": (4, 1, "hybrid"), "basic_2": (4, 2, "basic")}
SIZE = 64
DISPLACEMENT_SCALE = 16.0


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
