"""Losses on raw network maps against the maps of `targets.encode`."""
import torch
import torch.nn.functional as F

POSITIVE_WEIGHT = 10.0  # of a sure midpoint's cell against an empty one, of which there are 50 times more

# Displacement error with half the pull of a small one: end points far off are lost for sAP, those nearly right decide it.
HALF_SLOPE_CELLS = 4.0


def sign_invariant(predicted, target):
    """L1 distance [N, ...] between displacements [N, 2, ...] where v and -v are the same line."""
    return torch.minimum((predicted - target).abs().sum(1), (predicted + target).abs().sum(1))


def soft_bce(logit, target, positive_weight):
    """Mean cross entropy against soft targets; a cell's weight grows with its target, to `positive_weight` at 1."""
    weight = 1 + (positive_weight - 1) * target
    return (F.binary_cross_entropy_with_logits(logit, target, reduction="none") * weight).mean()


def line_loss(maps, target, displacement_scale, fixed_sign=False):
    """Loss terms (midpoint, offset, displacement) of one stack: maps [N, 6, h, w], target [N, 8, h, w].

    `fixed_sign` asks for the target's own sign, which early on keeps neighbouring features from choosing opposite ones.
    """
    maps = maps.float()
    midpoint = soft_bce(maps[:, 1] - maps[:, 0], target[:, 0], POSITIVE_WEIGHT)
    weight = target[:, 1] / target[:, 1].sum().clamp(min=1e-6)
    offset = ((torch.sigmoid(maps[:, 2:4]) - target[:, 2:4]).abs().sum(1) * weight).sum()
    dis, wanted = maps[:, 4:6] * displacement_scale, target[:, 4:6]
    error = (dis - wanted).abs().sum(1) if fixed_sign else sign_invariant(dis, wanted)
    return midpoint, offset, (HALF_SLOPE_CELLS * torch.log1p(error / HALF_SLOPE_CELLS) * weight).sum()


def auxiliary_loss(aux, target):
    """Line coverage and end points, [N, 2, h, w] logits: features for these help the midpoints."""
    aux = aux.float()
    return soft_bce(aux[:, 0], target[:, 6], 2.0) + soft_bce(aux[:, 1], target[:, 7], POSITIVE_WEIGHT)


# After three epochs, true displacements would lift sAP10 from 25 to 37, true midpoints only to 28: hence their weights.
WEIGHTS = {"midpoint": 8.0, "offset": 1.0, "displacement": 0.4, "auxiliary": 0.5}


def total_loss(outputs, target, displacement_scale, fixed_sign=False):
    """Sum over stacks of the weighted terms, and the last stack's terms as a dict of tensors for the log."""
    total = 0
    for maps, aux in outputs:
        terms = dict(zip(("midpoint", "offset", "displacement"), line_loss(maps, target, displacement_scale, fixed_sign)))
        terms["auxiliary"] = auxiliary_loss(aux, target)
        total = total + sum(WEIGHTS[k] * v for k, v in terms.items())
    return total, {k: v.detach() for k, v in terms.items()}
