"""Measures training steps of a preset, plain and compiled: images per second, memory, and what a time limit would hold.

usage: measure_step.py --preset paper [--size N] [--batch N] [--steps N] [--compile] [--device D]
The images are noise with random lines; they go through the loader that the device would use.
"""
import argparse
import json
import time

import numpy as np
import torch

import train
from data import TRAINING, Batches, Sample
from device_data import DeviceBatches
from model import PRESETS, build


def gflop_per_image(preset, size):
    """Multiplications and additions (2 each) of the convolutions' forward and backward pass, in 10^9."""
    total = []
    model = build(preset).eval()
    for module in model.modules():
        if isinstance(module, torch.nn.Conv2d):
            module.register_forward_hook(lambda m, _, out: total.append(out[0].numel() * m.weight[0].numel()))
    with torch.no_grad():
        model(torch.zeros(1, 3, 64, 64))
    return 3 * 2 * sum(total) * (size / 64) ** 2 / 1e9


def noise_samples(count=16, lines=232):
    """Samples as large and as full of lines as the photographs."""
    rng = np.random.default_rng(1)
    return [
        Sample(str(i), rng.integers(0, 255, (384, 512, 3)).astype(np.uint8), rng.uniform(0, 384, (lines, 4)).astype(np.float32), rng.uniform(0.05, 1, lines).astype(np.float32))
        for i in range(count)
    ]


def wait(device):
    if device.type == "cuda":
        torch.cuda.synchronize()


def measure(run, batches, steps, warm_up):
    """(images per second of whole steps, of the loader alone)."""

    def step():
        _, _, images, maps = batches.next()
        run.train_step(images, maps, 1e-4, False)

    def timed(work):
        wait(run.device)
        started = time.perf_counter()
        for _ in range(steps):
            work()
        wait(run.device)
        return run.args.batch * steps / (time.perf_counter() - started)

    for _ in range(warm_up):
        step()
    return timed(step), timed(batches.next)


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--preset", default="paper", choices=sorted(PRESETS))
    parser.add_argument("--size", type=int)
    parser.add_argument("--batch", type=int, default=16)
    parser.add_argument("--steps", type=int, default=30)
    parser.add_argument("--warm-up", type=int, default=5)
    parser.add_argument("--compile", action="store_true", help="also compiled, with the time that compiling takes")
    parser.add_argument("--device", default="cuda" if torch.cuda.is_available() else "cpu")
    args = parser.parse_args(argv)
    size = args.size or PRESETS[args.preset].size
    torch.backends.cudnn.benchmark = True
    options = ["--data", "", "--out", "", "--preset", args.preset, "--size", str(size), "--batch", str(args.batch), "--device", args.device]
    work = gflop_per_image(args.preset, size)
    for compiled in (False, True)[: 1 + args.compile]:
        error = None
        run = train.Run(train.parse_arguments(options), train.Team())
        common = (noise_samples(max(16, args.batch)), args.batch, size, TRAINING)
        batches = DeviceBatches(*common, device=run.device) if run.args.loader == "device" else Batches(*common)
        started = time.perf_counter()
        if compiled:
            _, _, error = train.first_step(run, *batches.next()[2:], 1e-4, False)
            wait(run.device)
            print(json.dumps({"compile_s": round(time.perf_counter() - started, 1), "error": error}), flush=True)
        rate, loader = measure(run, batches, args.steps, args.warm_up)
        batches.close()
        row = {"preset": args.preset, "size": size, "batch": args.batch, "compiled": compiled and error is None, "images_per_s": round(rate, 2),
               "loader_images_per_s": round(loader, 2), "gflop_per_image": round(work, 1), "tflop_per_s": round(rate * work / 1e3, 2)}
        if run.device.type == "cuda":
            row["memory_gb"] = round(torch.cuda.max_memory_allocated() / 1e9, 1)
        print(json.dumps(row), flush=True)


if __name__ == "__main__":
    main()
