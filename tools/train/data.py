"""Training images with machine labels: held in memory, augmented and encoded by a loader thread."""
import json
import os
import queue
import threading
from dataclasses import dataclass

import cv2
import numpy as np

from model import STRIDE
from targets import encode


@dataclass
class Sample:
    """One photograph: RGB uint8 [H, W, 3], lines [N, 4] in pixels (0 = centre of the first pixel), scores [N] in [0, 1]."""

    name: str
    image: np.ndarray
    lines: np.ndarray
    scores: np.ndarray


@dataclass(frozen=True)
class Augmentation:
    """Ranges of the random view of an image; the defaults of the dataclass switch everything off."""

    zoom: tuple = (1.0, 1.0)
    aspect: float = 0.0
    flip: float = 0.0
    upside_down: float = 0.0
    quarter_turn: float = 0.0
    contrast: float = 0.0
    gray: float = 0.0


TRAINING = Augmentation(zoom=(0.8, 1.5), aspect=0.1, flip=0.5, upside_down=0.05, quarter_turn=0.05, contrast=0.25, gray=0.05)


def load(folder, min_score=0.05, limit=None):
    """Samples of `folder`/labels.jsonl with manifest groups; labels below `min_score` are left out."""
    with open(os.path.join(folder, "manifest.json")) as f:
        groups = {m["file"]: m["group"] for m in json.load(f)}
    samples = []
    with open(os.path.join(folder, "labels.jsonl")) as f:
        for row in f:
            label = json.loads(row)
            path = os.path.join(folder, "images", label["file"])
            image = cv2.imread(path, cv2.IMREAD_COLOR)
            if image is None:
                raise OSError(f"cannot read image {path}")
            scores = np.asarray(label["scores"], np.float32)
            lines = np.asarray(label["lines"], np.float32).reshape(-1, 4)
            keep = scores >= min_score
            sample = Sample(label["file"], cv2.cvtColor(image, cv2.COLOR_BGR2RGB), lines[keep], scores[keep])
            samples.append((groups.get(label["file"], label["file"]), sample))
            if limit and len(samples) >= limit:
                break
    return samples


def split(samples, every=40):
    """(training, validation) lists; whole groups go to validation, about one in `every` of the groups."""
    groups = sorted({g for g, _ in samples})
    held = set(groups[every // 2 :: every])
    return [s for g, s in samples if g not in held], [s for g, s in samples if g in held]


def view_matrix(width, height, size, rng, augmentation):
    """2x3 matrix from label pixels to pixels of the network input (0 = centre of the first pixel), and the two zooms."""
    a = augmentation
    zoom = np.exp(rng.uniform(*np.log(a.zoom)))
    aspect = np.exp(rng.uniform(-a.aspect, a.aspect))
    m = np.diag([size / width * zoom * aspect, size / height * zoom / aspect, 1.0])
    m = m @ np.array([[1, 0, 0.5], [0, 1, 0.5], [0, 0, 1.0]])
    span = size * zoom * np.array([aspect, 1 / aspect])
    m[:2, 2] += rng.uniform(0, 1, 2) * (size - span)  # a random crop, or a random place on the canvas when smaller
    for chance, turn in (
        (a.flip, [[-1, 0, size], [0, 1, 0], [0, 0, 1.0]]),
        (a.upside_down, [[1, 0, 0], [0, -1, size], [0, 0, 1.0]]),
        (a.quarter_turn, [[0, 1, 0], [-1, 0, size], [0, 0, 1.0]]),
    ):
        if rng.uniform() < chance:
            m = np.array(turn) @ m
    m[:2, 2] -= 0.5
    return m[:2]


def render(sample, size, rng, augmentation):
    """One training pair: RGB uint8 [size, size, 3] and the maps of `encode`."""
    height, width = sample.image.shape[:2]
    m = view_matrix(width, height, size, rng, augmentation)
    fill = (110, 104, 99)
    image = cv2.warpAffine(sample.image, m, (size, size), flags=cv2.INTER_LINEAR, borderValue=fill)
    if augmentation.contrast:
        gain = np.exp(rng.uniform(-1, 1) * augmentation.contrast + rng.uniform(-1, 1, 3) * augmentation.contrast / 4)
        shift = rng.uniform(-1, 1) * 100 * augmentation.contrast
        table = (np.arange(256)[:, None] - 104) * gain + 104 + shift
        image = cv2.LUT(image, np.clip(table, 0, 255).astype(np.uint8).reshape(256, 1, 3))
    if rng.uniform() < augmentation.gray:
        image = cv2.cvtColor(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), cv2.COLOR_GRAY2RGB)
    ends = sample.lines.reshape(-1, 2) @ m[:, :2].T + m[:, 2] + 0.5
    cells = size // STRIDE
    return image, encode(ends.reshape(-1, 4) / STRIDE, sample.scores, cells, cells)


class Batches:
    """Endless (epoch, index in epoch, images uint8 [B, S, S, 3], maps float32 [B, 8, S/4, S/4]), prepared by threads.

    The content of a batch is a function of (seed, epoch, index) alone, so a resumed run sees what the unbroken one sees.
    `part` = (i, n) yields only every n-th image from the i-th on: one of n processes that share the batch.
    """

    def __init__(self, samples, batch, size, augmentation, seed=0, epoch=0, index=0, part=(0, 1), depth=3):
        self.samples, self.batch, self.size, self.augmentation, self.seed = samples, batch, size, augmentation, seed
        self.part, self.per_epoch = part, max(1, len(samples) // batch)
        self._queue = queue.Queue(depth)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, args=(epoch, index), daemon=True)
        self._thread.start()

    def make(self, epoch, index):
        order = np.random.default_rng((self.seed, epoch)).permutation(len(self.samples))
        part, parts = self.part
        chosen = order[index * self.batch : (index + 1) * self.batch][part::parts]
        pairs = [
            render(self.samples[i], self.size, np.random.default_rng((self.seed, epoch, int(i))), self.augmentation)
            for i in chosen
        ]
        return np.stack([p[0] for p in pairs]), np.stack([p[1] for p in pairs])

    def _run(self, epoch, index):
        try:
            while not self._stop.is_set():
                if index >= self.per_epoch:
                    epoch, index = epoch + 1, 0
                self._put((epoch, index, *self.make(epoch, index)))
                index += 1
        except Exception as error:  # handed to the consumer: a dead loader must not look like a slow one
            self._put(error)

    def _put(self, item):
        while not self._stop.is_set():
            try:
                return self._queue.put(item, timeout=0.5)
            except queue.Full:
                continue

    def next(self):
        item = self._queue.get()
        if isinstance(item, Exception):
            raise item
        return item

    def close(self):
        self._stop.set()
        self._thread.join()
