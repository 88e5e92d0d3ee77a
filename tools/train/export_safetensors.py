"""Exports the averaged weights of a training state (or random weights of a preset) for the runtime.

usage: export_safetensors.py STATE.pt OUT.safetensors [--fp32] [--size N] [--score-threshold X] [--top-k N] [--nms-decay X]
       export_safetensors.py --random PRESET OUT.safetensors
"""
import argparse

import torch

import evaluate
import weights_file
from model import PRESETS, build
from random_weights import random_model


def load_state(path):
    """(model with averaged weights, preset name, images seen, minutes trained) of a state.pt."""
    state = torch.load(path, map_location="cpu")
    model = build(state["preset"])
    model.load_state_dict(state["average"], strict=False)
    return model.eval(), state["preset"], state["images"], state["seconds"] / 60


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("source", help="state.pt, or a preset's name with --random")
    parser.add_argument("out")
    parser.add_argument("--random", action="store_true", help="untrained weights of a preset, for speed measurements")
    parser.add_argument("--fp32", action="store_true", help="float32 tensors in place of float16")
    parser.add_argument("--size", type=int, help="input edge in pixels; default: the preset's")
    parser.add_argument("--score-threshold", type=float, default=0.1)
    parser.add_argument("--top-k", type=int, default=evaluate.TOP_K)
    parser.add_argument("--nms-decay", type=float, default=evaluate.NMS_DECAY)
    parser.add_argument("--duplicate-decay", type=float, default=evaluate.DUPLICATE_DECAY)
    parser.add_argument("--duplicate-distance", type=float, default=evaluate.DUPLICATE_DISTANCE)
    parser.add_argument("--description", default="")
    args = parser.parse_args(argv)
    if args.random:
        model, preset, text = random_model(args.source), args.source, "random weights, for speed measurements only"
    else:
        model, preset, images, minutes = load_state(args.source)
        text = f"{preset}, {images} training images seen"
    size = args.size or PRESETS[preset].size
    metadata = weights_file.metadata_of(
        model, preset, size, evaluate.DISPLACEMENT_SCALE, score_threshold=args.score_threshold, top_k=args.top_k,
        nms_decay=args.nms_decay, duplicate_decay=args.duplicate_decay, duplicate_distance=args.duplicate_distance,
        description=args.description or text,
    )
    weights_file.save_model(args.out, model, metadata, half=not args.fp32)


if __name__ == "__main__":
    main()
