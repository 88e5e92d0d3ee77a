"""Pixel metrics F^H and AP^H of line segments (docs/evaluation.md), the same numbers as tools/metrics/pixel_ap.h."""
import numpy as np

THRESHOLDS = [k / 50 for k in range(49, 0, -1)]
REACH = 0.01  # of the image's diagonal


def raster(line, width, height):
    """Pixel indices (y * width + x) of a line [x1, y1, x2, y2] from rounded end to rounded end, those in the image."""
    x0, y0, x1, y1 = (int(v) for v in np.floor(np.asarray(line, float) + 0.5))
    steps = max(abs(x1 - x0), abs(y1 - y0))
    i, twice = np.arange(steps + 1), max(2 * steps, 1)
    x, y = x0 + (2 * i * (x1 - x0) + steps) // twice, y0 + (2 * i * (y1 - y0) + steps) // twice
    inside = (x >= 0) & (y >= 0) & (x < width) & (y < height)
    return (y * width + x)[inside]


class Matcher:
    """Largest one-to-one matching of drawn pixels to annotated ones within `distance`; drawn pixels are added one by one."""

    def __init__(self, targets, width, height, distance):
        self.shape, self.free, self.seen = (height, width), np.zeros(width * height, bool), np.ones(width * height, bool)
        self.free[targets], self.seen[targets] = True, False  # not to be visited: no target, or leads nowhere
        r = int(distance)
        dy, dx = np.mgrid[-r : r + 1, -r : r + 1]
        near = dx**2 + dy**2 <= distance**2
        self.dy, self.dx = dy[near], dx[near]
        self.match, self.drawn, self.matched = {}, set(), 0  # match: target -> candidate

    def neighbours(self, pixel):
        y, x = divmod(pixel, self.shape[1])
        y, x = y + self.dy, x + self.dx
        inside = (y >= 0) & (x >= 0) & (y < self.shape[0]) & (x < self.shape[1])
        index = (y * self.shape[1] + x)[inside]
        return index[~self.seen[index]]

    def add(self, pixel):
        if pixel in self.drawn:
            return
        self.drawn.add(pixel)
        reached_from, previous, queue = {}, {pixel: None}, [pixel]
        for candidate in queue:
            targets = self.neighbours(candidate)
            self.seen[targets] = True
            reached_from.update((int(t), candidate) for t in targets)
            free = targets[self.free[targets]]
            if len(free):
                target = int(free[0])
                self.free[target] = False
                while target is not None:  # every candidate on the path moves on to the target that it reached
                    candidate = reached_from[target]
                    self.match[target], target = candidate, previous[candidate]
                self.matched += 1
                self.seen[list(reached_from)] = False
                return
            for target in map(int, targets):
                previous[self.match[target]] = target
                queue.append(self.match[target])


def pixel_metrics(detections, truth, sizes):
    """(F^H, AP^H) in percent; detections = [(lines, scores)], truth = [lines] in pixels of images with sizes [(width, height)]."""
    counts = np.zeros((len(THRESHOLDS), 3))  # matched, drawn, annotated
    for (lines, scores), expected, (width, height) in zip(detections, truth, sizes):
        targets = np.unique(np.concatenate([raster(t, width, height) for t in expected] + [np.zeros(0, int)]))
        matcher = Matcher(targets, width, height, REACH * np.hypot(width, height))
        order, k = np.argsort(-np.asarray(scores, float), kind="stable"), 0
        for row, threshold in zip(counts, THRESHOLDS):
            while k < len(order) and scores[order[k]] >= threshold:
                for pixel in raster(lines[order[k]], width, height):
                    matcher.add(int(pixel))
                k += 1
            row += matcher.matched, len(matcher.drawn), len(targets)
    precision, recall = (counts[:, 0] / np.maximum(counts[:, i], 1) for i in (1, 2))
    f = np.max(2 * precision * recall / np.maximum(precision + recall, 1e-12))
    envelope = np.maximum.accumulate(precision[::-1])[::-1]
    return 100 * float(f), 100 * float((np.diff(recall, prepend=0) * envelope).sum())
