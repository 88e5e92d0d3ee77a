"""Facts about parts: the round trip, the limit, and every kind of damage."""
import io
import os
import tarfile
import tempfile
import unittest
import zlib

import cv2
import numpy as np

import data
import pack
from testing import write_images


def content(folder):
    return {name: read(file) for name, file in pack.files_of(folder)}


def read(file):
    with open(file, "rb") as f:
        return f.read()


class Pack(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.train = self.at("train")
        write_images(self.train)

    def at(self, *names):
        return os.path.join(self.folder.name, *names)

    def parts(self, part_bytes=900, **options):
        return pack.cut(pack.archive([self.train], **options), self.at("p"), part_bytes)

    def test_round_trip_restores_every_byte_in_any_order_of_parts(self):
        parts = self.parts()
        self.assertGreater(len(parts), 2)
        self.assertTrue(all(os.path.getsize(p) <= 900 for p in parts))
        pack.unpack(parts[::-1], self.at("out"))
        self.assertEqual(content(self.at("out", "train")), content(self.train))

    def test_equal_content_gives_equal_parts(self):
        first = pack.archive([self.train])
        os.utime(os.path.join(self.train, "labels.jsonl"), (1, 1))
        self.assertEqual(pack.archive([self.train]), first)

    def test_one_flipped_bit_anywhere_is_found(self):
        parts = self.parts()
        for place in (300, 500, -1):
            damaged = bytearray(read(parts[1]))
            damaged[place] ^= 1
            with open(self.at("bad"), "wb") as f:
                f.write(damaged)
            with self.assertRaisesRegex(ValueError, "bad is damaged"):
                pack.join([parts[0], self.at("bad"), *parts[2:]])

    def test_cut_off_missing_foreign_and_other_files_are_named(self):
        parts = self.parts()
        with open(self.at("short"), "wb") as f:
            f.write(read(parts[1])[:-1])
        with self.assertRaisesRegex(ValueError, "short is damaged"):
            pack.join([parts[0], self.at("short"), *parts[2:]])
        with self.assertRaisesRegex(ValueError, "part 1 of"):
            pack.join([parts[0], *parts[2:]])
        other = pack.cut(b"something else", self.at("q"), 2000)
        with self.assertRaisesRegex(ValueError, "another set"):
            pack.join([parts[0], *other])
        with self.assertRaisesRegex(ValueError, "is not a part"):
            pack.join([os.path.join(self.train, "labels.jsonl")])
        with self.assertRaisesRegex(ValueError, "no parts"):
            pack.join([])

    def test_nothing_is_written_outside_the_folder(self):
        buffer = io.BytesIO()
        with tarfile.open(fileobj=buffer, mode="w") as tar:
            tar.addfile(tarfile.TarInfo("../escaped"), io.BytesIO())
        parts = pack.cut(zlib.compress(buffer.getvalue()), self.at("evil"), 5000)
        with self.assertRaisesRegex(ValueError, "escaped"):
            pack.unpack(parts, self.at("out"))
        self.assertFalse(os.path.exists(self.at("escaped")))

    def test_smaller_images_keep_their_lines(self):
        pack.unpack(self.parts(1 << 20, quality=90, max_edge=64), self.at("out"))
        for (_, before), (_, after) in zip(data.load(self.train), data.load(self.at("out", "train"))):
            self.assertEqual(after.image.shape, (48, 64, 3))
            np.testing.assert_allclose((after.lines + 0.5) * 2, before.lines + 0.5, atol=1e-4)

    def test_encoding_that_would_grow_an_image_leaves_it(self):
        data = cv2.imencode(".jpg", np.random.default_rng(1).integers(0, 255, (64, 64, 3)), [cv2.IMWRITE_JPEG_QUALITY, 30])[1].tobytes()
        self.assertEqual(pack.reencoded(data, 95, None), data)
        self.assertLess(len(pack.reencoded(data, 10, None)), len(data))

    def test_single_file_can_travel(self):
        file = self.at("weights.safetensors")
        with open(file, "wb") as f:
            f.write(np.random.default_rng(1).bytes(5000))
        parts = pack.cut(pack.archive([file]), self.at("w"), 2000)
        pack.unpack(parts, self.at("back"))
        self.assertEqual(read(self.at("back", "weights.safetensors")), read(file))


if __name__ == "__main__":
    unittest.main()
