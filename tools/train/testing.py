"""What several tests need: a tiny training folder, and training runs as processes."""
import json
import os
import subprocess
import sys

import cv2
import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))


def write_images(folder, count=6):
    """A training folder of synthetic rectangles with exact labels."""
    os.makedirs(os.path.join(folder, "images"))
    rng = np.random.default_rng(1)
    manifest, labels = [], []
    for i in range(count):
        image = np.full((96, 128, 3), 90, np.uint8)
        x1, y1, x2, y2 = (int(v) for v in (*rng.integers(5, 40, 2), *rng.integers(50, 90, 2)))
        cv2.rectangle(image, (x1, y1), (x2, y2), (200, 180, 160), -1)
        name = f"{i}.png"
        cv2.imwrite(os.path.join(folder, "images", name), image)
        lines = [[x1, y1, x2, y1], [x2, y1, x2, y2], [x2, y2, x1, y2], [x1, y2, x1, y1]]
        manifest.append({"file": name, "source": "synthetic", "group": name, "width": 128, "height": 96})
        labels.append({"file": name, "width": 128, "height": 96, "lines": lines, "scores": [0.9] * 4})
    with open(os.path.join(folder, "manifest.json"), "w") as f:
        json.dump(manifest, f)
    with open(os.path.join(folder, "labels.jsonl"), "w") as f:
        f.writelines(json.dumps(label) + "\n" for label in labels)


def start_training(images, out, epochs, *more):
    command = [sys.executable, os.path.join(HERE, "train.py"), "--data", images, "--out", out, "--size", "64", "--batch", "2",
               "--evaluate-size", "64", "--threads", "1", "--warmup-steps", "2", "--fixed-sign-steps", "2", "--device", "cpu",
               "--save-minutes", "0", "--epochs", str(epochs), *more]
    return subprocess.Popen(command, stderr=subprocess.PIPE, text=True)


def finish(process):
    _, errors = process.communicate(timeout=300)
    if process.returncode:
        raise AssertionError(errors)


def read_log(run):
    """The rows of a run's log."""
    with open(os.path.join(run, "log.jsonl")) as f:
        return [json.loads(row) for row in f]
