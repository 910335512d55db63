"""What a model needs to move, fitted to the mass and viscosity of a dataset: the series that `cfem.motion` evaluates.

Mass and loss are learned as their symmetric square roots, whose squares are positive at every state, the inner motions
chosen alike at all states (inner_motions.py): all entries are smooth in delta_a."""

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from cfem.condensed import pack_upper
from cfem.condensed.packing import unpacking
from cfem.core.errors import InputError
from cfem.surrogate.inner_motions import InnerMotions, inner_motions
from cfem.surrogate.series.coordinates import box_coordinates
from cfem.surrogate.series.observations import Observations
from cfem.surrogate.series.spectral import Series, fit_quantity, united

# Held-out error below which the shorter series is taken, as a step in time evaluates all terms. At 4.5e-3 the worst
# of 120 frequencies of a trunk was wrong by 1.6 %, at 4.2e-3 by 0.7 %.
ENOUGH = 4.2e-3
MAX_TERMS = 1000  # of a series


def fit_motion(dataset: Any, max_degree: int = 16, folds: int = 5) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Arrays of `cfem.motion.model.MotionModel`, and facts: terms and held-out error of each part (the root of the mean
    square over that of the part's variation), inner motions, and the viscosity that each loss form is multiplied by.
    InputError where the dataset has parameters or no mass."""
    if dataset.moving is None:
        raise InputError("the dataset has no mass of its rows", do="sample it with dynamics: true")
    if dataset.p.shape[1]:
        raise InputError("motion of robots with parameters cannot be learned yet", do="sample one robot")
    n_a, s = dataset.rows.n_a, dataset.delta_a
    D = None if dataset.dC is None else dataset.dC[:, unpacking(dataset.rows.n_e, 3)]
    to_box, offset = box_coordinates(s, np.zeros((len(s), 0)), np.eye(n_a))
    z = s @ to_box.T + offset

    def fit(values: np.ndarray) -> tuple[Series, float | None]:
        observed = Observations(((),), values.reshape(len(z), 1, -1), n_a)
        series, _, records = fit_quantity(z, observed, max_degree, MAX_TERMS, folds, enough=ENOUGH)
        return series, min((record["error"] for record in records), default=None)

    W_aa = dataset.W[:, dataset.rows.a, dataset.rows.a]
    unit = 1 / np.sqrt(np.einsum("mii->mi", np.linalg.inv(W_aa)).mean(axis=0))
    chosen, mass = _smoothest(inner_motions(dataset.moving, D), unit, fit)
    k, viscosity = chosen.M.shape[1] - n_a, dataset.moving.viscosity
    # materials of the same viscosity share a loss
    different = [damping for index, damping in enumerate(viscosity) if viscosity.index(damping) == index]
    losses = [sum(chosen.loss[:, i] for i, known in enumerate(viscosity) if known == damping) for damping in different]
    reach = np.sqrt((chosen.e**2).sum(axis=1).mean())  # mm by which a motion of energy 1/2 moves the effectors
    reach = float(reach) if reach > 0 else 1.0
    parts = {"H": chosen.e.reshape(len(s), -1) / reach}
    parts |= {f"F{index}": _packed_root(F, unit) for index, F in enumerate(losses)}
    if chosen.curve is not None:
        parts["curve"] = pack_upper(chosen.curve).reshape(len(s), -1) / reach**2
    fits = {"M": mass} | {name: fit(values) for name, values in parts.items()}
    fitted = {name: series for name, (series, _) in fits.items()}
    indices, padded = united(fitted)
    series = np.concatenate([coefficients.T for coefficients in padded.values()])
    scale = np.concatenate([unit, np.full(k, reach)])
    arrays = {"to_box": to_box, "offset": offset, "indices": indices, "series": series, "scale": scale}
    if "curve" in parts:
        outputs = len(series) - parts["curve"].shape[1]
        arrays |= {"series": series[:outputs], "curve": series[outputs:]}
    if chosen.skin is not None:
        fits["skin"] = fit(chosen.skin / reach)
        skin = fits["skin"][0]
        arrays |= {"skin_indices": skin.indices, "skin": skin.coefficients.T.copy()}
    facts: dict[str, Any] = {"inner": k, "viscosity": different}
    facts["terms"] = {name: len(series.indices) for name, (series, _) in fits.items()}
    facts["held_out"] = {name: error for name, (_, error) in fits.items()}
    return arrays | {"stiffness": np.array(1 / reach**2)}, facts


def _smoothest(
    offered: Iterable[InnerMotions], unit: np.ndarray, fit: Callable[[np.ndarray], tuple[Series, float | None]]
) -> tuple[InnerMotions, tuple[Series, float | None]]:
    """The first of these inner motions whose mass is learned well enough, or those whose mass is learned best; and the
    fit of their mass. unit: (n_a,) of the actuators' displacements"""
    best: tuple[InnerMotions, tuple[Series, float | None]] | None = None
    for motions in offered:
        series, error = fit(_packed_root(motions.M, unit))
        if best is None or (error is not None and error < (best[1][1] or np.inf)):
            best = motions, (series, error)
        if error is None or error <= ENOUGH:
            break
    assert best is not None
    return best


def _packed_root(A: np.ndarray, unit: np.ndarray) -> np.ndarray:
    """Upper triangle of the root of (m, n, n) forms, in units (n_a,) of the actuators' displacements."""
    units = np.concatenate([unit, np.ones(A.shape[1] - len(unit))])
    return pack_upper(_root(A * np.outer(units, units)))


def _root(A: np.ndarray) -> np.ndarray:
    """The symmetric square root of (m, n, n) semidefinite matrices."""
    values, vectors = np.linalg.eigh(A)
    return (vectors * np.sqrt(np.maximum(values, 0.0))[:, None]) @ vectors.swapaxes(1, 2)
