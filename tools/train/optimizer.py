"""Muon for the convolution kernels: momentum whose matrix is made orthogonal (Newton-Schulz), rescaled to AdamW's step size.

Few hundred thousand weights and hours of CPU: fewer, better steps pay. Source: K. Jordan et al., Muon (2024); scale 0.2 sqrt(max(rows, columns)).
"""
import torch


def orthogonal(g, steps=5):
    """Nearest-to-orthogonal factor of each matrix of [B, rows, columns], rows <= columns, by a quintic iteration."""
    a, b, c = 3.4445, -4.7750, 2.0315
    x = g / (g.norm(dim=(1, 2), keepdim=True) + 1e-7)
    for _ in range(steps):
        gram = torch.bmm(x, x.transpose(1, 2))
        x = a * x + torch.bmm(b * gram + c * torch.bmm(gram, gram), x)
    return x


class Muon(torch.optim.Optimizer):
    """For weights with at least two dimensions; kernels are matrices [outputs, inputs * taps]."""

    def __init__(self, params, lr=2e-3, momentum=0.95, weight_decay=0.05):
        super().__init__(params, {"lr": lr, "momentum": momentum, "weight_decay": weight_decay})

    @torch.no_grad()
    def step(self):
        for group in self.param_groups:
            by_shape = {}
            for p in group["params"]:
                if p.grad is None:
                    continue
                state = self.state[p]
                if "momentum" not in state:
                    state["momentum"] = torch.zeros_like(p)
                m = state["momentum"].lerp_(p.grad, 1 - group["momentum"])
                update = p.grad.lerp(m, group["momentum"])  # Nesterov
                by_shape.setdefault(p.shape, []).append((p, update))
            for shape, pairs in by_shape.items():
                g = torch.stack([u.reshape(shape[0], -1) for _, u in pairs])
                tall = g.shape[1] > g.shape[2]
                q = orthogonal(g.transpose(1, 2) if tall else g)
                q = q.transpose(1, 2) if tall else q
                scale = 0.2 * max(g.shape[1:]) ** 0.5 * group["lr"]
                for (p, _), update in zip(pairs, q):
                    p.mul_(1 - group["lr"] * group["weight_decay"]).add_(update.reshape(shape), alpha=-scale)
