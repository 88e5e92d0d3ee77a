"""Facts about the network, its files and the resumable training; `python3 -m unittest` in this folder."""
import importlib.util
import os
import signal
import tempfile
import time
import unittest

import cv2
import numpy as np

try:
    import torch
except ImportError:
    torch = None

if torch is not None:
    import data
    import export_onnx
    import export_safetensors
    import flat
    import train
    import weights_file
    from model import PRESETS, Vlse, build, exported_state
    from random_weights import randomise
    from testing import HERE, finish, start_training, write_images


@unittest.skipIf(torch is None, "torch is not installed")
class Model(unittest.TestCase):
    def test_parameter_counts_are_those_of_the_method(self):
        for (width, stacks, block), millions in {(64, 1, "basic"): 3.87, (64, 1, "hybrid"): 7.77, (64, 2, "hybrid"): 15.26}.items():
            model = Vlse(width, stacks, block)
            count = sum(p.numel() for n, p in model.named_parameters() if ".aux." not in n)
            self.assertAlmostEqual(count / 1e6, millions, delta=0.006)

    def test_output_is_six_planes_at_a_quarter(self):
        model = Vlse(2).eval()
        self.assertEqual(model(torch.zeros(2, 3, 64, 128)).shape, (2, 6, 16, 32))

    def test_fused_heads_of_training_equal_the_separate_ones(self):
        model = Vlse(4)
        randomise(model, torch.Generator().manual_seed(1))
        for module in model.modules():
            if isinstance(module, torch.nn.BatchNorm2d):
                module.momentum = 0.0
        stack = model.stack0
        y = torch.randn(1, 16, 16, 16)
        frozen = [m for m in stack.modules() if isinstance(m, torch.nn.BatchNorm2d)]
        stack.train()
        for m in frozen:
            m.eval()
        together = stack(y)[1]
        stack.eval()
        torch.testing.assert_close(together, stack(y)[1], rtol=1e-4, atol=1e-4)

    def test_first_stack_reaches_the_second(self):
        model = Vlse(2, 2, "basic").eval()
        x = torch.randn(1, 3, 64, 64)
        before = model(x)
        with torch.no_grad():
            model.stack0.remap_score.weight.mul_(0)
        self.assertFalse(torch.equal(before, model(x)))

    def test_flat_optimiser_steps_the_model_like_the_plain_one(self):
        torch.manual_seed(0)
        first = Vlse(2, block="basic")
        second = Vlse(2, block="basic")
        second.load_state_dict(first.state_dict())
        joined = flat.Flat(second)
        average = flat.Average(joined, 0.0)
        plain = torch.optim.AdamW(first.parameters(), 1e-2, weight_decay=0.0)
        fused = torch.optim.AdamW([joined.decayed, joined.plain], 1e-2, weight_decay=0.0)
        for _ in range(2):
            x = torch.randn(2, 3, 64, 64)
            for model in (first, second):
                model.zero_grad()
                maps, aux = model.forward_all(x)[-1]
                (maps.square().mean() + aux.square().mean()).backward()
            joined.gather()
            plain.step()
            fused.step()
            average.update()
        for (name, a), b in zip(first.state_dict().items(), second.state_dict().values()):
            torch.testing.assert_close(a, b, msg=name)
        state = second.state_dict()
        for name, value in average.state().items():  # an average without memory is the model
            self.assertTrue(torch.equal(value, state[name]), name)
        self.assertEqual(set(average.state()), {n for n in state if not n.endswith("tracked")})


@unittest.skipIf(torch is None, "torch is not installed")
class WeightsFile(unittest.TestCase):
    def test_export_and_load_give_the_same_output(self):
        model = Vlse(4, 2, "hybrid").eval()
        randomise(model, torch.Generator().manual_seed(2))
        x = torch.randn(1, 3, 64, 64)
        metadata = weights_file.metadata_of(model, "test", 64, 16.0, score_threshold=0.1, top_k=9)
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "m.safetensors")
            for half, tolerance in ((False, 0), (True, 0.05)):
                weights_file.save_model(path, model, metadata, half)
                loaded, read = weights_file.load_model(path)
                self.assertEqual(read, metadata)
                torch.testing.assert_close(loaded(x), model(x), rtol=tolerance, atol=tolerance)

    def test_names_are_the_runtime_contract(self):
        names = set(exported_state(build("nano")))
        for name in ("stem.conv.weight", "stem.block1.project.bias", "stack0.hg.3.low2.conv2_vertical.weight", "stack0.res.merge.bias",
                     "stack0.hg.0.up1.bn3.running_var", "stack0.fc.conv.weight", "stack0.fc.bn.bias", "stack0.head.dis.conv2.weight"):
            self.assertIn(name, names)
        self.assertFalse([n for n in names if "aux" in n or "tracked" in n or "remap" in n])
        self.assertIn("stack0.remap_feature.weight", exported_state(Vlse(2, 2)))
        self.assertNotIn("stack1.remap_feature.weight", exported_state(Vlse(2, 2)))

    def test_missing_tensor_is_refused(self):
        model = Vlse(2)
        tensors = {k: v.numpy() for k, v in list(exported_state(model).items())[:-1]}
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "m.safetensors")
            weights_file.write(path, tensors, weights_file.metadata_of(model, "test", 64, 16.0))
            with self.assertRaisesRegex(ValueError, "lacks or adds"):
                weights_file.load_model(path)

    def test_random_weights_of_a_preset_carry_its_metadata(self):
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "m.safetensors")
            export_safetensors.main(["--random", "nano", path])
            _, metadata = weights_file.read(path)
        self.assertEqual((metadata["width"], metadata["stacks"], metadata["block"]), ("16", "1", "hybrid"))
        self.assertEqual(metadata["input_width"], str(PRESETS["nano"].size))

    def test_onnx_in_opencv_gives_the_output_of_the_random_weights_file(self):
        if torch.__version__ >= "2" and importlib.util.find_spec("onnx") is None:
            self.skipTest("this torch needs the package onnx to export")
        with tempfile.TemporaryDirectory() as folder:
            onnx, path = os.path.join(folder, "m.onnx"), os.path.join(folder, "m.safetensors")
            export_onnx.main(["--random", "nano", onnx, "--size", "64"])
            export_safetensors.main(["--random", "nano", path, "--fp32"])
            model, _ = weights_file.load_model(path)
            net = cv2.dnn.readNetFromONNX(onnx)
        x = torch.randn(1, 3, 64, 64)
        net.setInput(x.numpy())
        with torch.no_grad():
            expected = model(x).numpy()
        np.testing.assert_allclose(net.forward(), expected, rtol=1e-3, atol=1e-3 * np.abs(expected).max())


@unittest.skipIf(torch is None, "torch is not installed")
class Data(unittest.TestCase):
    def test_view_without_augmentation_is_the_plain_resize(self):
        rng = np.random.default_rng(0)
        image = rng.integers(0, 255, (96, 128, 3)).astype(np.uint8)
        sample = data.Sample("x", image, np.array([[10.0, 20, 90, 20]]), np.array([1.0]))
        view, maps = data.render(sample, 64, rng, data.Augmentation())
        expected = cv2.resize(image, (64, 64), interpolation=cv2.INTER_LINEAR)
        self.assertLessEqual(np.abs(view[1:-1, 1:-1].astype(int) - expected[1:-1, 1:-1]).max(), 8)  # 5-bit weights of warpAffine
        y, x = np.unravel_index(maps[0].argmax(), maps[0].shape)
        centre = x + maps[2, y, x], y + maps[3, y, x]
        np.testing.assert_allclose(centre, [(50.5) * 64 / 128 / 4, (20.5) * 64 / 96 / 4], atol=1e-4)

    def test_labels_follow_the_image_through_every_augmentation(self):
        image = np.zeros((96, 128, 3), np.uint8)
        image[30:34, 20:100] = 255  # a bar whose axis is y = 31.5, x from 20 to 99
        sample = data.Sample("bar", image, np.array([[20.0, 31.5, 99, 31.5]]), np.array([1.0]))
        everything = data.Augmentation(zoom=(0.9, 1.1), aspect=0.1, flip=0.5, upside_down=0.5, quarter_turn=0.5)
        for seed in range(20):
            view, maps = data.render(sample, 128, np.random.default_rng(seed), everything)
            y, x = np.unravel_index(maps[0].argmax(), maps[0].shape)
            mid = np.array([x + maps[2, y, x], y + maps[3, y, x]]) * 4 - 0.5
            for along in (-0.8, 0, 0.8):
                px, py = np.round(mid + along * maps[4:6, y, x] * 4).astype(int)
                self.assertGreater(view[py, px, 0], 128, f"seed {seed}")

    def test_batches_are_a_function_of_seed_epoch_and_index(self):
        with tempfile.TemporaryDirectory() as folder:
            write_images(os.path.join(folder, "d"))
            samples = [s for _, s in data.load(os.path.join(folder, "d"))]
        first = data.Batches(samples, 2, 64, data.TRAINING, seed=5)
        sequence = [first.next() for _ in range(5)]
        first.close()
        second = data.Batches(samples, 2, 64, data.TRAINING, seed=5, epoch=1, index=1)
        epoch, index, images, maps = second.next()
        second.close()
        self.assertEqual((epoch, index), sequence[4][:2])
        np.testing.assert_array_equal(images, sequence[4][2])
        np.testing.assert_array_equal(maps, sequence[4][3])

    def test_split_keeps_groups_whole(self):
        samples = [(f"g{i // 4}", i) for i in range(400)]
        training, validation = data.split(samples, every=10)
        self.assertEqual(len(training) + len(validation), 400)
        self.assertTrue(validation)
        self.assertFalse({i // 4 for i in training} & {i // 4 for i in validation})


@unittest.skipIf(torch is None, "torch is not installed")
class Resume(unittest.TestCase):
    def test_killed_run_continues_to_the_same_weights(self):
        with tempfile.TemporaryDirectory() as folder:
            images = os.path.join(folder, "images")
            write_images(images)
            whole, broken = os.path.join(folder, "whole"), os.path.join(folder, "broken")
            finish(start_training(images, whole, 4))
            process = start_training(images, broken, 1000)
            state = os.path.join(broken, "state.pt")
            deadline = time.monotonic() + 120
            while not os.path.exists(state) and process.poll() is None and time.monotonic() < deadline:
                time.sleep(0.01)
            process.send_signal(signal.SIGKILL)
            process.communicate()
            step = torch.load(state)["step"]
            self.assertGreater(step, 0)
            target = 4 if step < 12 else None
            if target is None:
                self.skipTest("the machine was too slow to kill the run in time")
            finish(start_training(images, broken, 4))
            a, b = torch.load(os.path.join(whole, "state.pt")), torch.load(state)
            self.assertEqual((a["step"], a["epoch"], a["index"]), (b["step"], b["epoch"], b["index"]))
            for key in ("model", "average"):
                for name, value in a[key].items():
                    self.assertTrue(torch.equal(value, b[key][name]), name)

    def test_committed_networks_can_be_continued(self):
        for preset in ("nano", "mobile"):
            run = train.Run(train.parse_arguments(["--data", "", "--out", "", "--device", "cpu", "--preset", preset]), train.Team())
            before = run.model.state_dict()["stem.conv.weight"].clone()
            run.begin(os.path.join(HERE, "..", "..", "assets", "models", preset + ".safetensors"))
            self.assertFalse(torch.equal(run.model.state_dict()["stem.conv.weight"], before))
            self.assertEqual(run.images, 0)

    def test_decay_phase_leaves_the_long_run_untouched_and_ends(self):
        with tempfile.TemporaryDirectory() as folder:
            images = os.path.join(folder, "images")
            write_images(images)
            long_run, final = os.path.join(folder, "long"), os.path.join(folder, "final")
            finish(start_training(images, long_run, 2))
            state = os.path.join(long_run, "state.pt")
            with open(state, "rb") as f:
                before = f.read()
            finish(start_training(images, final, 99, "--start-from", state, "--decay-epochs", "2"))
            with open(state, "rb") as f:
                self.assertEqual(before, f.read())
            a, b = torch.load(state), torch.load(os.path.join(final, "state.pt"))
            self.assertEqual(b["images"], 2 * a["images"])
            exported = os.path.join(folder, "m.safetensors")
            export_safetensors.main([os.path.join(final, "state.pt"), exported, "--size", "64"])
            self.assertEqual(weights_file.load_model(exported)[1]["input_width"], "64")


if __name__ == "__main__":
    unittest.main()
