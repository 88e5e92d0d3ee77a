"""Facts about learning from another network and from renderings."""
import json
import os
import tempfile
import unittest

import numpy as np

try:
    import torch
except ImportError:
    torch = None

import renderings
from testing import HERE, finish, read_log, start_training, write_images

if torch is not None:
    import data
    import distill
    import export_safetensors
    import losses
    import pseudo_label
    from model import Vlse

SAMPLE = os.path.join(HERE, "..", "..", "assets", "sample")
SIZE = (128, 128)


def source(lines, scores, weight=1.0):
    return np.array(lines, float).reshape(-1, 4), np.array(scores, float), weight


@unittest.skipIf(torch is None, "torch is not installed")
class Fusion(unittest.TestCase):
    def test_same_line_in_either_order_becomes_one_between_both(self):
        lines, scores = pseudo_label.fuse([source([[10, 10, 50, 10]], [0.8]), source([[50, 12, 10, 12]], [0.8])], SIZE)
        np.testing.assert_allclose(lines, [[10, 11, 50, 11]])
        np.testing.assert_allclose(scores, [0.8])

    def test_end_points_follow_the_better_score(self):
        lines, scores = pseudo_label.fuse([source([[10, 10, 50, 10]], [0.9]), source([[10, 12, 50, 12]], [0.3])], SIZE)
        np.testing.assert_allclose(lines, [[10, 10.5, 50, 10.5]])
        np.testing.assert_allclose(scores, [0.6])

    def test_line_of_one_source_has_its_share_of_the_score(self):
        sources = [source([[10, 10, 50, 10]], [0.8], 0.5), source([], [], 0.5), source([], [], 1.0)]
        np.testing.assert_allclose(pseudo_label.fuse(sources, SIZE)[1], [0.2])

    def test_low_agreement_is_filtered(self):
        alone, shared = [10, 10, 50, 10], [10, 60, 50, 60]
        sources = [source([alone, shared], [0.9, 0.9], 0.5), source([shared], [0.9], 0.5), source([shared], [0.5], 1.0)]
        lines, scores = pseudo_label.fuse(sources, SIZE, min_agreement=0.4)
        np.testing.assert_allclose(lines, [shared])
        np.testing.assert_allclose(scores, [0.7])

    def test_two_near_lines_of_one_source_stay_two(self):
        lines, _ = pseudo_label.fuse([source([[10, 10, 50, 10], [10, 11, 50, 11]], [0.9, 0.8])], SIZE)
        self.assertEqual(len(lines), 2)

    def test_distance_is_in_128ths_of_each_axis(self):
        sources = [source([[10, 10, 50, 10]], [0.8]), source([[10, 16, 50, 16]], [0.8])]
        self.assertEqual(len(pseudo_label.fuse(sources, (128, 128))[0]), 2)
        self.assertEqual(len(pseudo_label.fuse(sources, (128, 512))[0]), 1)

    def test_no_lines_at_all(self):
        lines, scores = pseudo_label.fuse([source([], []), source([], [])], SIZE)
        self.assertEqual((lines.shape, scores.shape), ((0, 4), (0,)))


@unittest.skipIf(torch is None, "torch is not installed")
class Teaching(unittest.TestCase):
    def test_targets_are_what_the_teacher_says(self):
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "m.safetensors")
            export_safetensors.main(["--random", "nano", path, "--fp32"])
            teacher = distill.Teacher(path, torch.device("cpu"), 16.0)
        labels = torch.rand(1, 8, 16, 16)
        x = torch.randn(1, 3, 64, 64)
        target, maps = teacher.target(x, labels), teacher.model(x)
        self.assertEqual(target.shape, labels.shape)
        self.assertTrue(torch.equal(target[:, 6:], labels[:, 6:]))
        torch.testing.assert_close(target[:, 0], torch.softmax(maps[:, :2], 1)[:, 1])
        self.assertTrue((target[:, 4] >= target[:, 5]).all())
        own, other = (float(losses.line_loss(m, target, 16.0)[2]) for m in (maps, maps + 0.1))
        self.assertLess(own, 1e-4)
        self.assertGreater(other, 0.5)

    def test_teacher_s_gradient_reaches_only_the_student(self):
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "m.safetensors")
            export_safetensors.main(["--random", "nano", path])
            teacher = distill.Teacher(path, torch.device("cpu"), 16.0)
        student = Vlse(4)
        x = torch.randn(2, 3, 64, 64)
        losses.total_loss(student.forward_all(x), teacher.target(x, torch.zeros(2, 8, 16, 16)), 16.0)[0].backward()
        self.assertGreater(float(student.stem.conv.weight.grad.abs().sum()), 0)
        self.assertTrue(all(p.grad is None for p in teacher.model.parameters()))

    def test_training_with_a_teacher_logs_what_it_costs(self):
        with tempfile.TemporaryDirectory() as folder:
            write_images(folder + "/d")
            path = folder + "/m.safetensors"
            export_safetensors.main(["--random", "nano", path])
            finish(start_training(folder + "/d", folder + "/run", 1, "--teacher", path))
            self.assertIn("imitation", read_log(folder + "/run")[-1])

    def test_pseudo_labels_are_a_training_folder(self):
        with tempfile.TemporaryDirectory() as folder:
            write_images(folder + "/d")
            path = folder + "/m.safetensors"
            export_safetensors.main(["--random", "nano", path])
            pseudo_label.main([path, folder + "/d", folder + "/round1", "--size", "64", "--device", "cpu"])
            before, after = (data.load(folder + name) for name in ("/d", "/round1"))
            self.assertEqual([s.name for _, s in after], [s.name for _, s in before])
            self.assertEqual([g for g, _ in after], [g for g, _ in before])
            for (_, a), (_, b) in zip(before, after):  # the random network's lines are found nowhere else
                kept = [pseudo_label.distances(line, b.lines)[0].min() < 40 for line in a.lines]
                self.assertTrue(all(kept))
            finish(start_training(folder + "/round1", folder + "/run", 1))

    def test_mirrored_detections_lie_on_the_image_itself(self):
        class Still(torch.nn.Module):
            """Answers with the brightest cell, as a line to both sides of it."""

            def __init__(self):
                super().__init__()
                self.scale = torch.nn.Parameter(torch.ones(1))

            def forward(self, x):
                gray = torch.nn.functional.avg_pool2d(x.mean(1, keepdim=True), 4)
                return torch.cat([-gray, gray, 0 * gray, 0 * gray, 0 * gray + 0.125, 0 * gray], 1) * self.scale

        image = np.zeros((64, 64, 3), np.uint8)
        image[20:24, 12:16] = 255
        (plain, mirrored), = pseudo_label.views(Still(), [image], 64, 1)
        np.testing.assert_allclose(np.sort(plain[0][0][[0, 2]]), np.sort(mirrored[0][0][[0, 2]]), atol=1e-3)
        np.testing.assert_allclose(plain[0][0][[1, 3]], mirrored[0][0][[1, 3]], atol=1e-3)


class Renderings(unittest.TestCase):
    def test_sequence_becomes_a_training_folder_with_exact_lines(self):
        with tempfile.TemporaryDirectory() as folder:
            renderings.main([SAMPLE, folder + "/r", "--every", "12", "--min-length", "12"])
            with open(folder + "/r/labels.jsonl") as f:
                rows = [json.loads(row) for row in f]
            with open(os.path.join(SAMPLE, "annotations.json")) as f:
                frames = json.load(f)[::12]
            self.assertEqual(len(rows), len(frames))
            for row, frame in zip(rows, frames):
                self.assertTrue(row["file"].endswith(frame["filename"]))
                self.assertTrue(os.path.exists(folder + "/r/images/" + row["file"]))
                self.assertLess(len(row["lines"]), len(frame["lines"]))
                self.assertTrue({tuple(l) for l in row["lines"]} <= {tuple(l) for l in frame["lines"]})
                self.assertGreaterEqual(np.hypot(*(np.array(row["lines"])[:, 2:] - np.array(row["lines"])[:, :2]).T).min(), 12)

    def test_sequences_of_the_same_name_are_refused(self):
        with tempfile.TemporaryDirectory() as folder, self.assertRaises(SystemExit):
            renderings.main([SAMPLE, SAMPLE, folder + "/r"])

    @unittest.skipIf(torch is None, "torch is not installed")
    def test_every_batch_has_its_fraction_of_them(self):
        with tempfile.TemporaryDirectory() as folder:
            write_images(folder + "/d")
            own = [s for _, s in data.load(folder + "/d")]
        mixed = [data.Sample(f"mixed{i}", s.image, s.lines, s.scores) for i, s in enumerate(own)]
        batches = data.Batches(own, 4, 64, data.TRAINING, mixed=[(mixed, 0.25)])
        again = data.Batches(own, 4, 64, data.TRAINING, mixed=[(mixed, 0.25)], epoch=1, index=1)
        try:
            self.assertEqual(batches.per_epoch, 2)
            seen = set()
            for index in range(batches.per_epoch):
                names = [s.name for s, _ in batches.choose(0, index)]
                self.assertEqual(sum(n.startswith("mixed") for n in names), 1)
                seen |= {n for n in names if not n.startswith("mixed")}
            self.assertEqual(len(seen), 6)  # an epoch is one of the training images
            for _ in range(3):
                batches.next()
            for a, b in zip(batches.next(), again.next()):
                np.testing.assert_array_equal(a, b)
            with self.assertRaisesRegex(ValueError, "no place"):
                data.Batches(own, 4, 64, data.TRAINING, mixed=[(mixed, 1.0)])
        finally:
            batches.close()
            again.close()

    @unittest.skipIf(torch is None, "torch is not installed")
    def test_training_mixes_them_in_with_both_loaders(self):
        with tempfile.TemporaryDirectory() as folder:
            write_images(folder + "/d")
            renderings.main([SAMPLE, folder + "/r", "--every", "24"])
            for loader in ("threads", "device"):
                finish(start_training(folder + "/d", f"{folder}/{loader}", 1, "--mix", folder + "/r:0.5", "--loader", loader))
                self.assertEqual(read_log(f"{folder}/{loader}")[-1]["step"], 6)


if __name__ == "__main__":
    unittest.main()
