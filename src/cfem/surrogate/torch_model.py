"""The models as differentiable torch modules: forward(s (B, n_a)) or forward(s, p (B, n_p)) -> W (B, n, n),
delta_free (B, n), float64; s is delta_a or lambda_a, by the model's form.

Standardisation, box coordinates and the coordinates of parameters are inside, so an exported graph takes mm or N and
gives mm/N and mm."""

from itertools import pairwise

import numpy as np
import torch
from torch import Tensor, nn

from cfem.condensed import Rows
from cfem.condensed.packing import packed_indices, unpacking
from cfem.condensed.parameters import Parameter
from cfem.predict.series.energy import Form, layout
from cfem.predict.series.semidefinite import FLOOR

ACTIVATIONS = {"relu": nn.ReLU, "tanh": nn.Tanh, "silu": nn.SiLU}


class Parametric(nn.Module):
    """A module learned(s, q) of the learned parameters' coordinates q as one of p: W (B, n, n), delta_free (B, n)
    whose exact parameters scale W by reference over value (`cfem.predict.protocol.Predictor.softer`)."""

    def __init__(self, learned: nn.Module, form: Form, parameters: tuple[Parameter, ...]):
        super().__init__()
        self.learned, self.inputs = learned, LearnedInputs(form, parameters)

    def forward(self, s: Tensor, p: Tensor) -> tuple[Tensor, Tensor]:
        s, q, softer = self.inputs(s, p)
        W, delta_free = self.learned(s, q)
        return W * softer[:, :, None], delta_free


class LearnedInputs(nn.Module):
    """Map of s and p to s at the reference of exact parameters, the coordinates q of the others, and how much softer
    the robot is than the reference (B, 1)."""

    def __init__(self, form: Form, parameters: tuple[Parameter, ...]):
        super().__init__()
        self.form = form
        self.coordinates = [parameter.coordinate for parameter in parameters if not parameter.exact]
        self.columns = [i for i, parameter in enumerate(parameters) if not parameter.exact]
        self.exact = [(i, parameter.reference) for i, parameter in enumerate(parameters) if parameter.exact]

    def forward(self, s: Tensor, p: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        softer = torch.ones_like(p[:, :1])
        for column, reference in self.exact:
            softer = softer * reference / p[:, column : column + 1]
        q = [COORDINATES[name](p[:, i : i + 1]) for name, i in zip(self.coordinates, self.columns, strict=True)]
        s = s * softer if self.form == "force" else s
        return s, torch.cat(q, dim=1) if q else p[:, :0], softer


COORDINATES = {"linear": lambda p: p, "log": torch.log, "log(1-2p)": lambda p: torch.log(1 - 2 * p)}


class Condense(nn.Module):
    """Flat outputs (B, k) in the order of `cfem.predict.series.energy.layout` to W (B, n, n), delta_free (B, n), as
    `cfem.predict.series.energy.condense`."""

    def __init__(self, form: Form, rows: Rows, sizes: list[float] | None = None):
        super().__init__()
        self.form, self.n_a, self.n_e = form, rows.n_a, rows.n_e
        self.nearest = None if sizes is None else NearestSemidefinite(sizes)
        self.sizes = [part.stop - part.start for part in layout(rows.n_a, rows.n_e).values()]
        self.register_buffer("unpack_a", torch.as_tensor(unpacking(rows.n_a).ravel()))
        self.register_buffer("unpack_e", torch.as_tensor(unpacking(rows.n_e).ravel()))

    def forward(self, s: Tensor, out: Tensor) -> tuple[Tensor, Tensor]:
        """W (B, n, n) and delta_free (B, n) from outputs out (B, k) at inputs s (B, n_a) of the form."""
        _, gradient, hessian, effector, effector_gradient, compliance = torch.split(out, self.sizes, dim=1)
        hessian = hessian[:, self.unpack_a].reshape(-1, self.n_a, self.n_a)
        W_ee = compliance[:, self.unpack_e].reshape(-1, self.n_e, self.n_e)
        gradient_e = effector_gradient.reshape(-1, self.n_e, self.n_a)
        if self.form == "displacement":
            delta_a, lam = s, gradient
            W_aa = spd_inverse(hessian)
            W_ea = gradient_e @ W_aa
            W_ee = W_ee if self.nearest is None else self.nearest(W_ee)
            W_ee = W_ee + W_ea @ gradient_e.transpose(1, 2)
        else:
            delta_a, lam = gradient, s
            W_aa, W_ea = hessian, gradient_e
            W_ee = W_ee if self.nearest is None else self.nearest.within(W_ee, W_ea, W_aa)
        W_a = torch.cat([W_ea, W_aa], dim=1)
        W = torch.cat([torch.cat([W_ee, W_ea.transpose(1, 2)], dim=1), W_a], dim=2)
        return W, torch.cat([effector, delta_a], dim=1) - (W_a @ lam[:, :, None])[:, :, 0]


class NearestSemidefinite(nn.Module):
    """C (B, k, k) to the nearest semidefinite matrix in units of the sizes (k,), as `cfem.predict.series.semidefinite`,
    by (C + |C|) / 2, |C| = C sign C: products alone, which every export format has, and smooth.

    The sign of what is beyond 1e-11 of the whole is found by polynomials 3.4445 x - 4.775 x^3 + 2.0315 x^5, which keep
    [0, 1.13] and take what is small 3.4 times closer (Jordan, Muon, 2024), then by Newton and Schulz's of degree 5.
    Eigenvalues are raised by that much, so that none is negative."""

    STEPS = ((3.4445, -4.7750, 2.0315),) * 20 + ((1.875, -1.25, 0.375),) * 5
    UNDECIDED = 1e-11

    def __init__(self, sizes: list[float]):
        super().__init__()
        units = torch.as_tensor(np.outer(sizes, sizes), dtype=torch.float64)
        self.register_buffer("units", units)
        self.register_buffer("one", torch.eye(len(units), dtype=torch.float64))

    def forward(self, C: Tensor) -> Tensor:
        """Nearest semidefinite matrices (B, k, k) to C (B, k, k)."""
        scaled = C / self.units
        size = torch.sqrt((scaled * scaled).sum(dim=2, keepdim=True).sum(dim=1, keepdim=True)) + FLOOR
        X = scaled / size
        for a, b, c in self.STEPS:
            square = X @ X
            X = X @ (a * self.one + b * square + c * (square @ square))
        magnitude = scaled @ X
        magnitude = (magnitude + magnitude.transpose(1, 2)) / 2
        raised = (scaled + magnitude) / 2 + (self.UNDECIDED * size + FLOOR) * self.one
        return raised * self.units

    def within(self, W_ee: Tensor, W_ea: Tensor, W_aa: Tensor) -> Tensor:
        """W_ee (B, k, k) with the locked compliance that is in it replaced by its nearest."""
        moved = W_ea @ spd_inverse(W_aa) @ W_ea.transpose(1, 2)
        return self.forward(W_ee - moved) + moved


class SeriesModule(nn.Module):
    """Chebyshev series; arrays: to_box, offset, indices and series as cfem.predict.kinds.spectral.SpectralPredictor."""

    def __init__(self, arrays: dict[str, np.ndarray]):
        super().__init__()
        self.n = arrays["indices"].shape[1]
        self.degree = int(arrays["indices"].max(initial=0))
        for name in ("to_box", "offset", "indices", "series"):
            values = arrays[name]
            self.register_buffer(name, torch.as_tensor(values.astype(np.int64) if name == "indices" else values))

    def forward(self, s: Tensor, q: Tensor | None = None) -> Tensor:
        """Outputs (B, outputs) at s (B, n_a) and q (B, n_q)."""
        t = s if q is None else torch.cat([s, q], dim=1)
        return self.basis(t @ self.to_box.T + self.offset) @ self.series.T

    def basis(self, z: Tensor) -> Tensor:
        """Basis (B, M) at z (B, n), by the doubling of cfem.predict.series.chebyshev."""
        table = torch.stack([torch.ones_like(z), z])
        known = 1
        while known < self.degree:
            more = min(known, self.degree - known)
            new = 2 * table[known] * table[1 : more + 1] - torch.flip(table[known - more : known], [0])
            table = torch.cat([table, new])
            known += more
        product = table[self.indices[:, 0], :, 0]
        for axis in range(1, self.n):
            product = product * table[self.indices[:, axis], :, axis]
        return product.T


class Spectral(nn.Module):
    """The energy model in Chebyshev polynomials; arrays as cfem.predict.kinds.spectral.SpectralPredictor."""

    def __init__(self, form: Form, rows: Rows, arrays: dict[str, np.ndarray], sizes: list[float] | None = None):
        super().__init__()
        self.condense, self.series = Condense(form, rows, sizes), SeriesModule(arrays)

    def forward(self, s: Tensor, q: Tensor | None = None) -> tuple[Tensor, Tensor]:
        return self.condense(s, self.series(s, q))


class SurfaceModule(nn.Module):
    """The whole surface, (B, m, 3) mm; arrays as cfem.predict.series.skin.LearnedSkin. forward(s), or forward(s, p)
    where there are parameters."""

    def __init__(self, form: Form, parameters: tuple[Parameter, ...], arrays: dict[str, np.ndarray]):
        super().__init__()
        self.series, self.inputs = SeriesModule(arrays), LearnedInputs(form, parameters)
        self.register_buffer("modes", torch.as_tensor(arrays["modes"].reshape(len(arrays["modes"]), -1)))
        self.register_buffer("rest", torch.as_tensor(np.asarray(arrays["rest"], float)))

    def forward(self, s: Tensor, p: Tensor | None = None) -> Tensor:
        q = None
        if p is not None:
            s, q, _ = self.inputs(s, p)
        moved = self.series(s, q) @ self.modes.double()
        return moved.reshape(-1, self.rest.shape[0], 3) + self.rest


class Mlp(nn.Module):
    """The paper's F: hidden layers of equal width, float32 within, standardised inputs and outputs.

    Inputs are s, then k numbers that tell one robot from another. Outputs are the packed upper triangle of W, then
    delta_free; an entry with out_scale 0 is constant."""

    def __init__(self, rows: Rows, k: int, width: int, depth: int, activation: str, dropout: float = 0.0):
        """Builds the layers; `in_*` and `out_*` are 0 until a fit sets them."""
        super().__init__()
        self.n = rows.n
        inputs, outputs = rows.n_a + k, rows.n * (rows.n + 1) // 2 + rows.n
        sizes = [inputs, *[width] * depth]
        hidden = [
            layer
            for before, after in pairwise(sizes)
            for layer in (nn.Linear(before, after), ACTIVATIONS[activation](), nn.Dropout(dropout))
        ]
        self.net = nn.Sequential(*hidden, nn.Linear(sizes[-1], outputs))
        for name, size in (("in_mean", inputs), ("in_scale", inputs), ("out_mean", outputs), ("out_scale", outputs)):
            self.register_buffer(name, torch.zeros(size, dtype=torch.float64))
        self.register_buffer("unpack", torch.as_tensor(unpacking(rows.n).ravel()))

    def forward(self, s: Tensor, q: Tensor | None = None) -> tuple[Tensor, Tensor]:
        t = s if q is None else torch.cat([s, q], dim=1)
        out = self.net(((t - self.in_mean) / self.in_scale).float()).double() * self.out_scale + self.out_mean
        return out[:, : -self.n][:, self.unpack].reshape(-1, self.n, self.n), out[:, -self.n :]

    @property
    def layers(self) -> list[nn.Linear]:
        return [layer for layer in self.net if isinstance(layer, nn.Linear)]

    def arrays(self) -> dict[str, np.ndarray]:
        """Weights as cfem.predict.kinds.mlp.MlpPredictor takes them."""
        arrays = {name: getattr(self, name).numpy() for name in ("in_mean", "in_scale", "out_mean", "out_scale")}
        for i, layer in enumerate(self.layers):
            arrays[f"weight_{i}"] = layer.weight.detach().numpy().copy()
            arrays[f"bias_{i}"] = layer.bias.detach().numpy().copy()
        return arrays


class OnRest(nn.Module):
    """The paper's pair: network F of s and of the entries of W and delta_free that model G gives where s = 0."""

    def __init__(self, network: Mlp, model: nn.Module):
        super().__init__()
        self.network, self.model = network, model
        rows, columns = packed_indices(network.n)
        self.register_buffer("upper", torch.as_tensor(rows * network.n + columns))

    def forward(self, s: Tensor, q: Tensor) -> tuple[Tensor, Tensor]:
        W, delta_free = self.model(torch.zeros_like(s), q)
        return self.network(s, torch.cat([W.flatten(1)[:, self.upper], delta_free], dim=1))


class Locked(nn.Module):
    """A module of W and delta_free, its locked compliance made semidefinite."""

    def __init__(self, model: nn.Module, n_e: int, sizes: list[float]):
        super().__init__()
        self.model, self.n_e, self.nearest = model, n_e, NearestSemidefinite(sizes)

    def forward(self, *inputs: Tensor) -> tuple[Tensor, Tensor]:
        W, delta_free = self.model(*inputs)
        k = self.n_e
        W_ee = self.nearest.within(W[:, :k, :k], W[:, :k, k:], W[:, k:, k:])
        return torch.cat([torch.cat([W_ee, W[:, :k, k:]], dim=2), W[:, k:]], dim=1), delta_free


def mlp_from_arrays(rows: Rows, arrays: dict[str, np.ndarray], activation: str) -> Mlp:
    """A trained Mlp from what `Mlp.arrays` gave."""
    depth = sum(name.startswith("weight_") for name in arrays) - 1
    width, inputs = arrays["weight_0"].shape
    model = Mlp(rows, inputs - rows.n_a, width, depth, activation)
    with torch.no_grad():
        for i, layer in enumerate(model.layers):
            layer.weight.copy_(torch.as_tensor(arrays[f"weight_{i}"]))
            layer.bias.copy_(torch.as_tensor(arrays[f"bias_{i}"]))
        for name in ("in_mean", "in_scale", "out_mean", "out_scale"):
            getattr(model, name).copy_(torch.as_tensor(arrays[name]))
    return model


def spd_inverse(matrix: Tensor) -> Tensor:
    """Inverse of symmetric positive definite matrices (B, n, n), by bordering: arithmetic only, which every export
    format has.

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
