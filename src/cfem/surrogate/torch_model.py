"""The models as differentiable torch modules: forward(delta_a (B, n_a)) -> W (B, n, n), delta_free (B, n), float64.

Standardisation and box coordinates are inside, so an exported graph takes mm and gives mm/N and mm."""

from itertools import pairwise

import numpy as np
import torch
from torch import Tensor, nn

from cfem.condensed import Rows
from cfem.predict.spectral import layout, unpacking

ACTIVATIONS = {"relu": nn.ReLU, "tanh": nn.Tanh, "silu": nn.SiLU}


class Spectral(nn.Module):
    """The energy model; arrays as cfem.predict.spectral.SpectralPredictor."""

    def __init__(self, rows: Rows, arrays: dict[str, np.ndarray]):
        super().__init__()
        self.n_a, self.n_e = rows.n_a, rows.n_e
        self.sizes = [part.stop - part.start for part in layout(rows.n_a, rows.n_e).values()]
        self.degree = int(arrays["indices"].max(initial=0))
        for name in ("to_box", "offset", "indices", "series"):
            self.register_buffer(name, torch.as_tensor(arrays[name]))
        self.register_buffer("unpack_a", torch.as_tensor(unpacking(rows.n_a).ravel()))
        self.register_buffer("unpack_e", torch.as_tensor(unpacking(rows.n_e).ravel()))

    def forward(self, delta_a: Tensor) -> tuple[Tensor, Tensor]:
        out = self.basis(delta_a @ self.to_box.T + self.offset) @ self.series.T
        _, gradient, hessian, effector, effector_gradient, locked = torch.split(out, self.sizes, dim=1)
        gradient_e = effector_gradient.reshape(-1, self.n_e, self.n_a)
        W_aa = spd_inverse(hessian[:, self.unpack_a].reshape(-1, self.n_a, self.n_a))
        W_ea = gradient_e @ W_aa
        W_ee = locked[:, self.unpack_e].reshape(-1, self.n_e, self.n_e) + W_ea @ gradient_e.transpose(1, 2)
        W_a = torch.cat([W_ea, W_aa], dim=1)
        W = torch.cat([torch.cat([W_ee, W_ea.transpose(1, 2)], dim=1), W_a], dim=2)
        return W, torch.cat([effector, delta_a], dim=1) - (W_a @ gradient[:, :, None])[:, :, 0]

    def basis(self, z: Tensor) -> Tensor:
        """(B, n_a) -> (B, M), by the doubling of cfem.predict.chebyshev."""
        table = torch.stack([torch.ones_like(z), z])
        known = 1
        while known < self.degree:
            more = min(known, self.degree - known)
            new = 2 * table[known] * table[1 : more + 1] - torch.flip(table[known - more : known], [0])
            table = torch.cat([table, new])
            known += more
        product = table[self.indices[:, 0], :, 0]
        for axis in range(1, self.n_a):
            product = product * table[self.indices[:, axis], :, axis]
        return product.T


class Mlp(nn.Module):
    """The paper's F: hidden layers of equal width, float32 within, standardised inputs and outputs.

    Outputs are the packed upper triangle of W, then delta_free; an entry with out_scale 0 is constant."""

    def __init__(self, rows: Rows, width: int, depth: int, activation: str, dropout: float = 0.0):
        super().__init__()
        self.n = rows.n
        sizes = [rows.n_a, *[width] * depth]
        hidden = [
            layer
            for inputs, outputs in pairwise(sizes)
            for layer in (nn.Linear(inputs, outputs), ACTIVATIONS[activation](), nn.Dropout(dropout))
        ]
        outputs = rows.n * (rows.n + 1) // 2 + rows.n
        self.net = nn.Sequential(*hidden, nn.Linear(sizes[-1], outputs))
        for name, size in (
            ("in_mean", rows.n_a),
            ("in_scale", rows.n_a),
            ("out_mean", outputs),
            ("out_scale", outputs),
        ):
            self.register_buffer(name, torch.zeros(size, dtype=torch.float64))
        self.register_buffer("unpack", torch.as_tensor(unpacking(rows.n).ravel()))

    def forward(self, delta_a: Tensor) -> tuple[Tensor, Tensor]:
        standardised = ((delta_a - self.in_mean) / self.in_scale).float()
        out = self.net(standardised).double() * self.out_scale + self.out_mean
        return out[:, : -self.n][:, self.unpack].reshape(-1, self.n, self.n), out[:, -self.n :]

    @property
    def layers(self) -> list[nn.Linear]:
        return [layer for layer in self.net if isinstance(layer, nn.Linear)]

    def arrays(self) -> dict[str, np.ndarray]:
        """Weights as cfem.predict.mlp.MlpPredictor takes them."""
        arrays = {name: getattr(self, name).numpy() for name in ("in_mean", "in_scale", "out_mean", "out_scale")}
        for i, layer in enumerate(self.layers):
            arrays[f"weight_{i}"] = layer.weight.detach().numpy().copy()
            arrays[f"bias_{i}"] = layer.bias.detach().numpy().copy()
        return arrays


def mlp_from_arrays(rows: Rows, arrays: dict[str, np.ndarray], activation: str) -> Mlp:
    """A trained Mlp from what `Mlp.arrays` gave."""
    depth = sum(name.startswith("weight_") for name in arrays) - 1
    model = Mlp(rows, arrays["weight_0"].shape[0], depth, activation)
    with torch.no_grad():
        for i, layer in enumerate(model.layers):
            layer.weight.copy_(torch.as_tensor(arrays[f"weight_{i}"]))
            layer.bias.copy_(torch.as_tensor(arrays[f"bias_{i}"]))
        for name in ("in_mean", "in_scale", "out_mean", "out_scale"):
            getattr(model, name).copy_(torch.as_tensor(arrays[name]))
    return model


def module_of(meta: dict, arrays: dict[str, np.ndarray]) -> nn.Module:
    """The torch module of a model folder's content (cfem.predict.load.read_meta, read_arrays), ready for inference."""
    rows = Rows(tuple(meta["rows"]["effectors"]), tuple(meta["rows"]["actuators"]))
    model = Spectral(rows, arrays) if meta["kind"] == "spectral" else mlp_from_arrays(rows, arrays, meta["activation"])
    return model.eval()


def spd_inverse(matrix: Tensor) -> Tensor:
    """(B, n, n) symmetric positive definite -> inverse, by bordering: arithmetic only, which every export format has.

    A = [[A', b], [b^T, c]], u = A'^-1 b, s = c - b^T u: A^-1 = [[A'^-1 + u u^T / s, -u / s], [-u^T / s, 1 / s]]."""
    inverse = 1 / matrix[:, :1, :1]
    for k in range(1, matrix.shape[1]):
        b = matrix[:, :k, k : k + 1]
        u = inverse @ b
        s = matrix[:, k : k + 1, k : k + 1] - b.transpose(1, 2) @ u
        row = -u.transpose(1, 2) / s
        top = torch.cat([inverse - u @ row, row.transpose(1, 2)], dim=2)
        inverse = torch.cat([top, torch.cat([row, 1 / s], dim=2)], dim=1)
    return inverse
