"""A trained network as the teacher of another: its maps as soft targets beside the labels."""
import torch

import weights_file
from export_safetensors import load_state

MIN_SCORE = 0.05  # of a teacher's midpoint whose geometry is worth learning


def load_network(path):
    """(network in evaluation mode, preset name) of an exported .safetensors file or the averaged weights of a state.pt."""
    if path.endswith(".safetensors"):
        model, metadata = weights_file.load_model(path)
        return model, metadata["preset"]
    return load_state(path)[:2]


class Teacher:
    """A frozen network that turns a batch of inputs into targets."""

    def __init__(self, path, device, displacement_scale):
        self.model = load_network(path)[0].to(device, memory_format=torch.channels_last).requires_grad_(False)
        self.displacement_scale = displacement_scale

    @torch.no_grad()
    def target(self, x, labels):
        """Targets [N, 8, h, w] laid out like `targets.encode`; line coverage and end points stay those of `labels`."""
        maps = self.model(x).float()
        p = torch.sigmoid(maps[:, 1:2] - maps[:, :1])
        dis = maps[:, 4:6] * self.displacement_scale
        dis = torch.where(dis[:, :1] >= dis[:, 1:], dis, -dis)  # the sign of `targets.canonical`
        return torch.cat([p, torch.where(p < MIN_SCORE, torch.zeros_like(p), p), torch.sigmoid(maps[:, 2:4]), dis, labels[:, 6:]], 1)
