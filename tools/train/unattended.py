"""Trains a preset within a limit of wall-clock time on a machine with one GPU, cut into calls that resume each other.

usage: unattended.py PRESET --data DIR --out DIR [--evaluate DIR] [--minutes 25] [--call-minutes 9.5]
       unattended.py PRESET --data DIR --out DIR --dry-run       (a few steps on the CPU through the same code, and a projection)
Repeat the same command until it exits with 0; 75 means that it wants another call, 1 that it cannot go on, with the reason.
OUT/result holds what to take along after every call: weights (float16, as parts), log, curve, report.
"""
import argparse
import glob
import importlib.util
import json
import os
import subprocess
import sys
import time
from dataclasses import asdict, dataclass, replace

HERE = os.path.dirname(os.path.abspath(__file__))
CALL_AGAIN = 75
OVERHEAD_MINUTES = 1.2  # of a call, assumed for the schedule: start, reading images, evaluation, export
CLOSING_MINUTES = 0.7  # of them after the training
PEAK_TFLOPS = 990  # dense bfloat16 of an H100 or H200 by its data sheet
UTILISATIONS = (0.1, 0.2, 0.3)


@dataclass(frozen=True)
class Recipe:
    """How a preset is trained on a GPU; `early_size` is the input of the calls that end in the first half."""

    size: int
    early_size: int
    batch: int
    lr: float
    ema: float = 0.999
    warmup_steps: int = 500
    fixed_sign_steps: int = 1500


RECIPES = {
    "nano": Recipe(320, 256, 32, 3e-3),
    "mobile": Recipe(384, 320, 32, 2e-3),
    "standard": Recipe(512, 384, 16, 1e-3),
    "paper": Recipe(512, 384, 16, 1e-3),
}
DRY_RUN = {"batch": 2, "warmup_steps": 2, "fixed_sign_steps": 2}


@dataclass
class Progress:
    """What OUT/progress.json remembers between calls."""

    calls: int = 0
    wall_minutes: float = 0.0
    trained_minutes: float = 0.0
    lr_scale: float = 1.0  # halved after a loss that is not finite
    batch_scale: float = 1.0  # halved after a lack of memory
    finished: bool = False

    @classmethod
    def load(cls, path):
        if not os.path.exists(path):
            return cls()
        with open(path) as f:
            return cls(**json.load(f))

    def save(self, path):
        with open(path + ".partial", "w") as f:
            json.dump(asdict(self), f)
        os.replace(path + ".partial", path)


def problems(device):
    """Sentences about what this machine lacks; empty if training can start."""
    lacking = [f"{sys.executable} has no {name}" for name in ("torch", "numpy") if importlib.util.find_spec(name) is None]
    if not any(importlib.util.find_spec(name) for name in ("cv2", "PIL", "torchvision")):
        lacking.append("no package decodes images: one of cv2, PIL, torchvision is needed")
    if lacking:
        return lacking
    import torch

    if tuple(int(v) for v in torch.__version__.split(".")[:2]) < (1, 13):
        lacking.append(f"torch {torch.__version__} is older than 1.13")
    if device == "cuda" and not torch.cuda.is_available():
        lacking.append("torch sees no CUDA device")
    elif device == "cuda" and not torch.cuda.is_bf16_supported():
        lacking.append(f"{torch.cuda.get_device_name()} has no bfloat16")
    return lacking


def machine(device):
    """A line about the machine for the report."""
    import torch

    name = torch.cuda.get_device_name() if device == "cuda" else "CPU"
    return f"{name}, {os.cpu_count()} cores, Python {sys.version.split()[0]}, torch {torch.__version__}"


def call_plan(progress, minutes, call_minutes):
    """(training minutes at which the schedule ends, wall-clock minutes of this call, whether it is the last one).

    The time left is shared equally by as few calls as it takes; the last call ends the schedule on time, whatever the others took.
    """
    left = max(0.1, minutes - progress.wall_minutes)
    calls = -int(-left // call_minutes)
    overhead = calls * min(OVERHEAD_MINUTES, left / calls / 4)
    return progress.trained_minutes + left - overhead, left / calls, calls == 1


def train_command(args, recipe, progress, end, this_call, last):
    """The command line of train.py for `this_call` minutes."""
    early = progress.trained_minutes + this_call <= 0.5 * end
    command = [
        sys.executable, os.path.join(HERE, "train.py"), "--data", args.data, "--out", args.out, "--preset", args.preset,
        "--size", recipe.early_size if early else recipe.size, "--evaluate-size", recipe.size,
        "--batch", max(1, round(recipe.batch * progress.batch_scale)), "--lr", recipe.lr * progress.lr_scale, "--ema", recipe.ema,
        "--warmup-steps", recipe.warmup_steps, "--fixed-sign-steps", recipe.fixed_sign_steps,
        "--end-after-minutes", f"{end:.4f}", "--minutes", f"{this_call:.4f}", "--evaluate-minutes", args.evaluate_minutes,
        "--save-minutes", args.save_minutes, "--device", args.device,
    ]  # fmt: skip
    command += ["--evaluate", args.evaluate] if args.evaluate else []
    command += ["--limit", 8, "--threads", 1, "--loader", "device"] if args.dry_run else []
    command += ["--start-from", args.start_from] if args.start_from else []
    command += ["--compile"] if args.compile else []
    command += ["--finish"] if last else []
    return [str(c) for c in [*command, *args.more]]


def recover(errors, progress):
    """Adapts `progress` to a failure that a smaller step or batch may cure; false if the failure is another."""
    if "the loss is" in errors and progress.lr_scale > 0.1:
        progress.lr_scale /= 2
        return True
    if "out of memory" in errors and progress.batch_scale > 0.1:
        progress.batch_scale /= 2
        return True
    return False


def trained_minutes(state):
    import torch

    return torch.load(state, map_location="cpu")["seconds"] / 60 if os.path.exists(state) else 0.0


def train_for_a_call(args, recipe, progress, started, state):
    """Runs train.py, again after failures that can be cured; returns whether the training is complete."""
    end, wall, last = call_plan(progress, args.minutes, args.call_minutes)
    closing = min(CLOSING_MINUTES, wall / 4)
    while True:
        this_call = max(0.02, wall - closing - (time.monotonic() - started) / 60)  # less what a failed attempt used up
        process = subprocess.run(train_command(args, recipe, progress, end, this_call, last), stderr=subprocess.PIPE, text=True)
        sys.stderr.write(process.stderr[-4000:])
        if process.returncode == 0:
            progress.trained_minutes = trained_minutes(state)
            return last
        if not recover(process.stderr, progress):
            raise SystemExit("train.py failed; its words are above. OUT/state.pt is the last good state: the same command continues from it")


def collect(args, progress, state):
    """Weights, log, curve and report in OUT/result."""
    import curve
    import export_safetensors
    import pack

    result = os.path.join(args.out, "result")
    os.makedirs(result, exist_ok=True)
    weights = os.path.join(args.out, f"{args.preset}.safetensors")
    export_safetensors.main([state, weights, "--size", str(RECIPES[args.preset].size)])
    for old in glob.glob(os.path.join(result, "*.part")):
        os.remove(old)
    pack.cut(pack.archive([weights]), os.path.join(result, args.preset), int(args.part_mb * 1e6))
    rows = curve.read([os.path.join(args.out, "log.jsonl")])
    with open(os.path.join(result, "log.jsonl"), "w") as f:
        f.writelines(json.dumps(row) + "\n" for row in rows)
    if curve.cv2 is not None:
        curve.cv2.imwrite(os.path.join(result, "curve.png"), curve.draw(rows))
    scores = [{k: r[k] for k in ("minutes", "images", "validation", "evaluate") if k in r} for r in rows if "validation" in r or "evaluate" in r]
    report = {"preset": args.preset, "machine": machine(args.device), **asdict(progress),
              "images": rows[-1]["images"], "scores": scores[-1:]}
    with open(os.path.join(result, "report.json"), "w") as f:
        json.dump(report, f, indent=1)
    print(json.dumps(report))


def project(preset, recipe, minutes):
    """What the time would hold on a GPU of PEAK_TFLOPS: a table of lines for each utilisation."""
    from measure_step import gflop_per_image

    work = gflop_per_image(preset, recipe.size)
    training = minutes - 3 * OVERHEAD_MINUTES
    print(f"projection: {work:.0f} GFLOP per image of {recipe.size} x {recipe.size}, forward and backward; {training:.1f} minutes of training")
    for share in UTILISATIONS:
        rate = share * PEAK_TFLOPS * 1e3 / work
        images = rate * 60 * training
        print(f"projection: at {share:.0%} of {PEAK_TFLOPS} TFLOP/s {rate:.0f} images/s, {images:.0f} images, {images / 2938:.0f} epochs of 2938, {images / recipe.batch:.0f} steps")


def parse_arguments(argv=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("preset", choices=sorted(RECIPES))
    parser.add_argument("--data", required=True, help="training folder, or its parts (DIR/*.part), unpacked at the first call into OUT/data")
    parser.add_argument("--out", required=True, help="folder of the run; must stay between calls")
    parser.add_argument("--evaluate", help="folder with images/ and annotations.json; with parts, its name in them")
    parser.add_argument("--minutes", type=float, default=25, help="wall-clock time of all calls together")
    parser.add_argument("--call-minutes", type=float, default=9.5, help="wall-clock time of one call")
    parser.add_argument("--evaluate-minutes", type=float, default=4)
    parser.add_argument("--save-minutes", type=float, default=2)
    parser.add_argument("--part-mb", type=float, default=16, help="of 10^6 bytes, at most, for each part of the weights")
    parser.add_argument("--start-from", help="state.pt or .safetensors to begin with, as for train.py")
    parser.add_argument("--compile", action="store_true", help="torch.compile; measure_step.py says whether it pays")
    parser.add_argument("--device", default="cuda")
    parser.add_argument("--dry-run", action="store_true")
    args, args.more = parser.parse_known_args(argv)  # the rest is train.py's
    if args.dry_run:
        args.device = "cpu"
    return args


def unpacked(args):
    """Replaces parts by the folders that they hold; the first folder with labels is the training data."""
    parts = sorted(glob.glob(args.data))
    if not parts or not parts[0].endswith(".part"):
        return args
    folder = os.path.join(args.out, "data")
    marker = os.path.join(folder, "complete")
    if not os.path.exists(marker):
        import pack

        pack.unpack(parts, folder)
        open(marker, "w").close()
    (labels,) = glob.glob(os.path.join(folder, "*", "labels.jsonl"))
    args.data = os.path.dirname(labels)
    args.evaluate = args.evaluate and os.path.join(folder, args.evaluate)
    return args


def main(argv=None):
    started = time.monotonic()
    args = parse_arguments(argv)
    lacking = problems(args.device)
    if lacking:
        raise SystemExit("\n".join(lacking))
    print(machine(args.device), flush=True)
    os.makedirs(args.out, exist_ok=True)
    os.environ.setdefault("TORCHINDUCTOR_CACHE_DIR", os.path.join(os.path.abspath(args.out), "compiled"))
    recipe = replace(RECIPES[args.preset], **DRY_RUN) if args.dry_run else RECIPES[args.preset]
    if args.dry_run:
        project(args.preset, RECIPES[args.preset], 25)
    if args.start_from:  # what is trained already has chosen its signs
        recipe = replace(recipe, fixed_sign_steps=0)
    args = unpacked(args)
    record, state = os.path.join(args.out, "progress.json"), os.path.join(args.out, "state.pt")
    progress = Progress.load(record)
    progress.trained_minutes = trained_minutes(state)
    before = progress.wall_minutes
    if not progress.finished:
        # A call that is killed has used its time all the same.
        replace(progress, calls=progress.calls + 1, wall_minutes=before + call_plan(progress, args.minutes, args.call_minutes)[1]).save(record)
        progress.finished = train_for_a_call(args, recipe, progress, started, state)
    collect(args, progress, state)
    progress.calls += 1
    progress.wall_minutes = before + (time.monotonic() - started) / 60
    progress.save(record)
    return 0 if progress.finished else CALL_AGAIN


if __name__ == "__main__":
    sys.exit(main())
