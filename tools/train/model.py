"""VLSE line segment network of the PtLine paper: stacked hourglass with basic or hybrid blocks and three heads at stride 4.

Module names are the tensor names of the weights file, so `state_dict()` is the file's content (less `aux` and counters).
"""
import functools
from dataclasses import dataclass

import torch
import torch.nn.functional as F
from torch import nn

STRIDE = 4
HOURGLASS_DEPTH = 4
MEAN = (109.730, 103.832, 98.681)  # RGB, 0..255, the values of the lcnn family
STD = (22.275, 22.124, 23.229)


@dataclass(frozen=True)
class Preset:
    """One point of the architecture's family; `size` is the default input edge in pixels, divisible by 64."""

    width: int
    stacks: int
    block: str
    size: int


PRESETS = {
    "nano": Preset(16, 1, "hybrid", 320),
    "mobile": Preset(32, 1, "hybrid", 320),
    "standard": Preset(64, 1, "hybrid", 512),
    "paper": Preset(64, 2, "hybrid", 512),
}


@functools.lru_cache(maxsize=None)
def constant(values, device):
    """A float tensor of a (nested) tuple, copied to `device` once: every such copy waits for all the work that a GPU has queued."""
    return torch.tensor(values, dtype=torch.float32, device=device)


class Block(nn.Module):
    """Pre-activation bottleneck, `channels_in` -> 2 * `planes`; the middle is a 3x3 or the hybrid 3x3 | 7x1 | 1x7 -> 1x1."""

    def __init__(self, channels_in, planes, hybrid):
        super().__init__()
        self.hybrid = hybrid
        self.bn1 = nn.BatchNorm2d(channels_in)
        self.conv1 = nn.Conv2d(channels_in, planes, 1)
        self.bn2 = nn.BatchNorm2d(planes)
        if hybrid:
            self.conv2_square = nn.Conv2d(planes, planes, 3, padding=1)
            self.conv2_vertical = nn.Conv2d(planes, planes, (7, 1), padding=(3, 0))
            self.conv2_horizontal = nn.Conv2d(planes, planes, (1, 7), padding=(0, 3))
            self.merge = nn.Conv2d(3 * planes, planes, 1)
        else:
            self.conv2 = nn.Conv2d(planes, planes, 3, padding=1)
        self.bn3 = nn.BatchNorm2d(planes)
        self.conv3 = nn.Conv2d(planes, 2 * planes, 1)
        self.project = nn.Conv2d(channels_in, 2 * planes, 1) if channels_in != 2 * planes else None

    def _middle(self, x):
        if not self.hybrid:
            return self.conv2(x)
        return self.merge(torch.cat([self.conv2_square(x), self.conv2_vertical(x), self.conv2_horizontal(x)], 1))

    def forward(self, x):
        y = self.conv1(F.relu(self.bn1(x)))
        y = self._middle(F.relu(self.bn2(y)))
        y = self.conv3(F.relu(self.bn3(y)))
        return y + (x if self.project is None else self.project(x))


class Stem(nn.Module):
    """Image [N, 3, H, W] -> features [N, 4 * width, H / 4, W / 4]; always basic blocks."""

    def __init__(self, width):
        super().__init__()
        self.conv = nn.Conv2d(3, width, 7, stride=2, padding=3)
        self.bn = nn.BatchNorm2d(width)
        self.block1 = Block(width, width, hybrid=False)
        self.block2 = Block(2 * width, width, hybrid=False)
        self.block3 = Block(2 * width, 2 * width, hybrid=False)

    def forward(self, x):
        x = self.block1(F.relu(self.bn(self.conv(x))))
        return self.block3(self.block2(F.max_pool2d(x, 2)))


class Level(nn.Module):
    """The blocks of one hourglass resolution; the innermost level has `low2` in place of the next level."""

    def __init__(self, planes, hybrid, innermost):
        super().__init__()
        self.up1 = Block(2 * planes, planes, hybrid)
        self.low1 = Block(2 * planes, planes, hybrid)
        if innermost:
            self.low2 = Block(2 * planes, planes, hybrid)
        self.low3 = Block(2 * planes, planes, hybrid)


class Hourglass(nn.ModuleDict):
    """Levels "0" (stride 4) .. "3" (stride 32, innermost)."""

    def __init__(self, planes, hybrid):
        last = HOURGLASS_DEPTH - 1
        super().__init__({str(i): Level(planes, hybrid, i == last) for i in range(HOURGLASS_DEPTH)})

    def forward(self, x, index=0):
        level = self[str(index)]
        low = level.low1(F.max_pool2d(x, 2))
        low = level.low2(low) if index == HOURGLASS_DEPTH - 1 else self.forward(low, index + 1)
        return level.up1(x) + F.interpolate(level.low3(low), scale_factor=2, mode="nearest")


class Head(nn.Module):
    """3x3 C->width, ReLU, 1x1 width->2."""

    def __init__(self, channels, width):
        super().__init__()
        self.conv1 = nn.Conv2d(channels, width, 3, padding=1)
        self.conv2 = nn.Conv2d(width, 2, 1)

    def forward(self, x):
        return self.conv2(F.relu(self.conv1(x)))


class Stack(nn.Module):
    """One hourglass with its heads; all but the last feed features and scores back into the trunk."""

    def __init__(self, width, hybrid, last):
        super().__init__()
        channels, planes = 4 * width, 2 * width
        self.hg = Hourglass(planes, hybrid)
        self.res = Block(channels, planes, hybrid)
        self.fc = nn.ModuleDict({"conv": nn.Conv2d(channels, channels, 1), "bn": nn.BatchNorm2d(channels)})
        self.head = nn.ModuleDict({name: Head(channels, width) for name in ("loc", "off", "dis")})
        # Training only, never exported: line coverage and end points, a dense signal for the first epochs.
        self.aux = nn.Conv2d(channels, 2, 1)
        if not last:
            self.remap_feature = nn.Conv2d(channels, channels, 1)
            self.remap_score = nn.Conv2d(6, channels, 1)

    def forward(self, x):
        y = self.res(self.hg(x))
        y = F.relu(self.fc["bn"](self.fc["conv"](y)))
        if not self.training:
            return y, torch.cat([head(y) for head in self.head.values()], 1)
        # Same function, the three 3x3 convolutions as one: a third of their time.
        convs = [head.conv1 for head in self.head.values()]
        hidden = F.conv2d(y, torch.cat([c.weight for c in convs]), torch.cat([c.bias for c in convs]), padding=1)
        parts = F.relu(hidden).chunk(len(convs), 1)
        return y, torch.cat([head.conv2(part) for head, part in zip(self.head.values(), parts)], 1)


class Vlse(nn.Module):
    """forward: normalised RGB [N, 3, H, W], H and W divisible by 64 -> raw maps [N, 6, H / 4, W / 4] of the last stack.

    Planes: loc logits (2), offset logits (x, y), displacement (dx, dy) / displacement_scale.
    """

    def __init__(self, width, stacks=1, block="hybrid"):
        super().__init__()
        if block not in ("basic", "hybrid"):
            raise ValueError(f"block must be basic or hybrid, not {block}")
        self.width, self.stacks, self.block = width, stacks, block
        self.stem = Stem(width)
        for i in range(stacks):
            self.add_module(f"stack{i}", Stack(width, block == "hybrid", i == stacks - 1))

    def forward_all(self, x):
        """Raw maps and auxiliary maps of every stack, first stack first: [(maps [N,6,h,w], aux [N,2,h,w])]."""
        x = self.stem(x)
        outputs = []
        for i in range(self.stacks):
            stack = getattr(self, f"stack{i}")
            feature, maps = stack(x)
            outputs.append((maps, stack.aux(feature) if self.training else None))
            if i + 1 < self.stacks:
                x = x + stack.remap_feature(feature) + stack.remap_score(maps)
        return outputs

    def forward(self, x):
        return self.forward_all(x)[-1][0]


def exported_state(model):
    """The tensors of the weights file: everything that inference uses, under its own name."""
    return {k: v for k, v in model.state_dict().items() if ".aux." not in k and not k.endswith("num_batches_tracked")}


def build(preset, **overrides):
    """A network of a named preset; `overrides` replace width, stacks or block."""
    p = PRESETS[preset]
    arguments = {"width": p.width, "stacks": p.stacks, "block": p.block, **overrides}
    return Vlse(**arguments)
