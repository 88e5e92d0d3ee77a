"""Writes a weights file's network as ONNX, for comparing its speed in other runtimes (OpenCV DNN, ONNX Runtime).

usage: export_onnx.py WEIGHTS.safetensors OUT.onnx [--size N]   |   export_onnx.py --random PRESET OUT.onnx [--size N]
Input: normalised RGB [1, 3, N, N]; output: raw maps [1, 6, N/4, N/4]. The network is the runtime's: same layers, nothing pruned.
"""
import argparse

import torch

import weights_file
from model import PRESETS
from random_weights import random_model


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("source", help="weights file, or a preset's name with --random")
    parser.add_argument("out")
    parser.add_argument("--random", action="store_true", help="untrained weights of a preset")
    parser.add_argument("--size", type=int, help="input edge in pixels; default: the file's or the preset's")
    args = parser.parse_args(argv)
    if args.random:
        model, size = random_model(args.source), args.size or PRESETS[args.source].size
    else:
        model, metadata = weights_file.load_model(args.source)
        size = args.size or int(metadata["input_width"])
    x = torch.zeros(1, 3, size, size)
    torch.onnx.export(model, x, args.out, input_names=["image"], output_names=["maps"], opset_version=11)


if __name__ == "__main__":
    main()
