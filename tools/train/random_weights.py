"""Random weights for tests and speed measurements: every tensor differs, so no exporter can merge two of them."""
import torch

from model import build


@torch.no_grad()
def randomise(model, generator):
    """Weights that keep activations near unit size, and normalisation statistics far enough from (0, 1) to matter."""
    for name, tensor in model.state_dict().items():
        if not tensor.dtype.is_floating_point:
            continue
        noise = torch.randn(tensor.shape, generator=generator)
        if name.endswith("running_var"):
            tensor.copy_(0.5 + noise.abs())
        elif name.endswith("running_mean"):
            tensor.copy_(0.3 * noise)
        elif tensor.ndim == 4:
            gain = 0.3 if "conv3" in name or "remap" in name or "project" in name else 1.5  # sums must not explode
            tensor.copy_(noise * (gain / tensor[0].numel()) ** 0.5)
        elif ".bn" in name and name.endswith("weight"):
            tensor.copy_(0.8 + 0.3 * noise)
        else:
            tensor.copy_(0.2 * noise)


def random_model(preset, seed=0):
    """A preset in evaluation mode; the same seed gives the same weights to every exporter."""
    model = build(preset).eval()
    randomise(model, torch.Generator().manual_seed(seed))
    return model
