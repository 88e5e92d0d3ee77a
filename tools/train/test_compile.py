"""Facts about the compiled network; `python3 -m unittest` in this folder. Needs torch 2."""
import unittest

try:
    import torch

    from model import Vlse
except ImportError:
    torch = None


@unittest.skipUnless(hasattr(torch, "compile"), "this torch does not compile")
class Compile(unittest.TestCase):
    def test_whole_network_is_traced_and_has_the_plain_ones_gradients_and_statistics(self):
        results = []
        for compiles in (False, True):
            torch.manual_seed(0)
            model = Vlse(2, 2, "hybrid").train()
            # Traced without a break, as any backend gets it; aot_eager needs no compiler here.
            forward = torch.compile(model.forward_all, backend="aot_eager", fullgraph=True) if compiles else model.forward_all
            outputs = forward(torch.randn(2, 3, 64, 64))
            sum((maps.square().mean() + aux.square().mean()) for maps, aux in outputs).backward()
            gradients = torch.cat([p.grad.reshape(-1) for p in model.parameters()])
            statistics = torch.cat([b.reshape(-1) for n, b in model.named_buffers() if "running" in n])
            results.append((gradients, statistics))
        (plain, before), (compiled, after) = results
        self.assertLess(float((plain - compiled).norm() / plain.norm()), 1e-6)
        self.assertTrue(torch.equal(before, after))


if __name__ == "__main__":
    unittest.main()
