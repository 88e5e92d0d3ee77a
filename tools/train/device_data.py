"""Training images in the memory of the training device, warped, degraded and encoded there: for devices that outrun a loader thread.

The same views as `data.Batches` draws, up to rounding and the noise's generator; works on any torch device.
"""
import math

import numpy as np
import torch
import torch.nn.functional as F

from data import FILL, Batches, draw_view
from model import STRIDE, constant
from targets import MIDPOINT_SIGMA, MIN_LENGTH_CELLS, MIN_NEIGHBOUR

# Columns of a view's row: index of the sample, 2x3 to the input, 2x3 back, gain, shift, gray, gamma, blur, noise, quality.
INDEX, FORWARD, BACK, GAIN, SHIFT, GRAY, GAMMA, BLUR, NOISE, QUALITY = 0, 1, 7, 13, 16, 17, 18, 19, 20, 21
COLUMNS = 22

LUMA_TABLE = (
    (16, 11, 10, 16, 24, 40, 51, 61), (12, 12, 14, 19, 26, 58, 60, 55), (14, 13, 16, 24, 40, 57, 69, 56), (14, 17, 22, 29, 51, 87, 80, 62),
    (18, 22, 37, 56, 68, 109, 103, 77), (24, 35, 55, 64, 81, 104, 113, 92), (49, 64, 78, 87, 103, 121, 120, 101), (72, 92, 95, 98, 112, 100, 103, 99),
)  # fmt: skip
CHROMA_TABLE = ((17, 18, 24, 47), (18, 21, 26, 66), (24, 26, 56, 99), (47, 66, 99, 99))  # 99 elsewhere


class Store:
    """Samples as tensors: images uint8 [N, H, W, 3] padded with the fill colour, lines [N, M, 4] and scores [N, M] padded with zeros."""

    def __init__(self, samples, device):
        height, width = (max(s.image.shape[axis] for s in samples) for axis in (0, 1))
        most = max(1, max(len(s.lines) for s in samples))
        images = np.empty((len(samples), height, width, 3), np.uint8)
        images[:] = np.array(FILL, np.uint8)
        lines, scores = np.zeros((len(samples), most, 4), np.float32), np.zeros((len(samples), most), np.float32)
        for i, s in enumerate(samples):
            images[i, : s.image.shape[0], : s.image.shape[1]] = s.image
            lines[i, : len(s.lines)], scores[i, : len(s.lines)] = s.lines, s.scores
        self.images, self.lines, self.scores = (torch.from_numpy(a).to(device) for a in (images, lines, scores))


def warp(images, back, size):
    """uint8 [B, H, W, 3] seen through `back` [B, 2, 3] (input pixels -> image pixels) as float [B, 3, size, size], bilinear."""
    height, width = images.shape[1:3]
    x = torch.arange(size, device=images.device, dtype=torch.float32)
    points = torch.stack([x.expand(size, size), x[:, None].expand(size, size), torch.ones(size, size, device=images.device)], -1)
    source = points.reshape(1, -1, 3) @ back.transpose(1, 2)
    grid = (2 * source + 1) / constant((width, height), source.device) - 1
    fill = constant(FILL, images.device).view(1, 3, 1, 1)
    planes = images.permute(0, 3, 1, 2).float() - fill  # zero outside is the fill colour outside
    return F.grid_sample(planes, grid.view(-1, size, size, 2), "bilinear", "zeros", align_corners=False) + fill


def blur(images, sigma):
    """Gaussian blur of [B, 3, H, W] with sigma [B] (0 = none, at most 1.2) in pixels."""
    radius = 4
    x = torch.arange(-radius, radius + 1, device=images.device, dtype=torch.float32)
    kernel = torch.exp(-(x**2) / (2 * sigma.clamp(min=0.05)[:, None] ** 2))
    kernel = (kernel / kernel.sum(1, keepdim=True)).repeat_interleave(3, 0)
    planes = images.flatten(0, 1)[None]
    for shape, pad in (((-1, 1, 1, 9), (radius, radius, 0, 0)), ((-1, 1, 9, 1), (0, 0, radius, radius))):
        planes = F.conv2d(F.pad(planes, pad, mode="reflect"), kernel.reshape(shape), groups=len(kernel))
    return planes.view_as(images)


def compress(images, quality):
    """What JPEG with 4:2:0 chroma leaves of [B, 3, H, W] (RGB 0..255, H and W divisible by 16) at quality [B] in 1..100."""
    device = images.device
    k = torch.arange(8, device=device, dtype=torch.float32)
    dct = torch.cos((2 * k[None] + 1) * k[:, None] * math.pi / 16) / 2
    dct[0] /= math.sqrt(2)
    luma = constant(LUMA_TABLE, device)
    chroma = torch.full((8, 8), 99.0, device=device)
    chroma[:4, :4] = constant(CHROMA_TABLE, device)
    scale = torch.where(quality < 50, 5000 / quality, 200 - 2 * quality).view(-1, 1, 1, 1, 1) / 100

    def quantise(plane, table):
        b, h, w = plane.shape
        blocks = plane.view(b, h // 8, 8, w // 8, 8).transpose(2, 3)
        steps = (table * scale).round().clamp(1, 255)
        blocks = dct.T @ ((dct @ blocks @ dct.T / steps).round() * steps) @ dct
        return blocks.transpose(2, 3).reshape(b, h, w)

    r, g, b = images.unbind(1)
    y = 0.299 * r + 0.587 * g + 0.114 * b
    cb, cr = (F.avg_pool2d(c[:, None], 2)[:, 0] for c in (0.564 * (b - y), 0.713 * (r - y)))
    y = quantise(y - 128, luma) + 128
    cb, cr = (
        F.interpolate(quantise(c, chroma)[:, None], scale_factor=2, mode="bilinear", align_corners=False)[:, 0] for c in (cb, cr)
    )
    return torch.stack([y + 1.402 * cr, y - 0.344 * cb - 0.714 * cr, y + 1.772 * cb], 1).clamp(0, 255)


def photograph(images, rows, host_rows, generator):
    """`data.photograph` of float [B, 3, S, S] for the views' rows, on the device and (for what is switched on) on the host."""

    def column(i):
        return rows[:, i].view(-1, 1, 1, 1)

    images = (images - 104) * rows[:, GAIN : GAIN + 3].view(-1, 3, 1, 1) + 104 + column(SHIFT)
    images = images.clamp(0, 255)
    if (host_rows[:, GAMMA] != 1).any():
        images = 255 * (images / 255) ** column(GAMMA)
    gray = (images * constant((0.299, 0.587, 0.114), images.device).view(1, 3, 1, 1)).sum(1, keepdim=True)
    images = torch.where(column(GRAY) > 0, gray, images)
    if host_rows[:, BLUR].any():
        images = blur(images, rows[:, BLUR])
    if host_rows[:, NOISE].any():
        noise = torch.randn(images.shape, generator=generator, device=images.device)
        images = (images + column(NOISE) * noise).clamp(0, 255)
    compressed = np.flatnonzero(host_rows[:, QUALITY])
    if len(compressed):
        chosen = torch.from_numpy(compressed).to(images.device, non_blocking=True)
        images = images.index_copy(0, chosen, compress(images[chosen], rows[chosen, QUALITY]))
    return images.round()


def encode(lines, scores, size):
    """`targets.encode` of a batch: lines [B, M, 4] in cells, scores [B, M] (0 = no line) -> maps [B, 8, size, size]."""
    b, m = scores.shape
    start, delta = lines[..., :2], lines[..., 2:] - lines[..., :2]
    parallel = delta.abs() < 1e-9
    inside = ~(parallel & ((start < 0) | (start > size))).any(2)
    safe = torch.where(parallel, torch.ones_like(delta), delta)
    near, far = -start / safe, (size - start) / safe
    enter = torch.where(parallel, torch.zeros_like(near), torch.minimum(near, far)).amax(2).clamp(min=0)[..., None]
    leave = torch.where(parallel, torch.ones_like(near), torch.maximum(near, far)).amin(2).clamp(max=1)[..., None]
    ends = torch.stack([start + enter * delta, start + leave * delta], 2).clamp(0, size)  # [B, M, 2 ends, 2]
    full = ends[:, :, 1] - ends[:, :, 0]
    inside = inside & (leave > enter)[..., 0] & (full.norm(dim=2) >= MIN_LENGTH_CELLS)
    scores = torch.where(inside, scores, torch.zeros_like(scores))

    mid = ends.mean(2).clamp(max=size - 1e-4)
    half = full / 2
    half = torch.where(half[..., :1] >= half[..., 1:], half, -half)
    cell = mid.floor()
    own = ((mid - cell - 0.5) ** 2).sum(2)

    # Each cell belongs to the line with the largest weight there; at equal weights to the later line.
    step = torch.arange(-1, 2, device=lines.device)
    near = cell[:, :, None].long() + torch.cartesian_prod(step, step)  # [B, M, 9, 2]
    spread = torch.exp((own[..., None] - ((mid[:, :, None] - near - 0.5) ** 2).sum(3)) / (2 * MIDPOINT_SIGMA**2))
    weight = scores[..., None] * spread
    keep = ((near >= 0) & (near < size)).all(3) & (spread >= MIN_NEIGHBOUR) & (weight > 0)
    place = torch.where(keep, near[..., 1] * size + near[..., 0], torch.full_like(near[..., 0], size * size))
    key = (weight.double() * 2**31).long() * (m + 1) + torch.arange(1, m + 1, device=lines.device)[None, :, None]
    best = torch.zeros(b, size * size + 1, dtype=torch.long, device=lines.device)
    best.scatter_reduce_(1, place.flatten(1), torch.where(keep, key, torch.zeros_like(key)).flatten(1), "amax")
    winner = (best[:, :-1] % (m + 1)) - 1
    taken = (winner >= 0)[..., None]
    winner = winner.clamp(min=0)

    def of_winner(values):
        return values.gather(1, winner[..., None].expand(-1, -1, values.shape[2]))

    position = torch.arange(size * size, device=lines.device)
    offset = of_winner(mid) - torch.stack([position % size, position // size], 1)
    value = of_winner(scores[..., None]) * torch.exp(
        (of_winner(own[..., None]) - ((offset - 0.5) ** 2).sum(2, keepdim=True)) / (2 * MIDPOINT_SIGMA**2)
    )
    maps = torch.cat([value, value, offset.clamp(0, 1), of_winner(half)], 2) * taken

    # One point per cell along the longer axis, at the cells' centres, as cv2.line draws.
    axis = full.abs().argmax(2, keepdim=True)
    first = (ends[:, :, 0] - 0.5).gather(2, axis)
    along = full.gather(2, axis)
    lowest = torch.minimum(first, first + along).round()
    t = (lowest + torch.arange(size, device=lines.device) - first) / torch.where(along == 0, torch.ones_like(along), along)
    points = (ends[:, :, :1] - 0.5 + t.clamp(0, 1)[..., None] * full[:, :, None]).round().clamp(0, size - 1).long()
    corners = ends.clamp(max=size - 1e-4).floor().long()
    dense = []
    for xy in (points, corners):
        plane = torch.zeros(b, size * size, device=lines.device)
        index = (xy[..., 1] * size + xy[..., 0]).flatten(1)
        dense.append(plane.scatter_reduce_(1, index, scores[..., None].expand(xy.shape[:3]).flatten(1), "amax"))
    return torch.cat([maps.transpose(1, 2), torch.stack(dense, 1)], 1).view(b, 8, size, size)


class DeviceBatches(Batches):
    """Like `Batches`, but of tensors on `device`; its thread only draws the views."""

    def __init__(self, samples, *args, device, mixed=(), **more):
        everything = list(samples) + [s for extra, _ in mixed for s in extra]
        self._place = {id(s): i for i, s in enumerate(everything)}
        self._store, self._device = Store(everything, device), torch.device(device)
        super().__init__(samples, *args, mixed=mixed, **more)

    def make(self, epoch, index):
        rows = []
        for sample, rng in self.choose(epoch, index):
            height, width = sample.image.shape[:2]
            v = draw_view(width, height, self.size, rng, self.augmentation)
            back = np.linalg.inv(np.vstack([v.matrix, [0, 0, 1]]))[:2]
            rows.append([self._place[id(sample)], *v.matrix.ravel(), *back.ravel(), *v.gain, v.shift, v.gray, v.gamma, v.blur, v.noise, v.jpeg])
        return (np.array(rows, np.float32),)

    def next(self):
        epoch, index, host_rows = super().next()
        rows = torch.from_numpy(host_rows).to(self._device, non_blocking=True)
        chosen = rows[:, INDEX].long()
        generator = torch.Generator(self._device).manual_seed(hash((self.seed, epoch, index)) & 0xFFFFFFFF)
        images = warp(self._store.images[chosen], rows[:, BACK : BACK + 6].view(-1, 2, 3), self.size)
        images = photograph(images, rows, host_rows, generator)
        matrix = rows[:, FORWARD : FORWARD + 6].view(-1, 2, 3)
        ends = self._store.lines[chosen].view(len(rows), -1, 2) @ matrix[:, :, :2].transpose(1, 2) + matrix[:, None, :, 2] + 0.5
        maps = encode(ends.view(len(rows), -1, 4) / STRIDE, self._store.scores[chosen], self.size // STRIDE)
        return epoch, index, images.permute(0, 2, 3, 1), maps
