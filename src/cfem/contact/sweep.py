"""A guess of the modes of many points, from an approximate solution.

Without friction the normal forces minimise lambda . W_nn lambda / 2 + lambda . free_n over lambda >= 0, which is a
problem of non-negative least squares (Lawson and Hanson, *Solving Least Squares Problems*, 1974, chapter 23): exact.
With friction, projected Gauss-Seidel sweeps over the points on the augmented gap (g_n + mu |g_t|, g_t), in which the
law is a projection onto the cone of friction (De Saxce and Feng, *The bipotential method*, 1998)."""

import numpy as np
from scipy.optimize import nnls

from cfem.contact.modes import Mode
from cfem.contact.problem import ContactProblem, Law

SWEEPS = 2000
LEVEL = 1e-12  # of the largest compliance, added to the diagonal: points may depend on each other
SMALL = 1e-9  # of the largest force: a point that carries less is open


def guess(problem: ContactProblem, law: Law) -> tuple[tuple[Mode, ...], np.ndarray | None]:
    """One mode a point, of a problem without object, and the angles of friction where points slip, None without
    friction."""
    if law == "signorini" or problem.mu == 0:
        normal = _pressing(problem)
        touching = normal > SMALL * normal.max(initial=0.0)
        return tuple(Mode.SLIP if one else Mode.OPEN for one in touching), None
    force = _rubbing(problem)
    normal, tangential = force[:, 0], np.linalg.norm(force[:, 1:], axis=1)
    touching = normal > SMALL * normal.max(initial=0.0)
    slips = tangential >= (1 - 1e-6) * problem.mu * normal
    modes = tuple(
        (Mode.SLIP if slip else Mode.STICK) if touch else Mode.OPEN for touch, slip in zip(touching, slips, strict=True)
    )
    return modes, np.arctan2(force[:, 2], force[:, 1])[touching & slips]


def _pressing(problem: ContactProblem) -> np.ndarray:
    """(m,) N, no friction."""
    W, free = problem.W[::3, ::3], problem.free[::3]
    root = np.linalg.cholesky(W + LEVEL * np.trace(W) * np.eye(len(W))).T
    return nnls(root, -np.linalg.solve(root.T, free))[0]


def _rubbing(problem: ContactProblem) -> np.ndarray:
    """(m, 3) N after SWEEPS sweeps, from the forces without friction on."""
    m, mu, W = problem.m, problem.mu, problem.W
    force = np.zeros((m, 3))
    force[:, 0] = _pressing(problem)
    blocks = [slice(3 * i, 3 * i + 3) for i in range(m)]
    rate = [1.0 / max(np.linalg.eigvalsh(W[one, one])[-1], np.finfo(float).tiny) for one in blocks]
    gap = W @ force.ravel() + problem.free
    for _ in range(SWEEPS):
        largest = 0.0
        for i, one in enumerate(blocks):
            local = gap[one]
            wanted = force[i] - rate[i] * local
            wanted[0] -= rate[i] * mu * np.hypot(local[1], local[2])
            change = _on_cone(wanted, mu) - force[i]
            size = float(np.abs(change).max())
            if size > 0.0:
                force[i] += change
                gap += W[:, one] @ change
                largest = max(largest, size)
        if largest <= SMALL * np.abs(force).max(initial=0.0):
            break
    return force


def _on_cone(force: np.ndarray, mu: float) -> np.ndarray:
    """(3,) the nearest force with |f_t| <= mu f_n."""
    normal, tangential = force[0], float(np.hypot(force[1], force[2]))
    if tangential <= mu * normal:
        return force
    if mu * tangential <= -normal:
        return np.zeros(3)
    pressed = (normal + mu * tangential) / (1 + mu**2)
    return np.array([pressed, *(mu * pressed / tangential * force[1:])])
