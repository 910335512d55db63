"""What FE states know of the energy model: values and derivatives of the potential, of e and of C.

Every state gives, for nothing, the value, gradient and Hessian of the potential (energy, multipliers or displacements,
W_aa or its inverse) and the value and gradient of e; datasets of third order (dW/dlambda) give one derivative more of
each, and those with parameters the derivatives by them of the potential, its gradient and e. See
`cfem.predict.series.energy` for the two forms."""

from dataclasses import dataclass, replace
from itertools import combinations_with_replacement
from typing import Any

import numpy as np

from cfem.condensed import pack_upper
from cfem.condensed.condensed import by_displacement
from cfem.condensed.model import Form
from cfem.condensed.parameters import coordinates, from_json, sampled, slopes

CONSTANT = 1e-9  # standard deviation over size of what varies by rounding alone
LEAST = 1e-4  # of the largest size: what varies less by an unlike input is rounding
Derivative = tuple[int, ...]  # the axes by which is derived, ascending: () the value itself, (0, 2) d2/dt0 dt2


@dataclass(frozen=True)
class Observations:
    """What states show of one quantity with q components.

    derivatives: k of them, by axes of t = (s, q), s having n_s of these
    values: (m, k, q)
    unlike: whether s has several units, as a chamber's volume beside a cable's way: the size of a derivative by one
        then says nothing of how much another matters"""

    derivatives: tuple[Derivative, ...]
    values: np.ndarray
    n_s: int
    unlike: bool = False

    def scaled(self, fall: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives (m, k, q), each divided by the largest standard deviation among those of its order times
        fall^order, and those divisors (k,): with 1, all orders weigh alike, but for one that is rounding beside the
        others (in box coordinates). Where inputs are unlike, each axis has its share of these divisors."""
        deviation = self.values.std(axis=0).max(axis=1)
        shares = self._shares(deviation)
        size = np.abs(self.values).max(axis=(0, 2))
        divisors = np.empty(len(self.derivatives))
        groups = [(len(axes), max(axes, default=0) >= self.n_s) for axes in self.derivatives]
        for group in set(groups):
            members = [i for i, candidate in enumerate(groups) if candidate == group]
            largest = size[members].max()
            if largest <= CONSTANT * size.max():  # rounding, or nothing
                largest = size.max() or 1.0
            varies = deviation[members].max() > CONSTANT * largest
            common = (deviation[members] / shares[members]).max() if varies else largest
            divisors[members] = common * shares[members] * fall ** group[0]
        return self.values / divisors[:, None], divisors

    def _shares(self, deviation: np.ndarray) -> np.ndarray:
        """Sizes (k,) of derivatives beside others of their order: 1, or, where inputs are unlike, the geometric mean
        over the axes of how much the first derivative by each varies. deviation: (k,) of each derivative."""
        first = {axes[0]: size for axes, size in zip(self.derivatives, deviation, strict=True) if len(axes) == 1}
        most = max((size for axis, size in first.items() if axis < self.n_s), default=0.0)
        if not self.unlike or most == 0:
            return np.ones(len(self.derivatives))
        size = {axis: max(first[axis] / most, LEAST) if axis < self.n_s else 1.0 for axis in first}
        return np.array(
            [np.prod([size[axis] for axis in axes]) ** (1 / max(len(axes), 1)) for axes in self.derivatives]
        )


def inputs(dataset: Any, form: Form) -> tuple[np.ndarray, np.ndarray]:
    """Inputs s (m, n_a), the displacements or multipliers, and q (m, n_q), the coordinates of the sampled
    parameters."""
    s = dataset.delta_a if form == "displacement" else dataset.lambda_a
    return s, coordinates(parameters_of(dataset), dataset.p)


def parameters_of(dataset: Any) -> tuple:
    """The sampled parameters of a cfem.dataset.reader.Dataset."""
    return sampled(from_json(dataset.meta.get("parameters", [])))


def observations(dataset: Any, form: Form) -> dict[str, Observations]:
    """Observations by t = (s, q), named 'potential', 'effector', 'effector_compliance' and, where loads were recorded,
    'third' (`predict.loads.loaded`)."""
    e, a = dataset.rows.e, dataset.rows.a
    W_aa, W_ea, W_ee = dataset.W[:, a, a], dataset.W[:, e, a], dataset.W[:, e, e]
    dW = dataset.dW
    work = np.einsum("mi,mi->m", dataset.lambda_a, dataset.delta_a)
    if form == "force":
        hessian, gradient_e, compliance = W_aa, W_ea, W_ee
        value, gradient = work - dataset.energy, dataset.delta_a
        third = None if dW is None else (dW[:, :, a, a], dW[:, :, e, a], dW[:, :, e, e])
    else:
        hessian = np.linalg.inv(W_aa)
        gradient_e = W_ea @ hessian
        compliance = W_ee - gradient_e @ W_ea.swapaxes(1, 2)
        value, gradient = dataset.energy, dataset.lambda_a
        third = None if dW is None else by_displacement(dW, e, a, hessian, gradient_e, W_ea)
    n = gradient.shape[1]
    first, second, triple = (tuple(combinations_with_replacement(range(n), order)) for order in (1, 2, 3))
    upper = pack_upper(compliance)
    potential = [(((),), value[:, None, None]), (first, gradient[..., None]), (second, pack_upper(hessian)[..., None])]
    effector = [(((),), dataset.delta_e[:, None, :]), (first, gradient_e.swapaxes(1, 2))]
    locked = [(((),), upper[:, None, :])]
    if third is not None:
        by_hessian, by_gradient, by_compliance = third  # (m, k, i, j): derivatives by s_k
        potential.append(
            (triple, np.stack([_symmetric(by_hessian, axes_triple) for axes_triple in triple], axis=1)[..., None])
        )
        pairs = [(by_gradient[:, k, :, j] + by_gradient[:, j, :, k]) / 2 for j, k in second]
        effector.append((second, np.stack(pairs, axis=1)))
        locked.append((first, pack_upper(by_compliance)))
    if dataset.dpsi_dp is not None:
        psi_q, lam_q, e_q = _by_q(dataset)
        if form == "force":  # at fixed forces: dPsi*/dq = - dPsi/dq, and the actuators move by - W_aa dlambda/dq
            psi_q, gradient_q, e_q = -psi_q, -W_aa @ lam_q, e_q - W_ea @ lam_q
        else:
            gradient_q = lam_q
        axes = range(n, n + psi_q.shape[1])
        potential.append((tuple((j,) for j in axes), psi_q[..., None]))
        mixed = tuple((i, j) for i in range(n) for j in axes)
        potential.append((mixed, gradient_q.reshape(len(gradient_q), -1, 1)))
        effector.append((tuple((j,) for j in axes), e_q.swapaxes(1, 2)))
    parts = {"potential": potential, "effector": effector, "effector_compliance": locked}
    if dataset.dC is not None and form == "displacement":
        parts["third"] = [(((),), dataset.dC[:, None, :])]
    unlike = not dataset.n_c and isinstance(units := dataset.meta.get("units", {}).get("delta_a"), list)
    return {
        name: Observations(
            sum((names for names, _ in orders), ()),
            np.concatenate([v for _, v in orders], axis=1),
            n,
            name == "potential" and unlike and len(set(units)) > 1,
        )
        for name, orders in parts.items()
    }


def _by_q(dataset: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Derivatives of Psi (m, n_q), lambda (m, n_a, n_q) and delta_e (m, n_e, n_q), at fixed displacements of the
    actuators, by the parameters' coordinates."""
    dq_dp = slopes(parameters_of(dataset), dataset.p)
    lam_q, e_q = (values / dq_dp[:, None] for values in (dataset.dlambda_dp, dataset.ddelta_e_dp))
    return dataset.dpsi_dp / dq_dp, lam_q, e_q


def in_box(observed: Observations, to_box: np.ndarray) -> Observations:
    """Observations with derivatives by z = to_box t + offset; to_box is block diagonal in s and q, as the derivatives
    are."""
    from_box = np.linalg.inv(to_box)
    position = {derivative: i for i, derivative in enumerate(observed.derivatives)}
    n = len(to_box)
    values = np.empty_like(observed.values)
    orders = {len(derivative) for derivative in observed.derivatives}
    for order in orders:
        axes = sorted({axis for derivative in observed.derivatives if len(derivative) == order for axis in derivative})
        full = np.zeros((len(values), *[n] * order, values.shape[2]))
        for index in np.ndindex(*[len(axes)] * order):
            place = tuple(axes[i] for i in index)
            if tuple(sorted(place)) in position:
                full[(slice(None), *place)] = observed.values[:, position[tuple(sorted(place))]]
        for axis in range(order):
            full = np.moveaxis(np.tensordot(full, from_box, axes=(1 + axis, 0)), -1, 1 + axis)
        for derivative, i in position.items():
            if len(derivative) == order:
                values[:, i] = full[(slice(None), *derivative)]
    return replace(observed, values=values)


def mean_hessian(potential: Observations) -> np.ndarray:
    """Mean Hessian (n_s, n_s) of the potential over the states."""
    mean = np.zeros((potential.n_s, potential.n_s))
    for i, axes in enumerate(potential.derivatives):
        if len(axes) == 2 and max(axes) < potential.n_s:
            mean[axes] = mean[axes[::-1]] = potential.values[:, i, 0].mean()
    return mean


def _symmetric(third: np.ndarray, axes: Derivative) -> np.ndarray:
    """Entries (m,) of a tensor (m, k, i, j) that is symmetric in all three, but for rounding: the mean of its
    equals."""
    i, j, k = axes
    return (third[:, i, j, k] + third[:, j, i, k] + third[:, k, i, j]) / 3
