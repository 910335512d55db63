"""The energy model as small networks of sines, fitted by Gauss-Newton steps to all that the samples know.

The potential, e and C each have a network, fitted to values and derivatives alike. Each component of a quantity, and
each order of its derivatives, weighs by its own standard deviation: what the loss of W and delta_free asks for, whose
entries are standardised one by one. Every tenth training row is held out and picks the iteration; test rows never come
here."""

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np

from cfem.core.spec import meaning
from cfem.predict.kinds.energy_net import ORDERS
from cfem.surrogate.networks.gauss_newton import LeastSquaresState, minimise
from cfem.surrogate.networks.series_network import DerivativeResiduals, Network
from cfem.surrogate.series.coordinates import box_coordinates
from cfem.surrogate.series.observations import Observations, in_box, inputs, mean_hessian, observations
from cfem.surrogate.spec import EnergyNetSpec

VALIDATION_STRIDE = 10
CONSTANT = 1e-6  # standard deviation, relative to the largest entry of its order, that still counts as a variation
ROUNDING = 1e-9  # the same, relative to the largest of all


def fit(
    dataset: Any, spec: EnergyNetSpec, folder: Path | None = None
) -> tuple[dict[str, np.ndarray], dict[str, Any], list[dict[str, Any]]]:
    """Arrays of cfem.predict.kinds.energy_net, facts for model.json, history: one record a hundredth of the iterations.

    dataset: cfem.dataset.reader.Dataset, training rows only. folder: where a killed fit of the same rows by the same
    spec goes on; what is kept there is the caller's to remove."""
    s, q = inputs(dataset, spec.form)
    known = observations(dataset, spec.form)
    to_box, offset = box_coordinates(s, q, mean_hessian(known["potential"]))
    z = np.hstack([s, q]) @ to_box.T + offset
    arrays, polynomials, best, history = {"to_box": to_box, "offset": offset}, [], {}, []
    for name, order in ORDERS.items():
        checkpoint = None if folder is None else folder / f"energy-net-{identity(dataset, spec)}-{name}.npz"
        network, theta, state = fit_quantity(z, in_box(known[name], to_box), spec, checkpoint)
        *hidden, (output, constant) = network.layers(theta)
        for i, (weight, bias) in enumerate(hidden):
            arrays[f"{name}_weight_{i}"], arrays[f"{name}_bias_{i}"] = weight, bias
        arrays[f"{name}_output"] = output[:, : network.width].T.copy()
        coefficients = np.vstack([constant, output[:, network.width :].T])
        polynomials.append(polynomial_parts(coefficients, to_box[:, : s.shape[1]], order))
        best[name] = state.best_iteration
        interval = max(spec.iterations // 100, 1)
        history += [
            {"quantity": name, **record}
            for record in state.history
            if record["iteration"] % interval == 0 or record is state.history[-1]
        ]
    arrays["polynomial"] = np.hstack(polynomials)
    return arrays, {"form": spec.form, "best_iteration": best}, history


def fit_quantity(
    z: np.ndarray, observed: Observations, spec: EnergyNetSpec, checkpoint: Path | None = None
) -> tuple[Network, np.ndarray, LeastSquaresState]:
    """The network of one quantity at the states z (m, n), and its weights, in the quantity's own units."""
    values = observed.values.copy()
    mean = values[:, 0].mean(axis=0)
    values[:, 0] -= mean
    divisors = standard_deviations(observed)
    unit = divisors[0]
    network = Network(z.shape[1], spec.width, spec.depth, len(unit))
    held_out = np.arange(len(z)) % VALIDATION_STRIDE == VALIDATION_STRIDE - 1

    def residuals(rows: np.ndarray) -> DerivativeResiduals:
        return DerivativeResiduals(network, z[rows], observed.derivatives, values[rows] / unit, unit / divisors)

    validation = residuals(held_out) if held_out.any() else None
    start = network.start(spec.seed)
    state = minimise(residuals(~held_out), validation, start, spec.iterations, spec.patience, checkpoint)
    theta = state.best_theta.copy()
    output, constant = network.layers(theta)[-1]
    output *= unit[:, None]
    constant *= unit
    constant += mean
    return network, theta, state


def standard_deviations(observed: Observations) -> np.ndarray:
    """Standard deviations (k, q) of each component, those of one order together; derivatives by parameters apart from
    those by s. What does not vary counts as if it varied by a `CONSTANT` share of the largest entry of its order."""
    groups = [(len(axes), max(axes, default=0) >= observed.n_s) for axes in observed.derivatives]
    divisors, largest = np.empty(observed.values.shape[1:]), np.abs(observed.values).max()
    for group in set(groups):
        members = [i for i, candidate in enumerate(groups) if candidate == group]
        values = observed.values[:, members]
        spread = np.sqrt(values.var(axis=0).mean(axis=0))
        size = np.abs(values).max()
        divisors[members] = np.maximum(spread, CONSTANT * size) if size > ROUNDING * largest else largest or 1.0
    return divisors


def polynomial_parts(coefficients: np.ndarray, slopes: np.ndarray, order: int) -> np.ndarray:
    """Coefficients (1 + n + n (n + 1) / 2, k q) of 1, z_i and z_i z_j in a quadratic and its derivatives by s up to an
    order, from those of the quadratic itself (1 + n + n (n + 1) / 2, q); slopes (n, n_a): dz/ds. In the order of
    `cfem.predict.series.energy.layout`."""
    n, n_a = slopes.shape
    q = coefficients.shape[1]
    first, second = np.triu_indices(n)
    hessian = np.zeros((q, n, n))
    hessian[:, first, second] += coefficients[1 + n :].T
    hessian[:, second, first] += coefficients[1 + n :].T
    parts = [coefficients]
    if order >= 1:
        gradient = np.zeros((len(coefficients), q, n_a))
        gradient[0] = coefficients[1 : 1 + n].T @ slopes
        gradient[1 : 1 + n] = np.einsum("qij,jk->iqk", hessian, slopes)
        parts.append(gradient.reshape(len(coefficients), -1))
    if order >= 2:
        constant = np.zeros((len(coefficients), q * n_a * (n_a + 1) // 2))
        constant[0] = (slopes.T @ hessian @ slopes)[:, *np.triu_indices(n_a)].ravel()
        parts.append(constant)
    return np.hstack(parts)


def identity(dataset: Any, spec: EnergyNetSpec) -> str:
    """Names what a fit is of: its rows and its spec."""
    digest = hashlib.sha256(json.dumps(meaning(spec)).encode())
    for values in (*inputs(dataset, spec.form), dataset.W, dataset.delta_free):
        digest.update(np.ascontiguousarray(values).tobytes())
    return digest.hexdigest()[:16]
