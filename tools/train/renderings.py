"""Turns sequences rendered by `plumbline synth` into a training folder: exact lines of the visible edges, score 1.

usage: renderings.py SEQUENCE... OUT [--every N] [--min-length PX]      (then: train.py ... --mix OUT:0.25)
"""
import argparse
import json
import os
import shutil

import numpy as np


def convert(sequence, images, every=1, min_length=8.0):
    """Copies every n-th frame of a sequence into the folder `images`; returns (label rows, manifest rows)."""
    name = os.path.basename(os.path.abspath(sequence))
    with open(os.path.join(sequence, "annotations.json")) as f:
        frames = json.load(f)[::every]
    labels, manifest = [], []
    for frame in frames:
        file = f"{name}_{frame['filename']}"
        shutil.copyfile(os.path.join(sequence, "rgb", frame["filename"]), os.path.join(images, file))
        lines = np.asarray(frame["lines"], float).reshape(-1, 4)
        lines = lines[np.hypot(lines[:, 2] - lines[:, 0], lines[:, 3] - lines[:, 1]) >= min_length]
        size = {"width": frame["width"], "height": frame["height"]}
        labels.append({"file": file, **size, "lines": lines.round(2).tolist(), "scores": [1.0] * len(lines)})
        manifest.append({"file": file, "source": "rendered", "group": name, **size})
    return labels, manifest


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("sequences", nargs="+", help="folders with annotations.json and rgb/, of different names")
    parser.add_argument("out", help="training folder to write; must not exist")
    parser.add_argument("--every", type=int, default=1, help="take every n-th frame")
    parser.add_argument("--min-length", type=float, default=8.0, help="of lines, in pixels")
    args = parser.parse_args(argv)
    names = {os.path.basename(os.path.abspath(s)) for s in args.sequences}
    if len(names) < len(args.sequences):
        parser.error("two sequences have the same name")
    images = os.path.join(args.out, "images")
    os.makedirs(images)
    labels, manifest = [], []
    for sequence in args.sequences:
        rows, entries = convert(sequence, images, args.every, args.min_length)
        labels, manifest = labels + rows, manifest + entries
    with open(os.path.join(args.out, "labels.jsonl"), "w") as f:
        f.writelines(json.dumps(row) + "\n" for row in labels)
    with open(os.path.join(args.out, "manifest.json"), "w") as f:
        json.dump(manifest, f)
    print(f"{len(labels)} images, {sum(len(row['lines']) for row in labels)} lines")


if __name__ == "__main__":
    main()
