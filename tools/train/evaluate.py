"""sAP and pixel metrics of a weights file or training state on a folder with images/ and annotations.json.

usage: evaluate.py WEIGHTS DIR [--size N] [--score-threshold X] [--top-k N] [--nms-decay X]
                   [--duplicate-decay X] [--duplicate-distance X] [--detections OUT.json]
"""
import argparse
import json
import os

import numpy as np
import torch
import torch.nn.functional as F

import weights_file
from images import read_all
from model import MEAN, STD, STRIDE, constant
from pixel_ap import pixel_metrics
from sap import sap
from targets import clip_lines, decay_duplicates, decode

DISPLACEMENT_SCALE = 16.0
TOP_K = 1000
NMS_DECAY = 0.5  # sAP10 is 2 above that of 0, and 1 above 0.8's
# Ranking near duplicates lower gains 2.5 sAP10; dropping them 0.6.
DUPLICATE_DECAY, DUPLICATE_DISTANCE = 0.4, 2.0


def to_tensor(images):
    """RGB 0..255 [N, H, W, 3], array or tensor -> normalised float [N, 3, H, W] in channels-last memory."""
    x = torch.as_tensor(images).permute(0, 3, 1, 2).float()
    mean, std = (constant(v, x.device).view(1, 3, 1, 1) for v in (MEAN, STD))
    return ((x - mean) / std).contiguous(memory_format=torch.channels_last)


def resized(image, size, device):
    """RGB uint8 [H, W, 3] -> float [size, size, 3], bilinear without antialiasing like the runtime."""
    x = torch.from_numpy(image).to(device).permute(2, 0, 1)[None].float()
    return F.interpolate(x, (size, size), mode="bilinear", align_corners=False)[0].permute(1, 2, 0)


@torch.no_grad()
def detect(model, images, size, displacement_scale=DISPLACEMENT_SCALE, top_k=TOP_K, nms_decay=NMS_DECAY, threshold=0.0, batch=8,
           duplicate_decay=DUPLICATE_DECAY, duplicate_distance=DUPLICATE_DISTANCE):
    """Lines in pixels of each RGB image (0 = centre of the first pixel), clipped to it, with scores: [(lines, scores)]."""
    device = next(model.parameters()).device
    model.eval()
    results = []
    for start in range(0, len(images), batch):
        chunk = images[start : start + batch]
        maps = model(to_tensor(torch.stack([resized(i, size, device) for i in chunk]))).float()
        p = torch.sigmoid(maps[:, 1] - maps[:, 0]).cpu().numpy()
        offset = torch.sigmoid(maps[:, 2:4]).cpu().numpy()
        dis = (maps[:, 4:6] * displacement_scale).cpu().numpy()
        for k, image in enumerate(chunk):
            lines, scores = decode(p[k], offset[k], dis[k], top_k, nms_decay, threshold)
            lines, scores = decay_duplicates(lines, scores, duplicate_distance, duplicate_decay)
            lines, scores = lines[scores >= threshold], scores[scores >= threshold]
            cells = size // STRIDE
            lines, inside = clip_lines(lines, cells, cells)
            lines, scores = lines[inside], scores[inside]
            h, w = image.shape[:2]
            results.append((lines * STRIDE * np.array([w / size, h / size] * 2) - 0.5, scores))
    return results


def load_annotated(folder):
    """[(name, RGB image, lines [N, 4] in pixels)] of a folder with images/ and annotations.json."""
    with open(os.path.join(folder, "annotations.json")) as f:
        annotations = json.load(f)
    images = read_all([os.path.join(folder, "images", a["filename"]) for a in annotations])
    return [(a["filename"], i, np.asarray(a["lines"], float).reshape(-1, 4)) for a, i in zip(annotations, images)]


def score(model, annotated, size, **options):
    """(sAP5, sAP10, sAP15) and the detections of a model on `load_annotated` data."""
    detections = detect(model, [i for _, i, _ in annotated], size, **options)
    sizes = [(i.shape[1], i.shape[0]) for _, i, _ in annotated]
    return sap(detections, [t for _, _, t in annotated], sizes), detections


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("weights", help=".safetensors file")
    parser.add_argument("data", help="folder with images/ and annotations.json")
    parser.add_argument("--size", type=int, help="input edge in pixels; default: the file's")
    parser.add_argument("--score-threshold", type=float, help="default: the file's, like all of these")
    parser.add_argument("--top-k", type=int, help="at most so many lines per image")
    parser.add_argument("--nms-decay", type=float, help="score factor of non-maxima")
    parser.add_argument("--duplicate-decay", type=float, help="score factor for every better line that is near")
    parser.add_argument("--duplicate-distance", type=float, help="squared distances of the end points in cells, summed")
    parser.add_argument("--detections", help="also write the segments as JSON")
    args = parser.parse_args()
    model, metadata = weights_file.load_model(args.weights)
    given = {"score_threshold": args.score_threshold, "top_k": args.top_k, "nms_decay": args.nms_decay,
             "duplicate_decay": args.duplicate_decay, "duplicate_distance": args.duplicate_distance}
    absent = {"nms_decay": 0.8, "duplicate_decay": 1.0, "duplicate_distance": 2.0}  # what the runtime takes without them
    chosen = {k: float(metadata.get(k, absent.get(k))) if v is None else v for k, v in given.items()}
    annotated = load_annotated(args.data)
    size = args.size or int(metadata["input_width"])
    values, detections = score(
        model, annotated, size, displacement_scale=float(metadata["displacement_scale"]), top_k=int(chosen["top_k"]),
        nms_decay=chosen["nms_decay"], threshold=chosen["score_threshold"],
        duplicate_decay=chosen["duplicate_decay"], duplicate_distance=chosen["duplicate_distance"],
    )
    pixels = pixel_metrics(detections, [t for _, _, t in annotated], [(i.shape[1], i.shape[0]) for _, i, _ in annotated])
    row = {"sAP5": values[0], "sAP10": values[1], "sAP15": values[2], "FH": pixels[0], "APH": pixels[1]}
    print(json.dumps({**row, "images": len(annotated), "size": size}))
    if args.detections:
        rows = [
            {"file": n, "width": i.shape[1], "height": i.shape[0], "lines": l.tolist(), "scores": s.tolist()}
            for (n, i, _), (l, s) in zip(annotated, detections)
        ]
        with open(args.detections, "w") as f:
            json.dump(rows, f)


if __name__ == "__main__":
    torch.set_num_threads(os.cpu_count() or 1)
    main()
