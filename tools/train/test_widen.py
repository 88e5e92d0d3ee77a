"""Facts about widening a trained network."""
import os
import tempfile
import unittest

try:
    import torch
except ImportError:
    torch = None

if torch is not None:
    import train
    import widen
    from model import Vlse, build
    from random_weights import randomise


def _run(preset):
    return train.Run(train.parse_arguments(["--data", "", "--out", "", "--preset", preset, "--device", "cpu"]), train.Team())


@unittest.skipIf(torch is None, "no torch")
class Widen(unittest.TestCase):
    def test_output_stays_the_same(self):
        for stacks in (1, 2):
            narrow, wide = Vlse(4, stacks), Vlse(8, stacks)
            randomise(narrow, torch.Generator().manual_seed(3))
            widen.widen(narrow.state_dict(), wide)
            x = torch.randn(1, 3, 64, 128, generator=torch.Generator().manual_seed(1))
            a, b = narrow.eval()(x), wide.eval()(x)
            self.assertGreater(float(a.abs().max()), 0.1)
            self.assertLess(float((a - b).abs().max() / a.abs().max()), 1e-4)

    def test_copies_of_a_channel_learn_different_things(self):
        narrow, wide = Vlse(4), Vlse(8)
        widen.widen(narrow.state_dict(), wide)
        wide(torch.randn(2, 3, 64, 64)).square().sum().backward()
        gradient = wide.stack0.hg["0"].up1.conv1.weight.grad
        self.assertGreater(float((gradient[0] - gradient[1]).abs().max()), 0.01 * float(gradient.abs().max()))

    def test_three_times_as_wide_is_refused(self):
        with self.assertRaisesRegex(ValueError, "cannot widen"):
            widen.widen(Vlse(4).state_dict(), Vlse(12))

    def test_state_can_be_resumed(self):
        with tempfile.TemporaryDirectory() as folder:
            narrow, wide = os.path.join(folder, "nano.pt"), os.path.join(folder, "mobile", "state.pt")
            _run("nano").save(narrow)
            widen.main([narrow, "mobile", wide])
            run = _run("mobile")
            run.restore(wide)
            self.assertEqual((run.step, run.images), (0, 0))
            with self.assertRaises(SystemExit):
                widen.main([narrow, "mobile", wide])
