"""Starts a wider network from a trained narrower one: every channel is doubled such that the output stays the same.

usage: widen.py nano/state.pt mobile mobile/state.pt      (then: train.py --preset mobile --out mobile --fixed-sign-steps 0)
Net2Net (Chen, Goodfellow, Shlens 2016), with unequal shares for the two copies of a channel, so that they learn different things.
"""
import argparse
import os

import torch

import train
from model import PRESETS

MAX_SHARE = 0.9  # of a channel's old weight on one of its two copies


def widen_tensor(old, shape, generator):
    """`old` repeated along its output (first) and input (second) channels to `shape`; the input's copies share its weight."""
    if old.ndim == 0:
        return old.clone()
    repeats = [new // was for new, was in zip(shape, old.shape)]
    if any(was * n != new or n > 2 for was, n, new in zip(old.shape, repeats, shape)):
        raise ValueError(f"cannot widen {tuple(old.shape)} to {tuple(shape)}")
    wide = old.repeat_interleave(repeats[0], 0)
    if old.ndim < 2 or repeats[1] == 1:
        return wide
    share = 1 - MAX_SHARE + (2 * MAX_SHARE - 1) * torch.rand(wide.shape[:2], generator=generator)
    share = share.reshape(*wide.shape[:2], *[1] * (wide.ndim - 2))
    return torch.stack([wide * share, wide * (1 - share)], 2).flatten(1, 2)


def widen(narrow, model, seed=0):
    """Fills `model` from the state dict `narrow` of a network half as wide; what only `model` has (a second stack) stays."""
    generator = torch.Generator().manual_seed(seed)
    state = model.state_dict()
    unknown = sorted(set(narrow) - set(state))
    if unknown:
        raise ValueError(f"the wider network has no {unknown[0]}")
    with torch.no_grad():
        for name, old in narrow.items():
            state[name].copy_(widen_tensor(old, state[name].shape, generator))


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("narrow", help="state.pt of the trained network")
    parser.add_argument("preset", choices=sorted(PRESETS))
    parser.add_argument("wide", help="state.pt to write; must not exist")
    args = parser.parse_args(argv)
    if os.path.exists(args.wide):
        parser.error(f"{args.wide} exists")
    state = torch.load(args.narrow, map_location="cpu")
    os.makedirs(os.path.dirname(os.path.abspath(args.wide)), exist_ok=True)
    run = train.Run(train.parse_arguments(["--data", "", "--out", "", "--preset", args.preset, "--device", "cpu"]), train.Team())
    widen({**state["model"], **state["average"]}, run.model)
    run.average.restore(run.flat.named(run.flat.values()), 0)
    run.save(args.wide)


if __name__ == "__main__":
    main()
