"""Folders and files as parts of limited size, for machines that take only so much per transfer.

usage: pack.py pack PREFIX PATH... [--part-mb 60] [--quality Q] [--max-edge N]     (writes PREFIX-00.part, PREFIX-01.part, ...)
       pack.py unpack OUT_DIR PART...                                              (checks every part first)
The images of a training folder (one with labels.jsonl) can be re-encoded as JPEG and made smaller; everything else stays byte for byte.
"""
import argparse
import hashlib
import io
import json
import os
import sys
import tarfile
import zlib

import numpy as np

from images import cv2

MAGIC = "plumb.part/1"
IMAGES = (".jpg", ".jpeg", ".png")


def reencoded(data, quality, max_edge):
    """JPEG of an encoded image at `quality`, its longer edge at most `max_edge`; the given bytes where that would gain nothing."""
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    if image is None:
        raise OSError("not an image")
    scale = min(1.0, max_edge / max(image.shape[:2])) if max_edge else 1.0
    if scale < 1:
        height, width = (max(1, round(edge * scale)) for edge in image.shape[:2])
        image = cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA)
    result = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality, cv2.IMWRITE_JPEG_OPTIMIZE, 1])[1].tobytes()
    return data if scale == 1 and len(result) >= len(data) else result


def files_of(path):
    """[(name in the archive, file)] of a folder or a single file, in a fixed order."""
    path = path.rstrip("/")
    base = os.path.basename(os.path.abspath(path))
    if os.path.isfile(path):
        return [(base, path)]
    found = []
    for folder, folders, names in os.walk(path, followlinks=True):
        folders.sort()
        found += [(os.path.join(base, os.path.relpath(os.path.join(folder, n), path)), os.path.join(folder, n)) for n in sorted(names)]
    if not found:
        raise OSError(f"{path} has no files")
    return found


def archive(paths, quality=None, max_edge=None):
    """A compressed tar of `paths` without times and owners, so that equal content gives equal bytes."""
    buffer = io.BytesIO()
    with tarfile.open(fileobj=buffer, mode="w") as tar:
        for path in paths:
            trains = os.path.isfile(os.path.join(path, "labels.jsonl"))
            for name, file in files_of(path):
                with open(file, "rb") as f:
                    data = f.read()
                if trains and (quality or max_edge) and name.lower().endswith(IMAGES):
                    data = reencoded(data, quality or 90, max_edge)
                entry = tarfile.TarInfo(name)
                entry.size = len(data)
                tar.addfile(entry, io.BytesIO(data))
    return zlib.compress(buffer.getvalue(), 6)


def cut(data, prefix, part_bytes):
    """Writes `data` as parts of at most `part_bytes` with a header that names the whole; returns their paths."""
    room = part_bytes - 512
    if room < 1:
        raise ValueError(f"a part of {part_bytes} bytes has no room for its header")
    whole = hashlib.sha256(data).hexdigest()
    count = -(-len(data) // room)
    paths = []
    for i in range(count):
        piece = data[i * room : (i + 1) * room]
        header = {"magic": MAGIC, "whole": whole, "part": i, "parts": count, "sha256": hashlib.sha256(piece).hexdigest()}
        paths.append(f"{prefix}-{i:02d}.part")
        with open(paths[-1], "wb") as f:
            f.write(json.dumps(header).encode() + b"\n" + piece)
    return paths


def join(paths):
    """The data of a complete set of parts, given in any order; ValueError that names the part that is missing, foreign or damaged."""
    pieces, whole, count = {}, None, None
    for path in paths:
        with open(path, "rb") as f:
            first, piece = f.readline(1024), f.read()
        try:
            header = json.loads(first)
        except ValueError:
            header = {}
        if not isinstance(header, dict) or header.get("magic") != MAGIC:
            raise ValueError(f"{path} is not a part")
        if hashlib.sha256(piece).hexdigest() != header["sha256"]:
            raise ValueError(f"{path} is damaged")
        if whole not in (None, header["whole"]):
            raise ValueError(f"{path} belongs to another set of parts than {paths[0]}")
        whole, count = header["whole"], header["parts"]
        pieces[header["part"]] = piece
    missing = sorted(set(range(count or 0)) - set(pieces))
    if not pieces or missing:
        raise ValueError(f"part {missing[0]} of {count} is missing" if pieces else "no parts given")
    data = b"".join(pieces[i] for i in range(count))
    if hashlib.sha256(data).hexdigest() != whole:
        raise ValueError("the parts do not add up to the whole")
    return data


def unpack(paths, out):
    """Restores what `archive` packed below the folder `out`; returns the number of files."""
    with tarfile.open(fileobj=io.BytesIO(zlib.decompress(join(paths))), mode="r:") as tar:
        entries = tar.getmembers()
        for entry in entries:
            target = os.path.normpath(os.path.join(out, entry.name))
            if not entry.isfile() or not target.startswith(os.path.normpath(out) + os.sep):
                raise ValueError(f"the archive holds {entry.name}, which is no plain file below its folder")
            os.makedirs(os.path.dirname(target), exist_ok=True)
            with open(target, "wb") as f:
                f.write(tar.extractfile(entry).read())
    return len(entries)


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(dest="command", required=True)
    packing = commands.add_parser("pack")
    packing.add_argument("prefix", help="the parts are PREFIX-00.part, PREFIX-01.part, ...")
    packing.add_argument("paths", nargs="+", help="folders and files")
    packing.add_argument("--part-mb", type=float, default=60, help="of 10^6 bytes, at most, for each part")
    packing.add_argument("--quality", type=int, help="re-encode training images as JPEG of this quality where that makes them smaller")
    packing.add_argument("--max-edge", type=int, help="shrink training images to this longer edge in pixels; labels follow when loaded")
    unpacking = commands.add_parser("unpack")
    unpacking.add_argument("out")
    unpacking.add_argument("parts", nargs="+")
    args = parser.parse_args(argv)
    if args.command == "unpack":
        print(f"{unpack(args.parts, args.out)} files below {args.out}")
        return
    os.makedirs(os.path.dirname(os.path.abspath(args.prefix)), exist_ok=True)
    paths = cut(archive(args.paths, args.quality, args.max_edge), args.prefix, int(args.part_mb * 1e6))
    for path in paths:
        print(f"{path} {os.path.getsize(path) / 1e6:.1f} MB")


if __name__ == "__main__":
    try:
        main()
    except (OSError, ValueError) as error:
        sys.exit(str(error))
