"""A model's weights as few long tensors, so that optimiser, clipping, averaging and sharing cost little beside small networks."""
import torch
from torch import nn


class Flat:
    """Moves a model's parameters into `decayed` (kernels) and `plain` (biases, normalisation), its statistics into `statistics`.

    The model's tensors become views of these; call `gather` after backward to fill the flat gradients.
    """

    def __init__(self, model):
        parameters = list(model.named_parameters())
        kernels = [(n, p) for n, p in parameters if p.ndim >= 2]
        others = [(n, p) for n, p in parameters if p.ndim < 2]
        buffers = [(n, b) for n, b in model.named_buffers() if b.dtype.is_floating_point]
        self._groups = [[p for _, p in kernels], [p for _, p in others]]
        self.decayed, self.plain = (nn.Parameter(_join(g)) for g in self._groups)
        self.statistics = _join([b for _, b in buffers])
        self._layout = [[(n, t.shape) for n, t in group] for group in (kernels, others, buffers)]
        for flat, group in zip((self.decayed, self.plain), self._groups):
            for p, part in zip(group, _parts(flat.data, [p.shape for p in group])):
                p.data = part
        for (name, buffer), part in zip(buffers, _parts(self.statistics, [b.shape for _, b in buffers])):
            owner, _, leaf = name.rpartition(".")
            model.get_submodule(owner)._buffers[leaf] = part

    def gather(self):
        """One tensor with all gradients, kernels first; the flat parameters' gradients are views of it."""
        gradient = torch.cat([p.grad.reshape(-1) for group in self._groups for p in group])
        self.decayed.grad = gradient[: self.decayed.numel()]
        self.plain.grad = gradient[self.decayed.numel() :]
        return gradient

    def forget(self):
        """Drops the gradients, faster than `model.zero_grad()`."""
        for group in self._groups:
            for p in group:
                p.grad = None

    def values(self):
        """The three flat tensors."""
        return [self.decayed.data, self.plain.data, self.statistics]

    def named(self, values):
        """Name -> tensor of three flat tensors laid out like `values()`."""
        return {n: t for flat, layout in zip(values, self._layout) for (n, _), t in zip(layout, _parts(flat, [s for _, s in layout]))}


class Average:
    """Exponential moving average of a `Flat`, with a short memory in the beginning."""

    def __init__(self, flat, decay):
        self.flat, self.decay, self.count = flat, decay, 0
        self.values = [v.clone() for v in flat.values()]

    @torch.no_grad()
    def update(self):
        self.count += 1
        keep = min(self.decay, (1 + self.count) / (10 + self.count))
        for mean, value in zip(self.values, self.flat.values()):
            mean.lerp_(value, 1 - keep)

    def state(self):
        return self.flat.named(self.values)

    @torch.no_grad()
    def restore(self, tensors, count):
        self.count = count
        for name, value in self.state().items():
            value.copy_(tensors[name])


def _join(tensors):
    return torch.cat([t.detach().reshape(-1) for t in tensors])


def _parts(flat, shapes):
    return [part.view(shape) for part, shape in zip(flat.split([shape.numel() for shape in shapes]), shapes)]
