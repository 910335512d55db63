"""A body under nodal loads with single components of nodal displacements prescribed: full Newton, nothing else.

Independent of cfem.equilibrium, which holds whole nodes."""

import numpy as np

from cfem.mechanics.assembly import make_pattern
from cfem.mechanics.body import Body, bulk_over_volume, pressure_force, response, tangent
from cfem.mechanics.factorization import analyze


def newton(
    body: Body,
    start: np.ndarray,
    held: np.ndarray,
    load: np.ndarray,
    tolerance: float = 1e-9,
    predicted: bool = False,
) -> np.ndarray:
    """Positions (n, 3) mm in equilibrium with load (n, 3) N; the components `held` (n, 3) stay as in start (n, 3) mm.

    predicted: whether the stiffness has the stress that the last step predicted. Element pressures are independent
    unknowns, at first zero. Converged where the free residual, with the pressures that x demands, is below `tolerance`
    of the internal force. Raises ArithmeticError where it does not get there."""
    pattern = make_pattern(len(start), list(body.cliques), np.array([], dtype=int))
    factor = analyze(pattern)
    held = held.ravel()
    column = np.repeat(np.arange(pattern.n_dof), np.diff(pattern.indptr))
    off = held[pattern.indices] | held[column]  # rows and columns of held components become those of the unit matrix
    unit = off & (pattern.indices == column)
    x, pressure, before = start.copy(), np.zeros(body.n_pressures), None
    for _ in range(25):
        at = response(body, x, pressure)
        data = np.zeros(pattern.nnz)
        dtheta = tangent(body, at, pattern.slots, data, before)
        before = at if predicted else None
        force = at.force + pressure_force(body, dtheta, at.mismatch) if body.n_pressures else at.force
        rest = np.where(held, 0.0, (force - load).ravel())
        if np.linalg.norm(rest) <= tolerance * max(np.linalg.norm(force), np.linalg.norm(load)):
            return x
        data[off] = 0.0
        data[unit] = 1.0
        step = -factor(data).solve(rest[:, None]).reshape(-1, 3)
        x = x + step
        if body.n_pressures:
            work = np.einsum("mai,mai->m", dtheta, step[body.cells])
            pressure = at.pressure + at.mismatch + bulk_over_volume(body) * work
    raise ArithmeticError(f"Newton's method stands at a residual of {np.linalg.norm(rest):.1e} N")
