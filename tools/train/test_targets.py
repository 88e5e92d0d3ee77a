"""Facts about targets, decoding, losses and sAP; `python3 -m unittest` in this folder."""
import json
import os
import subprocess
import sys
import tempfile
import unittest

import numpy as np

try:
    import torch

    import losses
except ImportError:
    torch = None

from sap import average_precision, sap
from targets import canonical, clip_lines, decay_duplicates, decode, encode


def round_trip(lines, size=80):
    """Encodes lines with score 1 and decodes the maps again."""
    maps = encode(lines, np.ones(len(lines)), size, size)
    return decode(maps[0], maps[2:4], maps[4:6], len(lines), nms_decay=0.0)


def end_point_error(a, b):
    a, b = a.reshape(2, 2), b.reshape(2, 2)
    return min(np.abs(a - b).max(), np.abs(a - b[::-1]).max())


class Targets(unittest.TestCase):
    def test_every_direction_returns_to_a_tenth_of_an_input_pixel(self):
        for angle in np.radians(np.arange(0, 180, 7.5)):
            half = 11.3 * np.array([np.cos(angle), np.sin(angle)])
            line = np.concatenate([[40.3, 38.7] - half, [40.3, 38.7] + half])
            lines, scores = round_trip(line[None])
            self.assertLess(end_point_error(lines[0], line) * 4, 0.1)
            self.assertEqual(scores[0], 1)

    def test_midpoint_on_a_cell_border_returns_once_per_touching_cell(self):
        line = np.array([[10.0, 20.5, 30.0, 20.5]])  # midpoint x = 20.0: cells 19 and 20
        maps = encode(line, [1.0], 80, 80)
        self.assertAlmostEqual(maps[0, 20, 19], 1, places=3)
        self.assertAlmostEqual(maps[0, 20, 20], 1, places=3)
        for cell in (19, 20):
            centre = cell + maps[2, 20, cell]
            self.assertAlmostEqual(centre, 20.0, places=3)

    def test_collision_is_won_by_the_better_line(self):
        lines = np.array([[10.5, 20.5, 30.5, 20.5], [20.5, 15.5, 20.5, 25.5]])
        maps = encode(lines, [0.9, 0.4], 80, 80)
        self.assertAlmostEqual(maps[0, 20, 20], 0.9, places=5)
        np.testing.assert_allclose(np.abs(maps[4:6, 20, 20]), [10, 0], atol=1e-5)

    def test_line_across_the_border_is_encoded_as_its_visible_part(self):
        lines, _ = round_trip(np.array([[-10.0, 20.5, 20.4, 20.5]]))
        self.assertLess(end_point_error(lines[0], np.array([0, 20.5, 20.4, 20.5])), 0.03)

    def test_lines_outside_and_short_lines_leave_no_trace(self):
        lines = np.array([[-5.0, -5, -1, -2], [90.0, 10, 99, 12], [10.0, 10, 10.5, 10.5]])
        self.assertEqual(np.abs(encode(lines, np.ones(3), 80, 80)).sum(), 0)

    def test_no_lines_give_empty_maps(self):
        self.assertEqual(np.abs(encode(np.zeros((0, 4)), [], 16, 16)).sum(), 0)

    def test_clip_keeps_lines_inside_unchanged(self):
        line = np.array([[1.0, 2, 30, 40]])
        clipped, inside = clip_lines(line, 80, 80)
        np.testing.assert_allclose(clipped, line)
        self.assertTrue(inside.all())

    def test_canonical_sign_agrees_for_both_orders(self):
        v = np.array([[3.0, 1], [-2, 5], [0, 4], [-1, 0]])
        np.testing.assert_array_equal(canonical(v), canonical(-v))

    def test_soft_nms_lowers_a_neighbour_but_keeps_the_maximum(self):
        p = np.zeros((8, 8))
        p[3, 3], p[3, 4] = 0.9, 0.5
        _, scores = decode(p, np.zeros((2, 8, 8)), np.zeros((2, 8, 8)), 2, nms_decay=0.8)
        np.testing.assert_allclose(scores, [0.9, 0.4])

    def test_duplicates_rank_below_distinct_lines(self):
        lines = np.array([[0, 0, 10, 0], [10, 0.5, 0, 0.5], [0, 20, 10, 20], [0, 0.4, 10, 0.4]], float)
        ranked, scores = decay_duplicates(lines, np.array([0.9, 0.8, 0.5, 0.4]), 2.0, 0.5)
        np.testing.assert_allclose(scores, [0.9, 0.5, 0.4, 0.1])  # the last one has two better ones near
        np.testing.assert_array_equal(ranked, lines[[0, 2, 1, 3]])

    def test_equal_scores_keep_the_order_of_their_index(self):
        p = np.zeros((8, 8))
        p[1, 1] = p[5, 5] = 0.5
        lines, _ = decode(p, np.zeros((2, 8, 8)), np.zeros((2, 8, 8)), 2)
        np.testing.assert_allclose(lines[:, 0], [1, 5])


@unittest.skipIf(torch is None, "torch is not installed")
class Losses(unittest.TestCase):
    def test_both_orders_of_the_end_points_cost_nothing(self):
        v = torch.tensor([[3.0, -2.0], [0.0, 7.0]])
        self.assertEqual(losses.sign_invariant(v, v).sum(), 0)
        self.assertEqual(losses.sign_invariant(-v, v).sum(), 0)

    def test_distance_is_to_the_nearer_order(self):
        value = losses.sign_invariant(torch.tensor([[1.0, 5.0]]), torch.tensor([[0.0, -4.0]]))
        self.assertAlmostEqual(float(value), 1 + 1)

    def test_perfect_maps_have_less_loss_than_shifted_ones(self):
        target = torch.from_numpy(encode(np.array([[3.0, 5, 12, 9]]), [1.0], 16, 16))[None]
        maps = torch.zeros(1, 6, 16, 16)
        maps[:, 1] = torch.where(target[:, 0] > 0, 6.0, -6.0)
        maps[:, 2:4] = torch.logit(target[:, 2:4].clamp(1e-4, 1 - 1e-4))
        maps[:, 4:6] = -target[:, 4:6] / 16  # the other order of the end points
        _, offset, dis = losses.line_loss(maps, target, 16.0)
        self.assertLess(float(offset), 0.01)
        self.assertLess(float(dis), 1e-4)
        self.assertGreater(float(losses.line_loss(maps, target, 16.0, fixed_sign=True)[2]), 5)
        maps[:, 4:6] += 0.1
        self.assertGreater(float(losses.line_loss(maps, target, 16.0)[2]), 1)

    def test_image_without_lines_has_a_finite_loss_with_gradient(self):
        maps = torch.zeros(1, 6, 16, 16, requires_grad=True)
        total, _ = losses.total_loss([(maps, torch.zeros(1, 2, 16, 16))], torch.zeros(1, 8, 16, 16), 16.0)
        total.backward()
        self.assertTrue(torch.isfinite(maps.grad).all())


class Sap(unittest.TestCase):
    TRUTH = np.array([[10.0, 10, 50, 10], [10.0, 60, 50, 60]])

    def test_exact_lines_in_either_order_give_100(self):
        lines = self.TRUTH[:, [2, 3, 0, 1]]
        self.assertEqual(average_precision([(lines, np.array([0.9, 0.8]))], [self.TRUTH], 5), 100)

    def test_second_detection_of_a_line_is_a_false_positive(self):
        lines = self.TRUTH[[0, 0, 1]]
        value = average_precision([(lines, np.array([0.9, 0.8, 0.7]))], [self.TRUTH], 5)
        self.assertAlmostEqual(value, 100 * (0.5 * 1 + 0.5 * 2 / 3))

    def test_threshold_is_strict_on_the_squared_distance(self):
        lines = self.TRUTH + np.array([1.0, 2, 0, 0])  # 1 + 4 = 5
        detections = [(lines, np.array([0.9, 0.8]))]
        self.assertEqual(average_precision(detections, [self.TRUTH], 5), 0)
        self.assertEqual(average_precision(detections, [self.TRUTH], 10), 100)

    def test_detection_never_falls_back_to_the_second_nearest_line(self):
        truth = np.array([[10.0, 10, 50, 10], [10.0, 11, 50, 11]])
        lines = np.array([[10.0, 10, 50, 10], [10.0, 10.2, 50, 10.2]])
        self.assertAlmostEqual(average_precision([(lines, np.array([0.9, 0.8]))], [truth], 15), 50)

    def test_lines_scale_with_each_axis(self):
        lines = self.TRUTH * [2, 4, 2, 4]
        values = sap([(lines, np.array([0.9, 0.8]))], [lines], [(256, 512)])
        self.assertEqual(values, (100, 100, 100))

    def test_no_detections_give_zero(self):
        self.assertEqual(average_precision([(np.zeros((0, 4)), np.zeros(0))], [self.TRUTH], 5), 0)

    def test_agrees_with_the_independent_scorer(self):
        here = os.path.dirname(os.path.abspath(__file__))
        scorer = os.path.join(here, "..", "..", "..", "shared", "tools", "score_lines.py")
        if not os.path.exists(scorer):
            self.skipTest("the independent scorer is not here")
        rng = np.random.default_rng(3)
        annotations, detections, truth, sizes = [], [], [], []
        for i in range(5):
            w, h = (int(v) for v in rng.integers(200, 600, 2))
            lines = rng.uniform(0, 1, (20, 4)) * [w, h, w, h]
            found = np.concatenate([lines + rng.normal(0, 5, lines.shape), rng.uniform(0, 200, (15, 4))])
            scores = rng.uniform(0, 1, len(found))
            annotations.append({"filename": f"{i}.png", "width": w, "height": h, "lines": lines.tolist()})
            detections.append({"file": f"{i}.png", "lines": found.tolist(), "scores": scores.tolist()})
            truth.append(lines)
            sizes.append((w, h))
        values = sap([(np.array(d["lines"]), np.array(d["scores"])) for d in detections], truth, sizes)
        with tempfile.TemporaryDirectory() as folder:
            for name, content in (("annotations.json", annotations), ("detections.json", detections)):
                with open(os.path.join(folder, name), "w") as f:
                    json.dump(content, f)
            command = [sys.executable, scorer, folder, os.path.join(folder, "detections.json")]
            text = subprocess.run(command, capture_output=True, text=True, check=True).stdout
        self.assertIn("sAP5 %.1f sAP10 %.1f sAP15 %.1f images 5" % values, text)


if __name__ == "__main__":
    unittest.main()
