"""The energy model in networks of sines as a differentiable torch module, of arithmetic that every format has."""

import numpy as np
import torch
from torch import Tensor, nn

from cfem.condensed import Rows
from cfem.condensed.model import Form
from cfem.predict.kinds.energy_net import ORDERS
from cfem.surrogate.torch_model import Condense


class EnergyNet(nn.Module):
    """Torch module of the energy model, forward(s (B, n_a), q (B, n_q)) -> W (B, n, n), delta_free (B, n); arrays as
    cfem.predict.kinds.energy_net.EnergyNetPredictor."""

    def __init__(self, form: Form, rows: Rows, arrays: dict[str, np.ndarray], sizes: list[float] | None = None):
        """Registers the arrays, and one module for each quantity."""
        super().__init__()
        self.condense = Condense(form, rows, sizes)
        self.networks = nn.ModuleList(
            SineNetworkModule(name, arrays, order, rows.n_a) for name, order in ORDERS.items()
        )
        first, second = np.triu_indices(len(arrays["offset"]))
        for name, value in {"first": first, "second": second}.items():
            self.register_buffer(name, torch.as_tensor(value))
        for name in ("to_box", "offset", "polynomial"):
            self.register_buffer(name, torch.as_tensor(arrays[name]))

    def forward(self, s: Tensor, q: Tensor | None = None) -> tuple[Tensor, Tensor]:
        t = s if q is None else torch.cat([s, q], dim=1)
        z = t @ self.to_box.T + self.offset
        terms = torch.cat([torch.ones_like(z[:, :1]), z, z[:, self.first] * z[:, self.second]], dim=1)
        sines = torch.cat([network(z) for network in self.networks], dim=1)
        return self.condense(s, terms @ self.polynomial + sines)


class SineNetworkModule(nn.Module):
    """Hidden units of one quantity, as those of cfem.predict.kinds.energy_net.SineNetwork."""

    def __init__(self, name: str, arrays: dict[str, np.ndarray], order: int, n_a: int):
        """Registers the layers of one quantity. order: of the derivatives by s that are wanted, 0 to 2."""
        super().__init__()
        self.n = 1 + (n_a if order else 0)
        self.depth = sum(key.startswith(f"{name}_weight_") for key in arrays)
        for i in range(self.depth):
            self.register_buffer(f"weight_{i}", torch.as_tensor(arrays[f"{name}_weight_{i}"]))
            self.register_buffer(f"bias_{i}", torch.as_tensor(arrays[f"{name}_bias_{i}"]))
        first, second = np.triu_indices(n_a if order == 2 else 0)
        slopes = (arrays[f"{name}_weight_0"] @ arrays["to_box"][:, : self.n - 1]).T.copy()
        buffers = {"first": first, "second": second, "slopes": slopes, "slope_products": slopes[first] * slopes[second]}
        for key, value in {**buffers, "output": arrays[f"{name}_output"]}.items():
            self.register_buffer(key, torch.as_tensor(value))

    def forward(self, z: Tensor) -> Tensor:
        """Part of the quantity and of its derivatives by s that the hidden units make, at z (B, n)."""
        a = (z @ self.weight_0.T + self.bias_0)[:, None]
        sine, cosine = torch.sin(a), torch.cos(a)
        rows = torch.cat([sine, cosine * self.slopes, -sine * self.slope_products], dim=1)
        for i in range(1, self.depth):
            rows = rows @ getattr(self, f"weight_{i}").T
            a = rows[:, :1] + getattr(self, f"bias_{i}")
            sine, cosine = torch.sin(a), torch.cos(a)
            by_s = rows[:, 1 : self.n]
            curved = cosine * rows[:, self.n :] - sine * by_s[:, self.first] * by_s[:, self.second]
            rows = torch.cat([sine, cosine * by_s, curved], dim=1)
        out = rows @ self.output
        by_s = out[:, 1 : self.n].transpose(1, 2)
        return torch.cat([out[:, 0], by_s.flatten(1), out[:, self.n :].flatten(1)], dim=1)
