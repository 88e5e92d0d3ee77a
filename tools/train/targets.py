"""Lines -> training maps at stride 4, and back. All coordinates in cells, 0 = left / top edge of the first cell."""
import numpy as np

from images import cv2

# Spread of the labeller's midpoints in cells: neighbours of a midpoint's cell are soft positives.
MIDPOINT_SIGMA = 0.5
MIN_NEIGHBOUR = 0.05
MIN_LENGTH_CELLS = 1.0


def clip_lines(lines, width, height):
    """Clips [N, 4] to [0, width] x [0, height]; returns the clipped lines and the mask [N] of those that remain."""
    start, delta = lines[:, :2].astype(np.float64), (lines[:, 2:] - lines[:, :2]).astype(np.float64)
    enter, leave = np.zeros(len(lines)), np.ones(len(lines))
    inside = np.ones(len(lines), bool)
    for axis, limit in ((0, width), (1, height)):
        d, p = delta[:, axis], start[:, axis]
        parallel = np.abs(d) < 1e-9
        inside &= ~(parallel & ((p < 0) | (p > limit)))
        safe = np.where(parallel, 1.0, d)
        a, b = -p / safe, (limit - p) / safe
        enter = np.where(parallel, enter, np.maximum(enter, np.minimum(a, b)))
        leave = np.where(parallel, leave, np.minimum(leave, np.maximum(a, b)))
    inside &= leave > enter
    clipped = np.concatenate([start + enter[:, None] * delta, start + leave[:, None] * delta], 1)
    return clipped, inside


def canonical(dis):
    """Sign of [N, 2] displacements such that dx >= dy: the jump is at 45 degrees, the rarest direction in buildings."""
    return np.where((dis[:, :1] >= dis[:, 1:]), dis, -dis)


def encode(lines, scores, width, height):
    """Lines [N, 4] in cells with scores [N] in [0, 1] -> float32 maps [8, height, width].

    Planes: midpoint score; weight of the geometry; offset x, y in [0, 1]; displacement dx, dy in cells; line coverage; end points.
    """
    maps = np.zeros((8, height, width), np.float32)
    lines, inside = clip_lines(np.asarray(lines, np.float64).reshape(-1, 4), width, height)
    inside &= np.hypot(lines[:, 2] - lines[:, 0], lines[:, 3] - lines[:, 1]) >= MIN_LENGTH_CELLS
    lines, scores = lines[inside], np.asarray(scores, np.float64)[inside]
    if not len(lines):
        return maps
    order = np.argsort(scores, kind="stable")  # a collision of midpoints is won by the better line
    lines, scores = lines[order], scores[order]
    mid = np.minimum((lines[:, :2] + lines[:, 2:]) / 2, [width - 1e-4, height - 1e-4])
    dis = canonical((lines[:, 2:] - lines[:, :2]) / 2)
    cell = np.floor(mid).astype(int)
    own = ((mid - cell - 0.5) ** 2).sum(1)

    near = cell[:, None, :] + np.stack(np.meshgrid((-1, 0, 1), (-1, 0, 1)), -1).reshape(1, 9, 2)
    offset = mid[:, None, :] - near
    spread = np.exp((own[:, None] - ((offset - 0.5) ** 2).sum(2)) / (2 * MIDPOINT_SIGMA**2))
    weight = scores[:, None] * spread
    keep = (near >= 0).all(2) & (near[..., 0] < width) & (near[..., 1] < height) & (spread >= MIN_NEIGHBOUR)
    weight, line = weight[keep], np.broadcast_to(np.arange(len(lines))[:, None], keep.shape)[keep]
    x, y, offset = near[keep][:, 0], near[keep][:, 1], np.clip(offset[keep], 0, 1)
    order = np.argsort(weight, kind="stable")
    x, y, weight, line, offset = x[order], y[order], weight[order], line[order], offset[order]
    maps[0, y, x] = weight
    maps[1, y, x] = weight
    maps[2:4, y, x] = offset.T
    maps[4:6, y, x] = dis[line].T

    fixed = np.round((lines - 0.5) * 16).astype(int)  # cv2 draws with pixel centres at integers, 4 fractional bits
    for (x1, y1, x2, y2), score in zip(fixed.tolist(), scores.tolist()):
        cv2.line(maps[6], (x1, y1), (x2, y2), score, 1, cv2.LINE_8, 4)
    ends = np.minimum(lines.reshape(-1, 2), [width - 1e-4, height - 1e-4]).astype(int)
    maps[7, ends[:, 1], ends[:, 0]] = np.repeat(scores, 2)
    return maps


def decay_duplicates(lines, scores, distance, decay):
    """Scores times `decay` for every better line whose ends are near: squared distances in cells sum to less than `distance`.

    lines [N, 4] in cells, best score first; returns both, best new score first.
    """
    a, b = lines.reshape(-1, 1, 2, 2), lines.reshape(1, -1, 2, 2)
    near = np.minimum(((a - b) ** 2).sum((2, 3)), ((a - b[:, :, ::-1]) ** 2).sum((2, 3))) < distance
    scores = scores * decay ** np.tril(near, -1).sum(1)
    order = np.argsort(-scores, kind="stable")
    return lines[order], scores[order]


def decode(p, offset, dis, top_k, nms_decay=0.8, score_threshold=0.0):
    """Maps p [h, w] in [0, 1], offset [2, h, w] in [0, 1], dis [2, h, w] in cells -> lines [K, 4] in cells, scores [K] descending."""
    height, width = p.shape
    padded = np.pad(p, 1, constant_values=-1)
    best = np.max([padded[1 + j : 1 + j + height, 1 + i : 1 + i + width] for j in (-1, 0, 1) for i in (-1, 0, 1)], 0)
    score = np.where(p < best, p * nms_decay, p).ravel()
    index = np.argsort(-score, kind="stable")[:top_k]
    index = index[score[index] > score_threshold]
    y, x = np.divmod(index, width)
    centre = np.stack([x, y], 1) + offset.reshape(2, -1)[:, index].T
    half = dis.reshape(2, -1)[:, index].T
    return np.concatenate([centre - half, centre + half], 1), score[index]
