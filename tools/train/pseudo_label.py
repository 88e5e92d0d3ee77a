"""Labels training images with a network and fuses its lines with the labels that are there, for a noisy-student round.

usage: pseudo_label.py NETWORK DATA OUT [--size N] [--labels-weight W] [--min-agreement A] [--min-score S]   (then: train.py --data OUT ...)
NETWORK (state.pt or .safetensors) sees every image as it is and mirrored; OUT is a training folder whose images/ links to DATA's.
"""
import argparse
import json
import os
import shutil

import numpy as np
import torch

import evaluate
from data import load
from distill import load_network
from model import PRESETS

TOLERANCE = 10.0  # squared distance of both end points in 128ths of the image within which segments are the same line, as in sAP10


def distances(line, lines):
    """Squared distance [N] of end points to `line` in the better order, and whether [N] that is the reversed one."""
    same = ((lines - line) ** 2).sum(1)
    reverse = ((lines[:, [2, 3, 0, 1]] - line) ** 2).sum(1)
    return np.minimum(same, reverse), reverse < same


def fuse(sources, size, min_agreement=0.0, min_score=0.05):
    """(lines [N, 4], scores [N]) of sources [(lines, scores, weight)] of one image of `size` (width, height), best first.

    Segments of different sources that are the same line become one: its end points are the mean weighted by score, its score the mean
    over all sources by weight (a source without it counts 0). `min_agreement` is the share of the weight whose sources must have it.
    """
    total = sum(weight for _, _, weight in sources)
    scale = np.array([128 / size[0], 128 / size[1]] * 2)
    lines = np.concatenate([np.reshape(l, (-1, 4)) for l, _, _ in sources])
    scores = np.concatenate([np.asarray(s, float) for _, s, _ in sources])
    source = np.concatenate([np.full(len(s), i) for i, (_, s, _) in enumerate(sources)])
    weight = np.array([w for _, _, w in sources])[source]
    scaled, free = lines * scale, np.ones(len(lines), bool)
    fused = []
    for seed in np.argsort(-scores, kind="stable"):
        if not free[seed]:
            continue
        distance, reverse = distances(scaled[seed], scaled)
        distance[~free | (distance > TOLERANCE)] = np.inf
        distance[source == source[seed]] = np.inf
        distance[seed] = 0
        members = [of_source[distance[of_source].argmin()] for i in range(len(sources)) if len(of_source := np.flatnonzero(source == i))]
        members = np.array([m for m in members if np.isfinite(distance[m])])
        free[members] = False
        if weight[members].sum() < min_agreement * total - 1e-9:
            continue
        ends = np.where(reverse[members, None], lines[members][:, [2, 3, 0, 1]], lines[members])
        pull = weight[members] * scores[members]
        fused.append((*(ends * pull[:, None]).sum(0) / pull.sum(), pull.sum() / total))
    fused = np.reshape(fused, (-1, 5))
    fused = fused[fused[:, 4] >= min_score]
    fused = fused[np.argsort(-fused[:, 4], kind="stable")]
    return fused[:, :4], fused[:, 4]


def views(model, images, size, batch):
    """Detections of every image as it is and mirrored, in its own pixels: [[(lines, scores), (lines, scores)]]."""
    plain = evaluate.detect(model, images, size, threshold=0.02, batch=batch)
    mirrored = evaluate.detect(model, [np.ascontiguousarray(i[:, ::-1]) for i in images], size, threshold=0.02, batch=batch)
    result = []
    for image, one, (lines, scores) in zip(images, plain, mirrored):
        lines = np.reshape(lines, (-1, 4)).copy()
        lines[:, [0, 2]] = image.shape[1] - 1 - lines[:, [0, 2]]
        result.append([one, (lines, scores)])
    return result


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("network")
    parser.add_argument("data", help="training folder")
    parser.add_argument("out", help="training folder to write; must not exist")
    parser.add_argument("--size", type=int, help="input edge in pixels; default: the preset's")
    parser.add_argument("--labels-weight", type=float, default=1.0, help="of the folder's labels; the network's two views share 1")
    parser.add_argument("--min-agreement", type=float, default=0.4, help="share of the weight that must have a line")
    parser.add_argument("--min-score", type=float, default=0.05)
    parser.add_argument("--batch", type=int, default=8)
    parser.add_argument("--limit", type=int, help="label only the first images")
    parser.add_argument("--device", default="cuda" if torch.cuda.is_available() else "cpu")
    args = parser.parse_args(argv)
    model, preset = load_network(args.network)
    model = model.to(args.device, memory_format=torch.channels_last)
    os.makedirs(args.out)
    os.symlink(os.path.abspath(os.path.join(args.data, "images")), os.path.join(args.out, "images"))
    shutil.copyfile(os.path.join(args.data, "manifest.json"), os.path.join(args.out, "manifest.json"))
    samples = [s for _, s in load(args.data, limit=args.limit)]
    before = after = 0
    with open(os.path.join(args.out, "labels.jsonl"), "w") as f:
        for start in range(0, len(samples), args.batch):
            chunk = samples[start : start + args.batch]
            for sample, found in zip(chunk, views(model, [s.image for s in chunk], args.size or PRESETS[preset].size, args.batch)):
                height, width = sample.image.shape[:2]
                sources = [(l, s, 0.5) for l, s in found] + [(sample.lines, sample.scores, args.labels_weight)]
                lines, scores = fuse(sources, (width, height), args.min_agreement, args.min_score)
                before, after = before + len(sample.lines), after + len(lines)
                row = {"file": sample.name, "width": width, "height": height, "lines": lines.round(2).tolist(), "scores": scores.round(4).tolist()}
                f.write(json.dumps(row) + "\n")
    print(f"{len(samples)} images, {before} lines before, {after} after")


if __name__ == "__main__":
    main()
