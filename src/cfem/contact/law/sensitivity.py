"""How forces and motions of a contact state change with its free gaps, while no point changes its mode.

The equations of the modes (`cfem.contact.law.modes`), F(z, free) = 0, are differentiated:
dz/dfree = -(dF/dz)^-1 dF/dfree. Where points slip, the direction of friction is one of the unknowns."""

from collections.abc import Sequence

import numpy as np

from cfem.contact.law.modes import Mode, linear_equations, slip_equations
from cfem.contact.law.problem import ContactProblem
from cfem.core.errors import NumericalError


def sensitivity(
    problem: ContactProblem, modes: Sequence[Mode], lam: np.ndarray, xi: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives (3m, 3m) N/mm of forces and (k, 3m) of motions, at the state lam (3m,) N, xi (k,) with these modes.
    NumericalError where the modes leave it undetermined."""
    p, u, n3 = problem.normalised, problem.units, len(problem.free)
    if problem.mu > 0:
        y = _unknowns(p, modes, lam / u.force, xi / u.motion)
        _, (J,), S = slip_equations(p, modes, y[None])
    else:
        J, _, S = linear_equations(p, modes)
    try:
        slope = -np.linalg.solve(J, S)
    except np.linalg.LinAlgError:
        raise NumericalError("the modes of the contact points leave its state undetermined") from None
    return slope[:n3] * (u.force / u.length), slope[n3 : n3 + p.k] * (u.motion / u.length)[:, None]


def _unknowns(p: ContactProblem, modes: Sequence[Mode], lam: np.ndarray, xi: np.ndarray) -> np.ndarray:
    """Unknowns of `slip_equations` (n,) at a normalised state."""
    sliding = [i for i, mode in enumerate(modes) if mode is Mode.SLIP]
    friction, gap = lam.reshape(-1, 3)[sliding, 1:], p.gap(lam, xi).reshape(-1, 3)[sliding, 1:]
    angles = np.arctan2(friction[:, 1], friction[:, 0])
    return np.concatenate([lam, xi, angles, np.hypot(gap[:, 0], gap[:, 1])])
