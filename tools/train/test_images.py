"""Facts about reading images with what is installed."""
import builtins
import os
import tempfile
import unittest
from unittest import mock

import numpy as np

import images


def without(*packages):
    """Imports as on a machine that lacks `packages`."""
    original = builtins.__import__

    def refuse(name, *more):
        if name.split(".")[0] in packages:
            raise ImportError(name)
        return original(name, *more)

    return mock.patch.object(builtins, "__import__", refuse)


def another_decoder():
    """Whether something else than OpenCV decodes images here."""
    try:
        with mock.patch.object(images, "cv2", None):
            return images.decoder()[0]
    except OSError:
        return None


class Images(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.path = os.path.join(folder.name, "a.png")
        self.image = np.random.default_rng(1).integers(0, 255, (5, 7, 3)).astype(np.uint8)
        images.cv2.imwrite(self.path, self.image[..., ::-1])

    def test_opencv_gives_rgb(self):
        np.testing.assert_array_equal(images.read_rgb(self.path), self.image)

    def test_pillow_gives_the_same(self):
        if another_decoder() != "PIL":
            self.skipTest("Pillow is not installed")
        with mock.patch.object(images, "cv2", None):
            np.testing.assert_array_equal(images.read_rgb(self.path), self.image)

    def test_machine_without_a_decoder_is_told_so(self):
        with mock.patch.object(images, "cv2", None), without("PIL", "torchvision"):
            with self.assertRaisesRegex(OSError, "install one of opencv"):
                images.read_rgb(self.path)

    def test_unreadable_file_is_named(self):
        with open(self.path, "wb") as f:
            f.write(b"no image")
        for package in (images.cv2, None) if another_decoder() else (images.cv2,):
            with mock.patch.object(images, "cv2", package), self.assertRaisesRegex(OSError, "cannot read image .*a.png"):
                images.read_rgb(self.path)

    def test_many_files_keep_their_order(self):
        other = self.path.replace("a.png", "b.png")
        images.cv2.imwrite(other, np.zeros((2, 2, 3), np.uint8))
        self.assertEqual([i.shape[0] for i in images.read_all([self.path, other, self.path])], [5, 2, 5])


if __name__ == "__main__":
    unittest.main()
