"""Trains the VLSE network; see README.md. Constant learning rate with averaged weights, a decay phase to finish.

usage: train.py --data DIR --out DIR [--preset nano] [--start-from STATE [--decay-epochs N]]   (--out with a state.pt resumes)
       train.py --data DIR --out DIR --end-after-minutes M [--minutes C]                       (M in all, C of them in this call)
Several processes share a batch when RANK, WORLD_SIZE, MASTER_ADDR and MASTER_PORT say so (torchrun sets them).
"""
import argparse
import json
import os
import signal
import time

import numpy as np
import torch

import evaluate
import weights_file
from data import DEGRADED, TRAINING, Batches, load, split
from device_data import DeviceBatches
from distill import Teacher
from flat import Average, Flat
from losses import total_loss
from model import PRESETS, build

STATE_VERSION = 2
MAX_GRADIENT = 20.0


def cpu_multiplies_bf16(cpuinfo="/proc/cpuinfo"):
    """Whether this CPU has instructions for bfloat16; emulated it is several times slower than float32."""
    try:
        with open(cpuinfo) as f:
            words = f.read().split()
    except OSError:
        return False
    return not {"avx512_bf16", "amx_bf16", "bf16"}.isdisjoint(words)


def parse_arguments(argv=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", required=True, help="folder with images/, labels.jsonl and manifest.json")
    parser.add_argument("--out", required=True, help="folder of state.pt and log.jsonl; an existing state is resumed")
    parser.add_argument("--start-from", help="state.pt of another run to begin with, or a .safetensors file")
    parser.add_argument("--evaluate", help="folder with images/ and annotations.json to watch, never to train on")
    parser.add_argument("--preset", default="nano", choices=sorted(PRESETS))
    parser.add_argument("--size", type=int, default=320, help="input edge in pixels, divisible by 64")
    parser.add_argument("--evaluate-size", type=int, default=320)
    parser.add_argument("--batch", type=int, default=8)
    parser.add_argument("--lr", type=float, default=2e-3)
    parser.add_argument("--weight-decay", type=float, default=0.05)
    parser.add_argument("--warmup-steps", type=int, default=200)
    parser.add_argument("--fixed-sign-steps", type=int, default=1500, help="first steps with the labels' own displacement sign")
    parser.add_argument("--ema", type=float, default=0.998, help="decay per step of the averaged weights")
    parser.add_argument("--epochs", type=float, default=float("inf"), help="end after this many epochs in all")
    parser.add_argument("--decay-epochs", type=float, help="take the learning rate to zero over this many epochs, then end")
    parser.add_argument("--end-after-minutes", type=float, help="decay to zero and end at this training time, summed over resumed calls")
    parser.add_argument("--finish", action="store_true", help="let the schedule of --end-after-minutes end with this call's --minutes")
    parser.add_argument("--decay-fraction", type=float, default=0.4, help="of --end-after-minutes in which the rate decays")
    parser.add_argument("--minutes", type=float, default=float("inf"), help="stop this process after this time; resume continues")
    parser.add_argument("--save-minutes", type=float, default=3)
    parser.add_argument("--evaluate-minutes", type=float, default=10)
    parser.add_argument("--threads", type=int, default=os.cpu_count())
    parser.add_argument("--device", default="cuda" if torch.cuda.is_available() else "cpu")
    parser.add_argument("--precision", choices=("bf16", "fp32"), help="default: bf16 where the device multiplies it, fp32 elsewhere")
    parser.add_argument("--loader", choices=("threads", "device"), help="where images are prepared; default: a GPU, but not a CPU, itself")
    parser.add_argument("--degrade", action="store_true", help="also gamma, blur, noise and JPEG")
    parser.add_argument("--mix", action="append", default=[], metavar="DIR:FRACTION", help="of every batch from another training folder")
    parser.add_argument("--teacher", help="state.pt or .safetensors of a network whose maps are targets beside the labels")
    parser.add_argument("--teacher-weight", type=float, default=0.5, help="of the loss; the labels have the rest")
    parser.add_argument("--compile", action="store_true", help="torch.compile; goes on without where it fails")
    parser.add_argument("--limit", type=int, help="use only the first images")
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args(argv)
    if args.decay_epochs and args.end_after_minutes:
        parser.error("--decay-epochs and --end-after-minutes exclude each other")
    if args.finish and (not args.end_after_minutes or args.minutes == float("inf")):
        parser.error("--finish needs --end-after-minutes and --minutes")
    args.precision = args.precision or ("bf16" if args.device != "cpu" or cpu_multiplies_bf16() else "fp32")
    args.loader = args.loader or ("threads" if args.device == "cpu" else "device")
    return args


class Team:
    """The processes that share each batch: sums gradients, and stops all of them at the same step."""

    def __init__(self):
        self.size, self.rank = int(os.environ.get("WORLD_SIZE", 1)), int(os.environ.get("RANK", 0))
        if self.size > 1:
            torch.distributed.init_process_group("gloo")

    def share(self, gradient, stop):
        """Averages the flat `gradient` over the team in place; true if any process wants to stop."""
        if self.size == 1:
            return stop
        flag = torch.tensor([float(stop)])
        torch.distributed.all_reduce(gradient)
        torch.distributed.all_reduce(flag)
        gradient /= self.size
        return bool(flag > 0)


class Run:
    """Everything that a checkpoint holds, and the loop's one step."""

    def __init__(self, args, team):
        self.args, self.team = args, team
        torch.manual_seed(args.seed)
        self.device = torch.device(args.device)
        self.model = build(args.preset).to(self.device, memory_format=torch.channels_last)
        self.flat = Flat(self.model)
        groups = [{"params": [self.flat.decayed]}, {"params": [self.flat.plain], "weight_decay": 0.0}]
        self.optimizer = torch.optim.AdamW(groups, lr=args.lr, betas=(0.9, 0.99), weight_decay=args.weight_decay)
        self.average = Average(self.flat, args.ema)
        self.forward = self.model.forward_all
        self.teacher = Teacher(args.teacher, self.device, evaluate.DISPLACEMENT_SCALE) if args.teacher else None
        self.epoch = self.index = self.step = self.images = 0
        self.seconds = 0.0
        self.decay_start = None  # in epochs, once the learning rate decays

    def save(self, path):
        state = {
            "version": STATE_VERSION, "preset": self.args.preset,
            "model": self.model.state_dict(), "average": self.average.state(), "average_count": self.average.count,
            "optimizer": self.optimizer.state_dict(),
            "epoch": self.epoch, "index": self.index, "step": self.step, "images": self.images,
            "seconds": self.seconds, "decay_start": self.decay_start, "seed": self.args.seed, "batch": self.args.batch,
        }
        torch.save(state, path + ".partial")
        os.replace(path + ".partial", path)

    def restore(self, path):
        state = torch.load(path, map_location=self.device)
        for key, value in (("version", STATE_VERSION), ("preset", self.args.preset)):
            if state[key] != value:
                raise ValueError(f"{path} has {key} {state[key]}, not {value}")
        self.model.load_state_dict(state["model"])
        self.average.restore(state["average"], state["average_count"])
        hyper = [{k: v for k, v in g.items() if k != "params"} for g in self.optimizer.param_groups]
        self.optimizer.load_state_dict(state["optimizer"])
        for group, values in zip(self.optimizer.param_groups, hyper):  # the command line decides, not the file
            group.update(values)
        for key in ("epoch", "index", "step", "images", "seconds", "decay_start"):
            setattr(self, key, state[key])
        if state["batch"] != self.args.batch:  # the place inside the epoch means nothing for another batch size
            self.epoch, self.index = self.epoch + (self.index > 0), 0

    def begin(self, path):
        """Starts from another run's state, or from exported weights alone; a time schedule starts at zero."""
        if path.endswith(".safetensors"):
            tensors, _ = weights_file.read(path)
            state = {k: torch.from_numpy(v.astype(np.float32)) for k, v in tensors.items()}
            unknown = self.model.load_state_dict(state, strict=False).unexpected_keys
            if unknown:
                raise ValueError(f"the {self.args.preset} network has no {unknown[0]}")
            self.average.restore(self.flat.named(self.flat.values()), 0)
        else:
            self.restore(path)
        if self.args.end_after_minutes:
            self.seconds = 0.0

    def progress(self, per_epoch):
        return self.epoch + self.index / per_epoch

    def ended(self, per_epoch):
        """Whether the whole training, not only this call, is at its end."""
        if self.args.end_after_minutes:
            return self.seconds >= 60 * self.args.end_after_minutes
        end = self.decay_start + self.args.decay_epochs if self.args.decay_epochs else self.args.epochs
        return self.progress(per_epoch) >= end

    def learning_rate(self, per_epoch):
        rate = min(1.0, (self.step + 1) / max(1, self.args.warmup_steps))
        if self.args.decay_epochs:
            done = (self.progress(per_epoch) - self.decay_start) / self.args.decay_epochs
            rate *= max(0.0, 1 - done)
        if self.args.end_after_minutes:
            left = 1 - self.seconds / (60 * self.args.end_after_minutes)
            rate *= min(1.0, max(0.0, left) / self.args.decay_fraction)
        return rate * self.args.lr

    def train_step(self, images, maps, rate, stop):
        """One step at learning rate `rate`: (loss terms as tensors, whether the team stops). Never waits for a GPU."""
        if not self.model.training:
            self.model.train()
        x = evaluate.to_tensor(images).to(self.device)
        target = torch.as_tensor(maps).to(self.device)
        fixed_sign = self.step < self.args.fixed_sign_steps
        with torch.autocast(self.device.type, dtype=torch.bfloat16, enabled=self.args.precision == "bf16"):
            outputs = self.forward(x)
            taught = self.teacher.target(x, target) if self.teacher else None
        loss, terms = total_loss(outputs, target, evaluate.DISPLACEMENT_SCALE, fixed_sign)
        if self.teacher:
            imitation, _ = total_loss(outputs, taught, evaluate.DISPLACEMENT_SCALE, fixed_sign)
            loss = loss + self.args.teacher_weight * (imitation - loss)
            terms["imitation"] = imitation.detach()
        self.flat.forget()
        loss.backward()
        gradient = self.flat.gather()
        stop = self.team.share(gradient, stop)
        gradient *= (MAX_GRADIENT / (gradient.norm() + 1e-6)).clamp(max=1.0)
        for group in self.optimizer.param_groups:
            group["lr"] = rate
        self.optimizer.step()
        self.average.update()
        self.step += 1
        self.images += len(images) * self.team.size
        return {"loss": loss.detach(), **terms}, stop

    def averaged_model(self):
        model = build(self.args.preset)
        model.load_state_dict(self.average.state(), strict=False)
        return model.to(self.device, memory_format=torch.channels_last)


def watch(run, args, validation, annotated):
    """sAP of the averaged weights on held-out training images (labels above 0.3 as truth) and on the watched folder."""
    model = run.averaged_model()
    held = [(s.name, s.image, s.lines[s.scores >= 0.3]) for s in validation]
    report = {}
    for name, data in (("validation", held), ("evaluate", annotated)):
        if data:
            report[name] = [round(v, 2) for v in evaluate.score(model, data, args.evaluate_size)[0]]
    return report


def open_batches(run, args, team, training, device):
    """The loader at the run's place."""
    mixed = []
    for folder, _, fraction in (text.rpartition(":") for text in args.mix):
        mixed.append(([sample for _, sample in load(folder)], float(fraction)))
    augmentation = DEGRADED if args.degrade else TRAINING
    common = (training, args.batch, args.size, augmentation, args.seed, run.epoch, run.index, (team.rank, team.size))
    return DeviceBatches(*common, mixed=mixed, device=device) if args.loader == "device" else Batches(*common, mixed=mixed)


def first_step(run, *step):
    """A training step with the compiled network if it compiles, else with the plain one: (terms, stop, error or None)."""
    try:
        run.forward = torch.compile(run.model.forward_all)
        return (*run.train_step(*step), None)
    except Exception as error:  # any part of the compiler's tool chain may be missing
        run.forward = run.model.forward_all
        return (*run.train_step(*step), f"{type(error).__name__}: {str(error)[:200]}")


def main(argv=None):
    started = time.monotonic()
    args = parse_arguments(argv)
    torch.set_num_threads(args.threads)
    torch.backends.cudnn.benchmark = True
    os.makedirs(args.out, exist_ok=True)
    path = os.path.join(args.out, "state.pt")
    team = Team()
    if team.size > 1 and args.end_after_minutes:
        raise SystemExit("--end-after-minutes is for one process: the clocks of several differ")
    lead = team.rank == 0
    run = Run(args, team)
    if os.path.exists(path):
        run.restore(path)
    elif args.start_from:
        run.begin(args.start_from)
    training, validation = split(load(args.data, limit=args.limit))
    annotated = evaluate.load_annotated(args.evaluate) if args.evaluate else []
    batches = open_batches(run, args, team, training, run.device)
    if args.decay_epochs and run.decay_start is None:
        run.decay_start = run.progress(batches.per_epoch)

    if args.finish:  # reading images took its time, and the end of the call is fixed
        args.end_after_minutes = run.seconds / 60 + max(1e-3, args.minutes - (time.monotonic() - started) / 60)

    stopped = []
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stopped.append(True))
    log = open(os.path.join(args.out, "log.jsonl") if lead else os.devnull, "a", buffering=1)
    saved = watched = logged = before = time.monotonic()
    sums, count, compiles = {}, 0, args.compile

    def write_log(**more):
        row = {"time": time.strftime("%H:%M:%S"), "minutes": round(run.seconds / 60, 1), "step": run.step, "images": run.images,
               "epoch": round(run.progress(batches.per_epoch), 2), "lr": round(run.learning_rate(batches.per_epoch), 6), **more}
        log.write(json.dumps(row) + "\n")

    def means():
        """The loss terms since the last line of the log; raises if they are not finite, before a bad state can be saved."""
        values = {k: round(float(v) / count, 4) for k, v in sums.items()}
        if count and not np.isfinite(values["loss"]):
            raise RuntimeError(f"the loss is {values['loss']} at step {run.step}; the last saved state is unharmed")
        return values

    stop = False
    while not stop and not run.ended(batches.per_epoch):
        run.epoch, run.index, images, maps = batches.next()
        stop = bool(stopped) or (time.monotonic() - started > 60 * args.minutes and not args.finish)
        step = images, maps, run.learning_rate(batches.per_epoch), stop
        if compiles:
            terms, stop, error = first_step(run, *step)
            compiles = False
            if error:
                write_log(compile=error)
        else:
            terms, stop = run.train_step(*step)
        run.index += 1
        for key, value in terms.items():
            sums[key] = sums.get(key, 0) + value
        count += 1
        now = time.monotonic()
        run.seconds, before = run.seconds + now - before, now
        if now - logged > 60:
            write_log(**means(), ms_per_image=round((now - logged) / count / args.batch * 1e3, 2))
            sums, count, logged = {}, 0, now
        if lead and now - saved > 60 * args.save_minutes:
            means()
            run.save(path)
            saved = now
        if lead and now - watched > 60 * args.evaluate_minutes:
            write_log(**watch(run, args, validation, annotated))
            watched = time.monotonic()
    if lead:
        last = means()
        run.save(path)
        end = "done" if run.ended(batches.per_epoch) else "signal" if stopped else "minutes"
        write_log(**last, **watch(run, args, validation, annotated), end=end)
    batches.close()


if __name__ == "__main__":
    main()
