"""Natural frequencies and damping of the condensed model, as `cfem.fe_motion.modes` has those of the full one."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh

from cfem.condensed.viscosity import stiffened
from cfem.core.errors import NumericalError
from cfem.motion.model import MotionModel
from cfem.motion.payload import Payload


@dataclass(frozen=True)
class LearnedModes:
    """Natural modes of a learned model, k of them."""

    frequency: np.ndarray  # (k,) Hz, lowest first
    damping: np.ndarray  # (k,) share of the critical
    shapes: np.ndarray  # (n_q, k) of q, of unit mass
    effectors: np.ndarray  # (n_e, k) mm of the same motions


def natural_modes(
    model: MotionModel, delta_a: np.ndarray, held: bool = True, count: int = 3, payload: Payload | None = None
) -> LearnedModes:
    """Lowest modes about rest at delta_a (n_a,) mm. held: whether the actuators' displacements are kept still;
    otherwise their forces are. NumericalError where the robot is unstable there."""
    place = model.at(np.asarray(delta_a, float))
    M, K, first = place.M, place.K, model.n_a if held else 0
    if payload is not None:
        J = payload.rows_of(place.effectors_by_q)
        M = M + payload.mass * J.T @ J
    squares, shapes = eigh(K[first:, first:], M[first:, first:])
    count = min(count, len(squares))
    squares, shapes = squares[:count], np.vstack([np.zeros((first, count)), shapes[:, :count]])
    if not (squares > 0).all():
        what = f"{int((squares <= 0).sum())} of the {count} lowest modes grow: the robot is unstable at {delta_a} mm"
        raise NumericalError(what, do="hold its actuators, or take another state")
    by_material = [np.einsum("ik,ij,jk->k", shapes, F, shapes) for F in place.F]
    squared, lost = stiffened(squares, model.losses, by_material)
    return LearnedModes(np.sqrt(squared) / (2 * np.pi), lost / (2 * squared), shapes, place.effectors_by_q @ shapes)


def prewarp(frequency: float, dt: float) -> float:
    """Factor by which steps of the midpoint rule of dt s slow a vibration of a frequency in Hz. Mass times its square
    and viscosity times it make up for that (prewarping, as in Tustin's method)."""
    half = min(np.pi * frequency * dt, 1.0)
    return float(half / np.tan(half))
