#!/usr/bin/env python3
"""Times the network on the Vulkan device against OpenCV DNN on the same network, in turns, in one run.

usage: net_vs_opencv.py [--net-bench build/release/bin/net_bench] [--preset nano | --weights FILE] [--size 320] [--rounds 5]
Both use two threads. Best wall and best process CPU time of a frame over all rounds; quote the ratios, not the times.
"""
import argparse
import os
import re
import subprocess
import sys
import tempfile
import time

import cv2
import numpy as np

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
FRAMES = 15


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--net-bench", default=os.path.join(ROOT, "build/release/bin/net_bench"))
    parser.add_argument("--preset", default="nano")
    parser.add_argument("--weights", help="a weights file instead of a preset's random weights")
    parser.add_argument("--size", type=int, default=320)
    parser.add_argument("--rounds", type=int, default=5)
    args = parser.parse_args(argv)

    with tempfile.TemporaryDirectory() as folder:
        onnx = os.path.join(folder, "net.onnx")
        source = [args.weights] if args.weights else ["--random", args.preset]
        export = os.path.join(ROOT, "tools/train/export_onnx.py")
        subprocess.run([sys.executable, export, *source, onnx, "--size", str(args.size)], check=True)
        net = cv2.dnn.readNetFromONNX(onnx)
    cv2.setNumThreads(2)
    image = np.random.default_rng(1).standard_normal((1, 3, args.size, args.size)).astype(np.float32)
    command = [args.net_bench, args.weights or args.preset, str(args.size), str(FRAMES)]
    environment = dict(os.environ, LP_NUM_THREADS="2")
    ours, theirs = [], []
    for _ in range(args.rounds):
        text = subprocess.run(command, check=True, capture_output=True, text=True, env=environment).stdout
        ours.append([float(v) for v in re.findall(r"best ([0-9.]+) ms", text)])
        for frame in range(FRAMES + 2):
            wall, cpu = time.perf_counter(), time.process_time()
            net.setInput(image)
            net.forward()
            if frame >= 2:
                theirs.append([1e3 * (time.perf_counter() - wall), 1e3 * (time.process_time() - cpu)])
    ours, theirs = np.min(ours, axis=0), np.min(theirs, axis=0)
    print(f"{args.weights or args.preset} {args.size}x{args.size}   wall ms   cpu ms")
    print(f"plumbline    {ours[0]:9.2f} {ours[1]:9.2f}")
    print(f"opencv dnn   {theirs[0]:9.2f} {theirs[1]:9.2f}")
    print(f"ratio        {ours[0] / theirs[0]:9.2f} {ours[1] / theirs[1]:9.2f}")


if __name__ == "__main__":
    main()
