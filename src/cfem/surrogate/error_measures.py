"""Error measures of a model: the paper's loss, and errors in the units that a user cares about."""

from typing import Any

import numpy as np

from cfem.condensed import Rows, entries
from cfem.predict.series.chebyshev import basis
from cfem.predict.series.energy import FOURTH, FOURTH_INDICES, THIRD
from cfem.predict.series.state_error import entry_sizes
from cfem.surrogate.calibration import bound

CONSTANT = 1e-9  # standard deviation, relative to the largest entry of its kind, below which an entry says nothing
NEARLY_NONE = 0.1  # of the root mean square of sizes: errors are relative to at least so much
LITTLE = 1e-3  # of the root of W_ii W_jj: by how much an entry varies at least, where its errors are weighed
SIZE = 1.0  # mm, mm^3 or rad: delta_free is taken to be at least so large, as at rest without load it is rounding alone


def measure(dataset: Any, W: np.ndarray, delta_free: np.ndarray) -> dict[str, Any]:
    """All measures of a prediction W (m, n, n), delta_free (m, n) at the states of `dataset`, as plain data.

    tip: distance between predicted and true effector at the state's own delta_a; force: of the multipliers there, in
    percent of the largest of the actuator; W_percent: of its entries, of the root of W_ii W_jj."""
    rows, length = dataset.rows, float(dataset.meta["length"])
    lambda_a, delta_e = state(rows, W, delta_free, dataset.delta_a)
    force = np.abs(lambda_a - dataset.lambda_a)
    distance = np.linalg.norm((delta_e - dataset.delta_e).reshape(len(W), -1, 3), axis=2)  # (m, effectors) mm
    names = [name.rsplit(".", 1)[0] for name in rows.effectors[::3]]
    return {
        "states": len(W),
        **paper_loss(dataset.W, dataset.delta_free, W, delta_free),
        "frame_loss": frame_loss(rows, dataset.W, dataset.delta_free, W, delta_free),
        **beyond_buckling(dataset, W, delta_free),
        "tip_mm": _statistics(distance),
        "tip_percent_of_length": _statistics(100 * distance / length),
        "effectors_mm": {name: _statistics(distance[:, i]) for i, name in enumerate(names)},
        "force_N": _statistics(force),
        "force_percent": _statistics(_percent(force, np.abs(dataset.lambda_a).max(axis=0))),
        "actuators_N": {name: _statistics(force[:, i]) for i, name in enumerate(rows.actuators)},
        "W_percent": _statistics(_percent(np.abs(W - dataset.W), entry_sizes(dataset.W))),
    }


def of_loads(dataset: Any, arrays: dict[str, np.ndarray], z: np.ndarray, extrapolation: np.ndarray) -> dict[str, Any]:
    """Bounds (`ErrorBound` as plain data) of the relative errors of the compliance's derivatives by loads that a series
    has, from states at z (m, n), in box coordinates, where it extrapolates by `extrapolation` (m,). Errors are relative
    to the size at the state, or to NEARLY_NONE of the root mean square where that is larger."""
    errors = {}
    for name, series, indices in (("dC", THIRD, "indices"), ("d2C", FOURTH, FOURTH_INDICES)):
        true = getattr(dataset, name)
        if true is not None and series in arrays and true.any():
            off = basis(z, arrays[indices].astype(np.int64)) @ arrays[series].T - true
            size = np.linalg.norm(true, axis=1)
            least = NEARLY_NONE * np.sqrt(np.mean(size**2))
            relative = np.linalg.norm(off, axis=1) / np.maximum(size, least)
            errors[name] = bound(relative, extrapolation).model_dump(mode="json")
    return {"of_loads": errors} if errors else {}


def beyond_buckling(dataset: Any, W: np.ndarray, delta_free: np.ndarray) -> dict[str, Any]:
    """Number of states that a patch holds though the robot would buckle under the same wrench, and the frame loss of
    the others. W is unbounded where a robot begins to buckle, and indefinite beyond."""
    if not dataset.n_c:
        return {}
    active = dataset.rows.active
    stable = np.linalg.eigvalsh(dataset.W[:, active, active])[:, 0] > 0
    stable_only = (array[stable] for array in (dataset.W, dataset.delta_free, W, delta_free))
    return {
        "buckled_states": int((~stable).sum()),
        "loss_of_stable": frame_loss(dataset.rows, *stable_only) if stable.any() else float("nan"),
    }


def state(rows: Rows, W: np.ndarray, delta_free: np.ndarray, delta_a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """State of a model, lambda_a = W_aa^-1 (delta_a - delta_free_a) (m, n_a) and delta_e = W_ea lambda_a + delta_free_e
    (m, n_e)."""
    e, a = rows.e, rows.a
    lambda_a = np.linalg.solve(W[:, a, a], (delta_a - delta_free[:, a])[..., None])
    return lambda_a[..., 0], (W[:, e, a] @ lambda_a)[..., 0] + delta_free[:, e]


def paper_loss(
    W: np.ndarray, delta_free: np.ndarray, W_model: np.ndarray, delta_free_model: np.ndarray
) -> dict[str, Any]:
    """Mean squared error of the entries of W (upper triangle) and delta_free, standardised by the mean and standard
    deviation of the true ones; entries constant to rounding are left out and counted. It depends on the directions of
    the scene's axes, which decide what varies: `frame_loss`, distances in mm and forces in N do not."""
    true, model = entries(W, delta_free), entries(W_model, delta_free_model)
    deviation = true.std(axis=0)
    varies = deviation > CONSTANT * sizes(true, W.shape[-1])
    errors = (model - true)[:, varies] / deviation[varies]
    return {
        "loss": float(np.mean(errors**2)) if varies.any() else 0.0,
        "entries": int(varies.sum()),
        "constant_entries": int((~varies).sum()),
    }


def frame_loss(
    rows: Rows, W: np.ndarray, delta_free: np.ndarray, W_model: np.ndarray, delta_free_model: np.ndarray
) -> float:
    """The paper's loss of vectors, not of entries: the squared error of each 3 x 3 block of W, of each column
    of three and of each entry between actuators over the variance of that block, counted as its entries. A block that
    varies by less than a thousandth of the root of W_ii W_jj, as between legs that hardly know of each other, counts as
    if it varied by so much. A scene that is turned has the same one."""
    groups, total, count = vectors(rows), 0.0, 0
    traces = [np.abs(np.trace(W[:, g, g], axis1=1, axis2=2)) for g in groups]
    blocks = [(i, j) for i in range(len(groups)) for j in range(i, len(groups))]
    pairs = [(W[:, groups[i], groups[j]], W_model[:, groups[i], groups[j]], i == j) for i, j in blocks]
    pairs += [(delta_free[:, g, None], delta_free_model[:, g, None], False) for g in groups]
    least = [LITTLE**2 * (traces[i] * traces[j]).mean() for i, j in blocks] + [0.0] * len(groups)
    largest = [max(np.abs(array).max(), size) for array, size in ((W, 0.0), (delta_free, SIZE))]
    for index, (true, model, diagonal) in enumerate(pairs):
        m, k, width = true.shape
        variance = ((true - true.mean(axis=0)) ** 2).sum(axis=(1, 2)).mean()
        if variance > k * width * (CONSTANT * largest[index >= len(blocks)]) ** 2:
            entries_of = k * (k + 1) // 2 if diagonal else k * width
            total += entries_of * ((model - true) ** 2).sum() / m / max(variance, least[index])
            count += entries_of
    return float(total / count) if count else 0.0


def vectors(rows: Rows) -> list[slice]:
    """The rows that turn together, x, y, z or rx, ry, rz of one point, and every other row by itself."""
    groups: list[slice] = []
    first = 0
    while first < rows.n:
        point, _, axis = rows.names[first].rpartition(".")
        three = tuple(f"{point}.{'r' * axis.startswith('r')}{letter}" for letter in "xyz")
        width = 3 if rows.names[first : first + 3] == three else 1
        groups.append(slice(first, first + width))
        first += width
    return groups


def sizes(values: np.ndarray, n: int) -> np.ndarray:
    """Scales (n (n + 3) / 2,) of the `entries` (m, n (n + 3) / 2): the largest of its kind."""
    W, delta_free = np.abs(values[:, :-n]).max(), max(np.abs(values[:, -n:]).max(), SIZE)
    return np.repeat([W, delta_free], [values.shape[1] - n, n])


def _percent(errors: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Errors in percent of sizes, 0 where a size is 0."""
    return 100 * np.divide(errors, sizes, out=np.zeros(errors.shape), where=np.broadcast_to(sizes > 0, errors.shape))


def _statistics(values: np.ndarray) -> dict[str, float]:
    return {
        "max": float(values.max()),
        "mean": float(values.mean()),
        "rms": float(np.sqrt(np.mean(values**2))),
    }
