"""Draws the curves of a training log as PNG: losses, learning rate, sAP10 over the training time.

usage: curve.py RUN/log.jsonl [more logs] OUT.png     (needs no package beside OpenCV)
"""
import argparse
import json

import numpy as np

from images import cv2

WIDTH, HEIGHT, MARGIN = 900, 300, 60
COLOURS = ((180, 90, 20), (40, 120, 220), (60, 150, 60), (150, 60, 150), (90, 90, 90))  # BGR
LOSSES = ("loss", "midpoint", "offset", "displacement", "auxiliary", "imitation")


def read(paths):
    """The rows of logs, one after the other in time."""
    rows = []
    for path in paths:
        with open(path) as f:
            rows += [json.loads(row) for row in f if row.strip()]
    return rows


def panels(rows):
    """[(title, {name: [(minutes, value)]})] of what the rows hold; a title without a curve is left out."""
    losses = {k: [(r["minutes"], r[k]) for r in rows if k in r] for k in LOSSES}
    scores = {k: [(r["minutes"], r[k][1]) for r in rows if k in r] for k in ("validation", "evaluate")}
    rates = {"lr": [(r["minutes"], r["lr"]) for r in rows if "lr" in r]}
    drawn = [(title, {k: v for k, v in curves.items() if v}) for title, curves in (("sAP10", scores), ("loss", losses), ("learning rate", rates))]
    return [(title, curves) for title, curves in drawn if curves]


def ticks(low, high):
    """About five round numbers between `low` and `high`."""
    step = 10 ** np.floor(np.log10((high - low) / 2))
    step *= min((1, 2, 5, 10), key=lambda k: abs((high - low) / (k * step) - 5))
    return [k * step for k in range(int(np.ceil(low / step)), int(np.floor(high / step)) + 1)]


def draw_panel(title, curves):
    """BGR uint8 [HEIGHT, WIDTH, 3] of one panel with axes and a legend."""
    image = np.full((HEIGHT, WIDTH, 3), 255, np.uint8)
    points = np.array([p for curve in curves.values() for p in curve], float)
    low, high = points.min(0), points.max(0)
    low[1] = min(low[1], 0)
    high = np.where(high > low, high, low + 1)

    def place(values):
        unit = (np.array(values, float).reshape(-1, 2) - low) / (high - low)
        return np.round(unit * [WIDTH - 2 * MARGIN, 2 * MARGIN - HEIGHT] + [MARGIN, HEIGHT - MARGIN]).astype(int)

    def write(text, x, y, colour=(60, 60, 60)):
        cv2.putText(image, text, (int(x), int(y)), cv2.FONT_HERSHEY_SIMPLEX, 0.4, colour, 1, cv2.LINE_AA)

    for value in ticks(low[1], high[1]):
        y = place((low[0], value))[0, 1]
        cv2.line(image, (MARGIN, y), (WIDTH - MARGIN, y), (225, 225, 225), 1)
        write(f"{value:g}", 8, y + 4)
    for value in ticks(low[0], high[0]):
        x = place((value, low[1]))[0, 0]
        cv2.line(image, (x, MARGIN), (x, HEIGHT - MARGIN), (235, 235, 235), 1)
        write(f"{value:g}", x - 8, HEIGHT - MARGIN + 16)
    write(f"{title} over minutes of training", MARGIN, 24)
    for i, (name, curve) in enumerate(curves.items()):
        colour = COLOURS[i % len(COLOURS)]
        pixels = place(curve)
        cv2.polylines(image, [pixels.astype(np.int32).reshape(-1, 1, 2)], False, colour, 2, cv2.LINE_AA)
        cv2.circle(image, [int(v) for v in pixels[-1]], 3, colour, -1)
        write(f"{name} {curve[-1][1]:g}", MARGIN + 8 + 135 * i, 44, colour)
    return image


def draw(rows):
    """All panels below each other; ValueError if the rows hold no value."""
    found = panels(rows)
    if not found:
        raise ValueError("the log has no values yet")
    return np.concatenate([draw_panel(*p) for p in found])


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("logs", nargs="+")
    parser.add_argument("out")
    args = parser.parse_args(argv)
    if not cv2.imwrite(args.out, draw(read(args.logs))):
        parser.error(f"cannot write {args.out}")


if __name__ == "__main__":
    main()
