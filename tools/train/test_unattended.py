"""Facts about the training in calls within a time limit, its curve, and the measurement of steps."""
import contextlib
import glob
import io
import json
import os
import tempfile
import unittest
from unittest import mock

import numpy as np

try:
    import torch
except ImportError:
    torch = None

import curve
import pack
import unattended
from testing import write_images
from unattended import Progress, call_plan

if torch is not None:
    import measure_step
    import weights_file


class Plan(unittest.TestCase):
    def test_calls_share_the_time_and_the_last_one_ends_it(self):
        progress, seen = Progress(), []
        for overhead in (1.0, 2.5, 0.5, 9.9):  # whatever else the calls cost
            end, wall, last = call_plan(progress, 25, 9.5)
            seen.append(wall)
            self.assertLessEqual(wall, 9.5)
            progress.wall_minutes += wall
            progress.trained_minutes += wall - overhead
            if last:
                break
        self.assertEqual(len(seen), 3)
        self.assertAlmostEqual(progress.wall_minutes, 25)

    def test_end_of_the_schedule_moves_little_between_calls(self):
        progress, ends = Progress(), []
        for _ in range(3):
            end, wall, _ = call_plan(progress, 25, 9.5)
            ends.append(end)
            progress.wall_minutes += wall
            progress.trained_minutes += wall - unattended.OVERHEAD_MINUTES
        self.assertLess(max(ends) - min(ends), 0.01)

    def test_slow_call_leaves_less_for_the_others(self):
        self.assertEqual(call_plan(Progress(wall_minutes=24, trained_minutes=20), 25, 9.5)[1:], (1, True))

    def test_command_sizes_first_small_then_full_and_finishes_once(self):
        args = unattended.parse_arguments(["paper", "--data", "d", "--out", "o", "--seed", "4"])
        recipe = unattended.RECIPES["paper"]
        first = unattended.train_command(args, recipe, Progress(), 21, 8, False)
        second = unattended.train_command(args, recipe, Progress(trained_minutes=8), 21, 8, True)
        self.assertEqual(first[first.index("--size") + 1], "384")
        self.assertEqual(second[second.index("--size") + 1], "512")
        self.assertNotIn("--finish", first)
        self.assertIn("--finish", second)
        self.assertEqual(first[-2:], ["--seed", "4"])

    def test_failures_that_a_smaller_step_or_batch_cures(self):
        progress = Progress()
        self.assertTrue(unattended.recover("RuntimeError: the loss is nan at step 7", progress))
        self.assertTrue(unattended.recover("torch.cuda.OutOfMemoryError: CUDA out of memory.", progress))
        self.assertEqual((progress.lr_scale, progress.batch_scale), (0.5, 0.5))
        self.assertFalse(unattended.recover("OSError: cannot read image", progress))
        progress.lr_scale = 0.1
        self.assertFalse(unattended.recover("the loss is nan", progress))

    def test_machine_without_gpu_or_decoder_is_told_so(self):
        if torch is not None and not torch.cuda.is_available():
            self.assertEqual(unattended.problems("cuda"), ["torch sees no CUDA device"])
        with mock.patch("importlib.util.find_spec", lambda name: None):
            text = " ".join(unattended.problems("cuda"))
        self.assertIn("no torch", text)
        self.assertIn("no package decodes images", text)


@unittest.skipIf(torch is None, "torch is not installed")
class DryRun(unittest.TestCase):
    def test_parts_become_weights_in_two_calls(self):
        with tempfile.TemporaryDirectory() as folder:
            write_images(folder + "/train")
            os.makedirs(folder + "/eval")
            with open(folder + "/train/labels.jsonl") as f:
                rows = [json.loads(row) for row in f][:1]
            os.symlink(folder + "/train/images", folder + "/eval/images")
            with open(folder + "/eval/annotations.json", "w") as f:
                json.dump([{**row, "filename": row["file"]} for row in rows], f)
            pack.main(["pack", folder + "/parts/d", folder + "/train", folder + "/eval", "--part-mb", "0.002"])
            self.assertGreater(len(glob.glob(folder + "/parts/*")), 1)
            command = ["nano", "--data", folder + "/parts/*.part", "--out", folder + "/run", "--evaluate", "eval", "--dry-run",
                       "--minutes", "0.5", "--call-minutes", "0.4"]  # fmt: skip
            output = io.StringIO()
            with contextlib.redirect_stdout(output):
                results = [unattended.main(command) for _ in range(2)]
            self.assertEqual(results, [unattended.CALL_AGAIN, 0])
            with open(folder + "/run/result/report.json") as f:
                report = json.load(f)
            self.assertTrue(report["finished"])
            self.assertGreater(report["images"], 0)
            self.assertEqual(len(report["scores"][-1]["evaluate"]), 3)
            with open(folder + "/run/log.jsonl") as f:
                log = [json.loads(row) for row in f]
            self.assertEqual([r["end"] for r in log if "end" in r], ["minutes", "done"])
            self.assertEqual(log[-1]["lr"], 0)
            pack.unpack(glob.glob(folder + "/run/result/*.part"), folder + "/back")
            _, metadata = weights_file.load_model(folder + "/back/nano.safetensors")
            self.assertEqual((metadata["preset"], metadata["input_width"]), ("nano", "320"))
        self.assertIn("images/s", output.getvalue())

    def test_killed_call_has_used_its_time(self):
        with tempfile.TemporaryDirectory() as folder:
            write_images(folder + "/train")
            command = ["nano", "--data", folder + "/train", "--out", folder + "/run", "--dry-run", "--minutes", "25"]
            with mock.patch.object(unattended.subprocess, "run", side_effect=KeyboardInterrupt), contextlib.redirect_stdout(io.StringIO()):
                with self.assertRaises(KeyboardInterrupt):
                    unattended.main(command)
            progress = Progress.load(folder + "/run/progress.json")
        self.assertEqual((progress.calls, progress.finished), (1, False))
        self.assertAlmostEqual(progress.wall_minutes, 25 / 3)

    def test_steps_are_measured_plain_and_compiled(self):
        output = io.StringIO()
        with contextlib.redirect_stdout(output):
            measure_step.main(["--preset", "nano", "--size", "64", "--batch", "2", "--steps", "1", "--warm-up", "0", "--device", "cpu", "--compile"])
        rows = [json.loads(row) for row in output.getvalue().splitlines()]
        self.assertEqual(len([r for r in rows if "compiled" in r]), 2)
        self.assertTrue(all(r["images_per_s"] > 0 for r in rows if "images_per_s" in r))

    def test_work_of_an_image_is_that_of_the_convolutions(self):
        # 2 x 1.06 and 2 x 75.0 GMAC, backward twice the forward pass
        self.assertAlmostEqual(measure_step.gflop_per_image("nano", 320), 6.4, delta=0.1)
        self.assertAlmostEqual(measure_step.gflop_per_image("paper", 512), 450, delta=2)


class Curve(unittest.TestCase):
    ROWS = [
        {"minutes": 0.0, "lr": 0.001, "loss": 3.0, "midpoint": 0.3},
        {"minutes": 4.0, "lr": 0.002, "validation": [10, 20, 25], "evaluate": [5, 12.5, 14]},
        {"minutes": 9.0, "lr": 0.0, "loss": 1.0, "midpoint": 0.1, "validation": [20, 30, 35]},
    ]

    def test_each_panel_has_what_the_log_has(self):
        found = dict(curve.panels(self.ROWS))
        self.assertEqual(found["sAP10"], {"validation": [(4.0, 20), (9.0, 30)], "evaluate": [(4.0, 12.5)]})
        self.assertEqual(set(found["loss"]), {"loss", "midpoint"})
        self.assertEqual(len(found["learning rate"]["lr"]), 3)

    def test_png_shows_the_curves_and_nothing_fails_on_one_point(self):
        with tempfile.TemporaryDirectory() as folder:
            log, png = folder + "/log.jsonl", folder + "/c.png"
            with open(log, "w") as f:
                f.writelines(json.dumps(row) + "\n" for row in self.ROWS)
            curve.main([log, png])
            image = curve.cv2.imread(png)
        self.assertEqual(image.shape, (3 * curve.HEIGHT, curve.WIDTH, 3))
        self.assertGreater((image.reshape(-1, 3) == curve.COLOURS[0]).all(1).sum(), 500)
        self.assertEqual(len(curve.draw(self.ROWS[:1])), 2 * curve.HEIGHT)
        with self.assertRaisesRegex(ValueError, "no values"):
            curve.draw([{"minutes": 1.0}])

    def test_falling_loss_goes_down_in_the_picture(self):
        image = curve.draw_panel("loss", {"loss": [(0, 3.0), (9, 1.0)]})
        ys = [np.flatnonzero((image[60:-60, x] == curve.COLOURS[0]).all(1)).mean() for x in (curve.MARGIN + 20, curve.WIDTH - curve.MARGIN - 20)]
        self.assertLess(ys[0], ys[1])

    def test_ticks_are_round_and_inside(self):
        np.testing.assert_allclose(curve.ticks(0, 100), [0, 20, 40, 60, 80, 100])
        self.assertTrue(all(0.3 <= t <= 0.9 for t in curve.ticks(0.3, 0.9)))


if __name__ == "__main__":
    unittest.main()
