"""Facts about the schedule in minutes and about starting from other weights."""
import os
import tempfile
import unittest
from unittest import mock

import numpy as np

try:
    import torch
except ImportError:
    torch = None

if torch is not None:
    import export_safetensors
    import train
    from testing import finish, read_log, start_training, write_images


def a_run(*more):
    return train.Run(train.parse_arguments(["--data", "", "--out", "", "--device", "cpu", *more]), train.Team())


@unittest.skipIf(torch is None, "torch is not installed")
class Schedule(unittest.TestCase):
    def test_rate_warms_up_stays_and_falls_to_zero_with_time(self):
        run = a_run("--end-after-minutes", "20", "--decay-fraction", "0.5", "--lr", "0.01", "--warmup-steps", "100")
        rates = []
        for step, minutes in ((0, 0), (99, 0.1), (500, 10), (700, 15), (900, 19), (999, 20), (1000, 21)):
            run.step, run.seconds = step, 60 * minutes
            rates.append(run.learning_rate(1))
        for rate, expected in zip(rates, (0.0001, 0.01, 0.01, 0.005, 0.001, 0, 0)):
            self.assertAlmostEqual(rate, expected)
        self.assertTrue(run.ended(1))

    def test_training_in_calls_ends_on_time_and_stays_ended(self):
        with tempfile.TemporaryDirectory() as folder:
            images, out = folder + "/images", folder + "/run"
            write_images(images)
            schedule = ("--end-after-minutes", "0.15")
            finish(start_training(images, out, 9999, *schedule, "--minutes", "0.05"))
            first = torch.load(out + "/state.pt")
            self.assertLess(first["seconds"], 9)
            for _ in range(2):  # the second of these has nothing left to do
                finish(start_training(images, out, 9999, *schedule))
            last = torch.load(out + "/state.pt")
            rows = read_log(out)
        self.assertEqual([r["end"] for r in rows if "end" in r], ["minutes", "done", "done"])
        self.assertGreater(last["step"], first["step"])
        self.assertGreaterEqual(last["seconds"], 9)
        self.assertLess(last["seconds"], 12)
        self.assertEqual(rows[-1]["lr"], 0)

    def test_bfloat16_is_the_default_only_where_the_cpu_multiplies_it(self):
        with tempfile.TemporaryDirectory() as folder:
            for flags, expected in (("fpu sse2 avx2 fma", False), ("avx2 avx512_bf16 amx_tile", True), ("asimd bf16", True)):
                with open(folder + "/cpuinfo", "w") as f:
                    f.write("processor : 0\nflags : " + flags + "\n")
                self.assertEqual(train.cpu_multiplies_bf16(folder + "/cpuinfo"), expected)
            self.assertFalse(train.cpu_multiplies_bf16(folder + "/none"))
        for has, expected in ((True, "bf16"), (False, "fp32")):
            with mock.patch("train.cpu_multiplies_bf16", lambda: has):
                self.assertEqual(a_run().args.precision, expected)
                self.assertEqual(a_run("--precision", "bf16").args.precision, "bf16")

    def test_both_schedules_at_once_are_refused(self):
        with self.assertRaises(SystemExit):
            a_run("--end-after-minutes", "20", "--decay-epochs", "3")

    def test_exported_weights_start_a_training(self):
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "m.safetensors")
            export_safetensors.main(["--random", "nano", path, "--fp32"])
            run = a_run("--end-after-minutes", "20")
            run.begin(path)
            expected = export_safetensors.random_model("nano").state_dict()
            for values in (run.model.state_dict(), run.average.state()):
                name = "stack0.res.merge.weight"
                torch.testing.assert_close(values[name], expected[name])
            with self.assertRaises((ValueError, RuntimeError)):
                a_run("--preset", "mobile").begin(path)

    def test_time_of_another_run_does_not_count(self):
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "state.pt")
            run = a_run()
            run.seconds = 3600.0
            run.save(path)
            timed = a_run("--end-after-minutes", "20")
            timed.begin(path)
            self.assertFalse(timed.ended(1))

    def test_compiler_that_fails_leaves_the_plain_network(self):
        run = a_run("--preset", "nano")

        def broken(_):
            def fail(_):
                raise RuntimeError("no compiler here")

            return fail

        images, maps = np.zeros((2, 64, 64, 3), np.uint8), np.zeros((2, 8, 16, 16), np.float32)
        with mock.patch.object(torch, "compile", broken, create=True):
            terms, _, error = train.first_step(run, images, maps, 1e-3, False)
        self.assertIn("no compiler here", error)
        self.assertTrue(torch.isfinite(terms["loss"]))
        self.assertEqual(run.step, 1)


if __name__ == "__main__":
    unittest.main()
