"""`plumbline eval lines` gives the figures of tools/train's evaluator. usage: line_metrics_test.py PLUMBLINE; status 77 without numpy."""
import importlib.util
import json
import os
import subprocess
import sys
import tempfile
import unittest

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(HERE, "..", "..", "tools", "train"))


class LineMetrics(unittest.TestCase):
    def scores(self, seed, sizes, noise):
        """Figures of random detections near random lines: (of the program, of Python)."""
        import numpy as np

        from pixel_ap import pixel_metrics
        from sap import sap

        rng = np.random.default_rng(seed)
        annotations, entries = [], []
        for i, (w, h) in enumerate(sizes):
            edge = np.array([w, h, w, h])
            lines = rng.random((12, 4)) * edge - 0.5
            near = np.repeat(lines, 3, axis=0) + rng.normal(0, noise, (36, 4))
            near[::2] = near[::2][:, [2, 3, 0, 1]]
            found = np.concatenate([near, rng.random((10, 4)) * 1.2 * edge - 0.1 * edge])
            scores = np.round(rng.random(len(found)), 2)  # with ties and exact thresholds
            name = f"{i}.png"
            annotations.append({"filename": name, "width": w, "height": h, "lines": lines.tolist()})
            entries.append({"file": "somewhere/" + name, "lines": found.tolist(), "scores": scores.tolist()})
        with tempfile.TemporaryDirectory() as folder:
            for name, value in ("annotations.json", annotations), ("found.json", entries[::-1]):
                with open(os.path.join(folder, name), "w") as f:
                    json.dump(value, f)
            command = [PLUMBLINE, "eval", "lines", "--json", "--data", folder, "--detections", os.path.join(folder, "found.json")]
            report = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)
        detections = [(np.array(e["lines"]), np.array(e["scores"])) for e in entries]
        truth = [np.array(a["lines"]) for a in annotations]
        expected = sap(detections, truth, sizes) + pixel_metrics(detections, truth, sizes)
        return [report[k] for k in ("sAP5", "sAP10", "sAP15", "FH", "APH")], expected

    def test_figures_are_equal(self):
        for seed, noise in enumerate((0.3, 0.7, 1.5)):
            program, python = self.scores(seed, [(160, 120), (101, 203), (64, 64)], noise)
            self.assertGreater(min(python), 1.0)
            self.assertLess(max(python), 99.0)
            for a, b in zip(program, python):
                self.assertAlmostEqual(a, b, delta=1e-4)


if __name__ == "__main__":
    if importlib.util.find_spec("numpy") is None:
        print(f"skipped: {sys.executable} has no numpy")
        sys.exit(77)
    PLUMBLINE = sys.argv.pop(1)
    unittest.main(verbosity=2)
