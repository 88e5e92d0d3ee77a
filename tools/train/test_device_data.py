"""Facts about the images that the training device prepares itself."""
import tempfile
import unittest
from dataclasses import replace

import cv2
import numpy as np

try:
    import torch
except ImportError:
    torch = None

if torch is not None:
    import data
    import device_data
    from targets import encode
    from testing import finish, read_log, start_training, write_images


def photo(seed, size=(96, 128)):
    """A smooth coloured picture, so that interpolation weights of 5 bits do not matter."""
    rng = np.random.default_rng(seed)
    return cv2.resize(rng.integers(40, 210, (9, 12, 3)).astype(np.uint8), size[::-1], interpolation=cv2.INTER_CUBIC)


def samples(count=4):
    rng = np.random.default_rng(2)
    return [
        data.Sample(str(i), photo(i, (96, 128 - 8 * i)), rng.uniform(-10, 120, (30 + i, 4)).astype(np.float32), rng.uniform(0.05, 1, 30 + i).astype(np.float32))
        for i in range(count)
    ]


def both(augmentation, size=128):
    """The same batch from the loader thread and from the device: ((images, maps), (images, maps))."""
    ours = samples()
    device = device_data.DeviceBatches(ours, 4, size, augmentation, device="cpu")
    thread = data.Batches(ours, 4, size, augmentation)
    try:
        return thread.next()[2:], tuple(t.numpy() for t in device.next()[2:])
    finally:
        device.close()
        thread.close()


@unittest.skipIf(torch is None, "torch is not installed")
class DeviceData(unittest.TestCase):
    def test_views_equal_those_of_the_loader_thread(self):
        (images, maps), (device_images, device_maps) = both(data.TRAINING)
        self.assertEqual(device_images.shape, images.shape)
        self.assertLess(np.abs(device_images - images).mean(), 1)
        self.assertLess(np.quantile(np.abs(device_images - images), 0.999), 6)
        np.testing.assert_allclose(device_maps[:, :6], maps[:, :6], atol=1e-4)
        np.testing.assert_array_equal(device_maps[:, 7], maps[:, 7])

    def test_drawn_lines_are_at_most_one_cell_from_those_of_opencv(self):
        (_, maps), (_, device_maps) = both(data.TRAINING)
        for a, b in ((maps, device_maps), (device_maps, maps)):
            for drawn, reference in zip(a[:, 6], b[:, 6]):
                near = cv2.dilate(reference, np.ones((3, 3), np.uint8))
                inside = (slice(1, -1), slice(1, -1))  # OpenCV leaves out lines along the border
                self.assertTrue((drawn[inside] <= near[inside] + 1e-6).all())

    def test_each_degradation_equals_that_of_the_loader_thread(self):
        for name, value, limit in (("gamma", 0.5, 1.0), ("blur", 1.0, 1.0), ("jpeg", 1.0, 2.5)):
            plain = data.Augmentation()
            (images, _), (device_images, _) = both(replace(plain, **{name: value}))
            (without, _), _ = both(plain)
            self.assertGreater(np.abs(images.astype(float) - without).max(), 2, name)
            self.assertLess(np.abs(device_images - images).mean(), limit, name)

    def test_noise_has_the_spread_that_was_drawn(self):
        rows = np.zeros((2, device_data.COLUMNS), np.float32)
        rows[:, device_data.GAIN : device_data.GAIN + 3] = rows[:, device_data.GAMMA] = 1
        rows[1, device_data.NOISE] = 5
        flat = torch.full((2, 3, 64, 64), 128.0)
        image = device_data.photograph(flat, torch.from_numpy(rows), rows, torch.Generator().manual_seed(1))
        self.assertEqual(float(image[0].std()), 0)
        self.assertAlmostEqual(float(image[1].std()), 5, delta=0.3)

    def test_blur_of_zero_changes_nothing(self):
        images = torch.rand(2, 3, 32, 32) * 255
        torch.testing.assert_close(device_data.blur(images, torch.zeros(2)), images, rtol=0, atol=1e-3)

    def test_compression_at_the_best_quality_keeps_gray_exactly_to_a_level(self):
        gray = torch.from_numpy(photo(5, (64, 64))).permute(2, 0, 1)[None, :1].float().repeat(1, 3, 1, 1)
        result = device_data.compress(gray, torch.tensor([100.0]))
        self.assertLess(float((result - gray).abs().max()), 1.5)

    def test_empty_and_short_lines_leave_no_trace(self):
        lines = torch.tensor([[[0.0, 0, 0, 0], [-5, -5, -1, -2], [10, 10, 10.5, 10.5]]])
        self.assertEqual(float(device_data.encode(lines, torch.ones(1, 3), 32).abs().sum()), 0)

    def test_encoding_equals_the_plain_one_for_every_direction(self):
        for angle in np.radians(np.arange(0, 180, 7.5)):
            half = 9.3 * np.array([np.cos(angle), np.sin(angle)])
            line = np.concatenate([[15.3, 17.7] - half, [15.3, 17.7] + half])[None]
            expected = encode(line, [0.7], 32, 32)
            maps = device_data.encode(torch.from_numpy(line).float()[None], torch.tensor([[0.7]]), 32)[0].numpy()
            geometry = maps[1] > 0
            np.testing.assert_allclose(maps[:2], expected[:2], atol=1e-5)
            if abs(np.degrees(angle) - 45) > 1:  # there the sign of the displacement is a matter of rounding
                np.testing.assert_allclose(maps[2:6, geometry], expected[2:6, geometry], atol=1e-4)

    def test_training_runs_from_the_device_loader_with_every_degradation(self):
        with tempfile.TemporaryDirectory() as folder:
            write_images(folder + "/images")
            finish(start_training(folder + "/images", folder + "/run", 2, "--loader", "device", "--degrade"))
            self.assertEqual(read_log(folder + "/run")[-1]["end"], "done")


@unittest.skipIf(torch is None, "torch is not installed")
class Degradation(unittest.TestCase):
    """Each by itself, in the loader thread's functions."""

    def change(self, **one):
        view = data.View(np.eye(2, 3), np.ones(3), **one)
        image = photo(3)
        return image.astype(float), data.photograph(image, view).astype(float)

    def test_gamma_keeps_black_and_white_and_darkens_between(self):
        before, after = self.change(gamma=1.3)
        self.assertTrue((after <= before).all())
        ends = data.photograph(np.array([[[0, 0, 0], [255, 255, 255]]], np.uint8), data.View(np.eye(2, 3), np.ones(3), gamma=1.3))
        np.testing.assert_array_equal(ends[0, :, 0], [0, 255])

    def test_blur_lowers_the_slope_of_an_edge(self):
        image = np.zeros((32, 32, 3), np.uint8)
        image[:, 16:] = 200
        result = data.photograph(image, data.View(np.eye(2, 3), np.ones(3), blur=1.0)).astype(int)
        self.assertLess(np.abs(np.diff(result[16, :, 0])).max(), 100)
        self.assertEqual((result[16, 0, 0], result[16, -1, 0]), (0, 200))

    def test_noise_is_a_function_of_its_seed(self):
        before, first = self.change(noise=4.0, seed=7)
        _, second = self.change(noise=4.0, seed=7)
        _, other = self.change(noise=4.0, seed=8)
        np.testing.assert_array_equal(first, second)
        self.assertFalse((first == other).all())
        self.assertAlmostEqual((first - before).std(), 4, delta=0.5)

    def test_compression_costs_more_at_lower_quality(self):
        errors = [np.abs(np.subtract(*self.change(jpeg=quality))).mean() for quality in (30, 60, 90)]
        self.assertGreater(errors[0], errors[1])
        self.assertGreater(errors[1], errors[2])
        self.assertLess(errors[2], 3)

    def test_off_by_default_in_training(self):
        view = data.draw_view(100, 80, 64, np.random.default_rng(1), data.TRAINING)
        self.assertEqual((view.gamma, view.blur, view.noise, view.jpeg), (1.0, 0.0, 0.0, 0))


if __name__ == "__main__":
    unittest.main()
