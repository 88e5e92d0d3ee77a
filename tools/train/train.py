"""Trains the VLSE network; see README.md. Constant learning rate with averaged weights, a short decay phase to finish.

usage: train.py --data DIR --out DIR [--preset nano] [--start-from STATE [--decay-epochs N]]   (--out with a state.pt resumes)
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
from data import TRAINING, Batches, load, split
from flat import Average, Flat
from losses import total_loss
from model import PRESETS, build

STATE_VERSION = 2
MAX_GRADIENT = 20.0


def parse_arguments(argv=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", required=True, help="folder with images/, labels.jsonl and manifest.json")
    parser.add_argument("--out", required=True, help="folder of state.pt and log.jsonl; an existing state is resumed")
    parser.add_argument("--start-from", help="state.pt of another run to begin with")
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
    parser.add_argument("--minutes", type=float, default=float("inf"), help="end after this much time of this process")
    parser.add_argument("--save-minutes", type=float, default=3)
    parser.add_argument("--evaluate-minutes", type=float, default=10)
    parser.add_argument("--threads", type=int, default=os.cpu_count())
    parser.add_argument("--device", default="cuda" if torch.cuda.is_available() else "cpu")
    parser.add_argument("--precision", choices=("bf16", "fp32"), default="bf16")
    parser.add_argument("--limit", type=int, help="use only the first images")
    parser.add_argument("--seed", type=int, default=0)
    return parser.parse_args(argv)


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

    def progress(self, per_epoch):
        return self.epoch + self.index / per_epoch

    def learning_rate(self, per_epoch):
        rate = min(1.0, (self.step + 1) / max(1, self.args.warmup_steps))
        if self.args.decay_epochs:
            done = (self.progress(per_epoch) - self.decay_start) / self.args.decay_epochs
            rate *= max(0.0, 1 - done)
        return rate * self.args.lr

    def train_step(self, images, maps, rate, stop):
        """One step at learning rate `rate`: (loss terms, whether the team stops)."""
        if not self.model.training:
            self.model.train()
        x = evaluate.to_tensor(images).to(self.device)
        target = torch.from_numpy(maps).to(self.device)
        with torch.autocast(self.device.type, dtype=torch.bfloat16, enabled=self.args.precision == "bf16"):
            outputs = self.model.forward_all(x)
        fixed_sign = self.step < self.args.fixed_sign_steps
        loss, terms = total_loss(outputs, target, evaluate.DISPLACEMENT_SCALE, fixed_sign)
        self.flat.forget()
        loss.backward()
        gradient = self.flat.gather()
        stop = self.team.share(gradient, stop)
        gradient *= min(1.0, MAX_GRADIENT / (float(gradient.norm()) + 1e-6))
        for group in self.optimizer.param_groups:
            group["lr"] = rate
        self.optimizer.step()
        self.average.update()
        self.step += 1
        self.images += len(images) * self.team.size
        return {"loss": float(loss.detach()), **terms}, stop

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


def main(argv=None):
    args = parse_arguments(argv)
    torch.set_num_threads(args.threads)
    os.makedirs(args.out, exist_ok=True)
    path = os.path.join(args.out, "state.pt")
    team = Team()
    lead = team.rank == 0
    run = Run(args, team)
    if os.path.exists(path):
        run.restore(path)
    elif args.start_from:
        run.restore(args.start_from)
    training, validation = split(load(args.data, limit=args.limit))
    annotated = evaluate.load_annotated(args.evaluate) if args.evaluate else []
    batches = Batches(training, args.batch, args.size, TRAINING, args.seed, run.epoch, run.index, (team.rank, team.size))
    if args.decay_epochs and run.decay_start is None:
        run.decay_start = run.progress(batches.per_epoch)
    end = run.decay_start + args.decay_epochs if args.decay_epochs else args.epochs

    stopped = []
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stopped.append(True))
    log = open(os.path.join(args.out, "log.jsonl") if lead else os.devnull, "a", buffering=1)
    started = before = time.monotonic()
    saved = watched = logged = started
    sums, count = {}, 0

    def write_log(**more):
        row = {"time": time.strftime("%H:%M:%S"), "minutes": round(run.seconds / 60, 1), "step": run.step,
               "epoch": round(run.progress(batches.per_epoch), 2), "lr": round(run.learning_rate(batches.per_epoch), 6), **more}
        log.write(json.dumps(row) + "\n")

    stop = False
    while not stop and run.progress(batches.per_epoch) < end:
        epoch, index, images, maps = batches.next()
        run.epoch, run.index = epoch, index
        stop = bool(stopped) or time.monotonic() - started > 60 * args.minutes
        terms, stop = run.train_step(images, maps, run.learning_rate(batches.per_epoch), stop)
        run.index += 1
        if not np.isfinite(terms["loss"]):
            raise RuntimeError(f"the loss is {terms['loss']} at step {run.step}; the last saved state is unharmed")
        for key, value in terms.items():
            sums[key] = sums.get(key, 0) + value
        count += 1
        now = time.monotonic()
        run.seconds, before = run.seconds + now - before, now
        if now - logged > 60:
            write_log(**{k: round(v / count, 4) for k, v in sums.items()}, ms_per_image=round((now - logged) / count / args.batch * 1e3, 1))
            sums, count, logged = {}, 0, now
        if lead and now - saved > 60 * args.save_minutes:
            run.save(path)
            saved = now
        if lead and now - watched > 60 * args.evaluate_minutes:
            write_log(**watch(run, args, validation, annotated))
            watched = time.monotonic()
    if lead:
        run.save(path)
        write_log(**watch(run, args, validation, annotated), end="signal" if stopped else "done")
    batches.close()


if __name__ == "__main__":
    main()
