"""What a model needs to move, fitted to the mass and viscosity of a dataset: the series that `cfem.motion` evaluates.

At each state, motions (Z, Y) of the rows (cfem.equilibrium.inertia) are split in two: Z_a W_aa^-1, the quasi-static
motions of the actuators, and the rest made to leave the actuators alone, Z_e - Z_a W_aa^-1 W_ae and likewise. The two
do not work on each other. Of the second, those are kept that forces on the watched rows make, and of those that
acceleration makes, Y, such as differ enough from the others. The entries of mass and stiffness on them are smooth in
delta_a; their roots, Cholesky factors and vibrations are not, as directions that are soft and stiff turn with the
robot."""

from typing import Any

import numpy as np

from cfem.condensed import pack_upper, unpack_upper
from cfem.core.errors import InputError
from cfem.predict.chebyshev import basis
from cfem.surrogate.coordinates import box_coordinates
from cfem.surrogate.observations import Observations
from cfem.surrogate.spectral import Series, fit_quantity

COORDINATES = 12  # of actuators and inner motions together, beyond which no Y is taken
DISTINCT = 3e-4  # least eigenvalue of the stiffness of motions of unit mean stiffness, at all states
LIFT = 1e-6  # of a coordinate's mean stiffness, added to all at least
FAST = 20.0  # times the lowest frequency: where what is added vibrates
QUERIES = 2000  # at which mass and stiffness have to be positive


def fit_motion(
    dataset: Any, max_degree: int = 16, max_terms: int = 1000, folds: int = 5
) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """The arrays of `cfem.motion.model.MotionModel`, and facts: the number of terms of each part, and what was added to
    mass and stiffness so that they are positive at all of many states between the samples. InputError where the dataset
    has parameters or no mass."""
    if dataset.moving is None:
        raise InputError("the dataset has no mass of its rows", do="sample it with dynamics: true")
    if dataset.p.shape[1]:
        raise InputError("motion of robots with parameters cannot be learned yet", do="sample one robot")
    parts, scale = observed_parts(dataset.moving)
    n_a, s = dataset.rows.n_a, dataset.delta_a
    to_box, offset = box_coordinates(s, np.zeros((len(s), 0)), np.eye(n_a))
    z = s @ to_box.T + offset
    chosen: dict[str, Series] = {}
    for name, values in parts.items():
        observed = Observations(((),), values.reshape(len(z), 1, -1), n_a)
        chosen[name] = fit_quantity(z, observed, max_degree, max_terms, folds)[0]
    lifted = _lift(chosen, s, to_box, offset)
    indices, series = _union(chosen)
    arrays = {"to_box": to_box, "offset": offset, "indices": indices, "series": series, "scale": scale}
    arrays["watched"] = np.array(dataset.rows.n_e)
    return arrays, {"terms": {name: len(one.indices) for name, one in chosen.items()}, "added": lifted}


def observed_parts(moving: Any) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """What is learned, (m, ...) by name in the order of `cfem.motion.model.layout`, and the scale (n_q,) of q, in whose
    shares the mean stiffness is one. moving: of cfem.dataset.reader.Dataset."""
    K, M, F = split(moving)
    rows = moving.rows
    kept = chosen_motions(K, rows.n_a, rows.n_e, rows.n_s)
    K, M, F = (each[..., kept[:, None], kept] for each in (K, M, F))
    scale = 1 / np.sqrt(np.einsum("mii->i", K) / len(K))
    size = np.outer(scale, scale)
    n_a = rows.n_a
    parts = {
        "M": pack_upper(M * size),
        "K": pack_upper((K * size)[:, n_a:, n_a:]),
    }
    return parts | {f"F{index}": pack_upper(F[:, index] * size) for index in range(F.shape[1])}, scale


def chosen_motions(K: np.ndarray, n_a: int, n_e: int, n_s: int) -> np.ndarray:
    """Which of the coordinates of `split` are kept: the actuators' and the effectors', then such as do not depend on
    those before at any state: Y of the actuators, Y of the effectors, Z of the skin. K: (m, n, n)."""
    size = 1 / np.sqrt(np.einsum("mii->i", K) / len(K))
    scaled = K * np.outer(size, size)
    Z_s, Y_e = n_a + n_e, n_a + n_e + n_s
    Y_a = Y_e + n_e + n_s
    kept = list(range(n_a + n_e))
    for one in [*range(Y_a, Y_a + n_a), *range(Y_e, Y_e + n_e), *range(Z_s, Z_s + n_s)]:
        trial = np.array([*kept, one])
        if len(trial) <= COORDINATES and np.linalg.eigvalsh(scaled[:, trial[:, None], trial])[:, 0].min() > DISTINCT:
            kept.append(one)
    return np.array(kept)


def split(moving: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """K, M (m, n_c, n_c) and F (m, k, n_c, n_c) on n_c = n_a + n_e + n_s + n coordinates: quasi-static motions of the
    actuators, then the rest. moving: of cfem.dataset.reader.Dataset."""
    rows, n = moving.rows, moving.rows.n
    W, V = moving.W, moving.V
    a = np.arange(n)[rows.a]
    others = np.setdiff1d(np.arange(2 * n), a)
    K = np.block([[W, V], [V, moving.V2]])
    M = np.block([[V, moving.V2], [moving.V2, moving.V3]])
    by_rows = np.concatenate([W, V], axis=2)  # of the rows by (Z, Y)
    quasi = np.zeros((len(W), 2 * n, len(a)))
    quasi[:, a] = np.linalg.inv(W[:, a[:, None], a])
    rest = np.eye(2 * n)[:, others] - quasi @ by_rows[:, a][:, :, others]
    T = np.concatenate([quasi, rest], axis=2)
    back = T.swapaxes(1, 2)
    F = back[:, None] @ moving.loss @ T[:, None]
    return back @ K @ T, back @ M @ T, F


def _lift(chosen: dict[str, Series], s: np.ndarray, to_box: np.ndarray, offset: np.ndarray) -> dict[str, float]:
    """Adds to the diagonals of K and M what keeps them positive at random states among s (m, n_a): shares of one, and
    s^2."""
    rng = np.random.default_rng(0)
    mixed = rng.dirichlet(np.ones(s.shape[1] + 1), QUERIES)
    some = s[rng.integers(len(s), size=(QUERIES, s.shape[1] + 1))]
    z = np.einsum("qk,qki->qi", mixed, some) @ to_box.T + offset
    lowest, matrices = {}, {}
    for name in ("K", "M"):
        matrices[name] = unpack_upper(basis(z, chosen[name].indices) @ chosen[name].coefficients)
        lowest[name] = float(np.linalg.eigvalsh(matrices[name]).min())
    slowest = float(np.linalg.eigvalsh(matrices["M"]).max())  # 1 / omega^2, about
    added = {"K": max(LIFT, LIFT - 2 * lowest["K"])}
    added["M"] = max(added["K"] * slowest / FAST**2, -2 * lowest["M"])
    added["K"] = max(added["K"], added["M"] * FAST**2 / slowest)
    for name, value in added.items():
        coefficients = chosen[name].coefficients.copy()
        n = matrices[name].shape[1]
        constant = int(np.flatnonzero((chosen[name].indices == 0).all(axis=1))[0])
        coefficients[constant] += value * pack_upper(np.eye(n))
        chosen[name] = Series(chosen[name].indices, coefficients)
    return added


def _union(chosen: dict[str, Series]) -> tuple[np.ndarray, np.ndarray]:
    """One index set (M, n) for all parts, and their series (n_out, M)."""
    union = {tuple(k) for one in chosen.values() for k in one.indices.tolist()}
    indices = np.array(sorted(union, key=lambda k: (sum(k), k)), dtype=np.int64)
    position = {tuple(k): i for i, k in enumerate(indices.tolist())}
    series = []
    for one in chosen.values():
        full = np.zeros((one.coefficients.shape[1], len(indices)))
        full[:, [position[tuple(k)] for k in one.indices.tolist()]] = one.coefficients.T
        series.append(full)
    return indices, np.concatenate(series)
