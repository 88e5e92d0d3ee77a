"""Training images with machine labels: held in memory, augmented and encoded by a loader thread."""
import json
import os
import queue
import sys
import threading
from dataclasses import dataclass, replace

import numpy as np

from images import cv2, read_all
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
    gamma: float = 0.0  # largest |log| of the exponent
    blur: float = 0.0  # largest sigma in pixels of the input; of half of the images, like noise
    noise: float = 0.0  # largest sigma in grey levels
    jpeg: float = 0.0  # chance of compression at quality 30 to 90


TRAINING = Augmentation(zoom=(0.8, 1.5), aspect=0.1, flip=0.5, upside_down=0.05, quarter_turn=0.05, contrast=0.25, gray=0.05)

# What bad cameras add. Off unless asked for: no training has shown yet that it helps.
DEGRADED = replace(TRAINING, gamma=0.3, blur=1.0, noise=8.0, jpeg=0.3)

FILL = (110, 104, 99)  # outside the image


@dataclass(frozen=True)
class View:
    """One draw of an `Augmentation`: how an image becomes an input."""

    matrix: np.ndarray  # 2x3, label pixels -> pixels of the input (0 = centre of the first pixel)
    gain: np.ndarray  # [3], about grey level 104
    shift: float = 0.0
    gray: bool = False
    gamma: float = 1.0
    blur: float = 0.0
    noise: float = 0.0
    jpeg: int = 0  # quality; 0 = not compressed
    seed: int = 0  # of the noise


def load(folder, min_score=0.05, limit=None):
    """[(group, sample)] of `folder`/labels.jsonl with manifest groups; labels below `min_score` are left out."""
    with open(os.path.join(folder, "manifest.json")) as f:
        groups = {m["file"]: m["group"] for m in json.load(f)}
    with open(os.path.join(folder, "labels.jsonl")) as f:
        labels = [json.loads(row) for row, _ in zip(f, range(limit or sys.maxsize))]
    samples = []
    for label, image in zip(labels, read_all([os.path.join(folder, "images", a["file"]) for a in labels])):
        # An image packed smaller than its labels; both are aligned at the outer edges of the border pixels.
        ratio = np.array([image.shape[1] / label["width"], image.shape[0] / label["height"]] * 2, np.float32)
        scores = np.asarray(label["scores"], np.float32)
        lines = (np.asarray(label["lines"], np.float32).reshape(-1, 4) + 0.5) * ratio - 0.5
        keep = scores >= min_score
        samples.append((groups.get(label["file"], label["file"]), Sample(label["file"], image, lines[keep], scores[keep])))
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


def draw_view(width, height, size, rng, augmentation):
    """A random view; terms that are switched off draw nothing, so switching one on leaves the others as they are."""
    a = augmentation
    matrix = view_matrix(width, height, size, rng, a)
    gain, shift = np.ones(3), 0.0
    if a.contrast:
        gain = np.exp(rng.uniform(-1, 1) * a.contrast + rng.uniform(-1, 1, 3) * a.contrast / 4)
        shift = rng.uniform(-1, 1) * 100 * a.contrast
    gray = bool(rng.uniform() < a.gray)
    gamma = float(np.exp(rng.uniform(-1, 1) * a.gamma)) if a.gamma else 1.0
    blur = max(0.0, rng.uniform(-1, 1)) * a.blur if a.blur else 0.0
    noise = max(0.0, rng.uniform(-1, 1)) * a.noise if a.noise else 0.0
    jpeg = int(rng.integers(30, 91)) if a.jpeg and rng.uniform() < a.jpeg else 0
    return View(matrix, gain, shift, gray, gamma, blur, noise, jpeg, int(rng.integers(1 << 31)) if noise else 0)


def photograph(image, view):
    """Colours of an RGB uint8 image as a worse camera would have taken them."""
    if view.shift or view.gamma != 1 or (view.gain != 1).any():
        table = np.clip((np.arange(256)[:, None] - 104) * view.gain + 104 + view.shift, 0, 255)
        table = 255 * (table / 255) ** view.gamma
        image = cv2.LUT(image, table.astype(np.uint8).reshape(256, 1, 3))
    if view.gray:
        image = cv2.cvtColor(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), cv2.COLOR_GRAY2RGB)
    if view.blur:
        image = cv2.GaussianBlur(image, (0, 0), view.blur)
    if view.noise:
        noise = np.random.default_rng(view.seed).standard_normal(image.shape, np.float32)
        image = np.clip(np.rint(image + view.noise * noise), 0, 255).astype(np.uint8)
    if view.jpeg:
        _, data = cv2.imencode(".jpg", image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, view.jpeg])
        image = cv2.imdecode(data, cv2.IMREAD_COLOR)[..., ::-1]
    return image


def ends_in_cells(lines, matrix):
    """Lines [N, 4] in label pixels -> cells of the network's output."""
    ends = lines.reshape(-1, 2) @ matrix[:, :2].T + matrix[:, 2] + 0.5
    return ends.reshape(-1, 4) / STRIDE


def render(sample, size, rng, augmentation):
    """One training pair: RGB uint8 [size, size, 3] and the maps of `encode`."""
    height, width = sample.image.shape[:2]
    view = draw_view(width, height, size, rng, augmentation)
    image = cv2.warpAffine(sample.image, view.matrix, (size, size), flags=cv2.INTER_LINEAR, borderValue=FILL)
    cells = size // STRIDE
    return photograph(image, view), encode(ends_in_cells(sample.lines, view.matrix), sample.scores, cells, cells)


class Batches:
    """Endless (epoch, index in epoch, images uint8 [B, S, S, 3], maps float32 [B, 8, S/4, S/4]), prepared by threads.

    The content of a batch is a function of (seed, epoch, index) alone, so a resumed run sees what the unbroken one sees.
    `part` = (i, n) yields only every n-th image from the i-th on: one of n processes that share the batch.
    `mixed` = [(samples, fraction)]: every batch has that fraction of other images, drawn at random.
    """

    def __init__(self, samples, batch, size, augmentation, seed=0, epoch=0, index=0, part=(0, 1), depth=3, mixed=()):
        self.samples, self.batch, self.size, self.augmentation, self.seed = samples, batch, size, augmentation, seed
        self.part, self.mixed = part, [(m, round(batch * fraction)) for m, fraction in mixed]
        self.own = batch - sum(count for _, count in self.mixed)
        if self.own < 1:
            raise ValueError("the mixed-in images leave no place in the batch for the training images")
        self.per_epoch = max(1, len(samples) // self.own)
        self._queue = queue.Queue(depth)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, args=(epoch, index), daemon=True)
        self._thread.start()

    def choose(self, epoch, index):
        """This process's share of a batch: [(sample, generator of its view)]."""
        order = np.random.default_rng((self.seed, epoch)).permutation(len(self.samples))
        chosen = [
            (self.samples[i], np.random.default_rng((self.seed, epoch, int(i))))
            for i in order[index * self.own : (index + 1) * self.own]
        ]
        for number, (samples, count) in enumerate(self.mixed):
            rng = np.random.default_rng((self.seed, epoch, index, number))
            chosen += [(samples[int(rng.integers(len(samples)))], rng) for _ in range(count)]
        first, parts = self.part
        return chosen[first::parts]

    def make(self, epoch, index):
        """The content of a batch, made by the thread."""
        pairs = [render(sample, self.size, rng, self.augmentation) for sample, rng in self.choose(epoch, index)]
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
