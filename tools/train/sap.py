"""Structural average precision of line segments, the L-CNN protocol (docs/evaluation.md): scaled to 128 x 128, one hit per line."""
import numpy as np


def hits(lines, truth, threshold):
    """For lines [N, 4] in descending order of score: does each take a line of truth [M, 4] not yet taken? All in 128ths."""
    hit, taken = np.zeros(len(lines), bool), np.zeros(len(truth), bool)
    if not len(lines) or not len(truth):
        return hit
    a, b = lines.reshape(-1, 1, 2, 2), truth.reshape(1, -1, 2, 2)
    distance = np.minimum(((a - b) ** 2).sum((2, 3)), ((a - b[:, :, ::-1]) ** 2).sum((2, 3)))
    nearest, near = distance.argmin(1), distance.min(1)
    for i, (j, d) in enumerate(zip(nearest, near)):
        if d < threshold and not taken[j]:  # the second-nearest line is never tried
            hit[i] = taken[j] = True
    return hit


def average_precision(detections, truth, threshold):
    """100 x area under the precision envelope; detections = [(lines, scores)] and truth = [lines] per image, in 128ths."""
    total = sum(len(t) for t in truth)
    if not total:
        raise ValueError("sAP needs at least one line of ground truth")
    positive, scores = [], []
    for (lines, score), expected in zip(detections, truth):
        order = np.argsort(-score, kind="stable")
        positive.append(hits(lines[order], expected, threshold))
        scores.append(score[order])
    positive = np.concatenate(positive)[np.argsort(-np.concatenate(scores), kind="stable")]
    if not len(positive):
        return 0.0
    recall = np.concatenate([[0], np.cumsum(positive) / total])
    precision = np.cumsum(positive) / np.arange(1, len(positive) + 1)
    precision = np.maximum.accumulate(precision[::-1])[::-1]
    return 100 * float(((recall[1:] - recall[:-1]) * precision).sum())


def sap(detections, truth, sizes):
    """sAP5, sAP10, sAP15 of lines in pixels of images with sizes [(width, height)]."""
    scales = [np.array([128 / w, 128 / h] * 2) for w, h in sizes]
    scaled = [(np.reshape(l, (-1, 4)) * s, np.asarray(c, float)) for (l, c), s in zip(detections, scales)]
    expected = [np.reshape(t, (-1, 4)) * s for t, s in zip(truth, scales)]
    return tuple(average_precision(scaled, expected, t) for t in (5, 10, 15))
