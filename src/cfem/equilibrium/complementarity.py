"""Multipliers of rows some of which can only pull, on the compliance of all of them: an exact active set.

A unilateral row holds its displacement with a multiplier mu >= 0, or has none and is beyond its target:

    gap >= 0,    mu >= 0,    gap mu = 0,    gap = C delta - target

With the compliance S of the rows, a change of the multipliers changes the gaps by S dmu: Signorini's problem on a given
matrix (`cfem.contact`), solved anew in every correction of Newton's method (Josephy, *Newton's method for generalized
equations*, 1979). No multiplier is negative on the way, and no set of rows that hold has to be guessed before. On a
positive definite compliance exactly one answer exists (Cottle, Pang, Stone, *The linear complementarity problem*, 1992,
theorem 3.1.6), so that only a tangent with negative eigenvalues leaves none."""

import numpy as np

from cfem.contact.law.newton import normal_forces

# Condition of the held rows' compliance, each row scaled to one, beyond which they are the same row to rounding.
_DEPENDENT = 1e13
_SOFT = 1e-12  # of a row's compliance: what makes that of rows that are alike definite, to choose among them


class NoActiveSetError(np.linalg.LinAlgError):
    """No choice of rows that hold was found in which none pushes and none lacks anything."""


def change(
    S: np.ndarray, gap: np.ndarray, mu: np.ndarray, unilateral: np.ndarray, held: np.ndarray, slop: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Change of the multipliers mu (m,) and the rows that hold after it, (m,) bool. Rows that just touch, without a
    multiplier, hold. Raises LinAlgError where rows that hold depend on each other, NoActiveSetError.

    S: (m, m) compliance of the rows
    gap: (m,) where the multipliers stay as they are
    held: the rows that are tried first, and kept where they solve the problem
    slop: (m,) size of gaps that are none"""
    if _solves(S, gap, mu, unilateral, held, slop):
        return _with(S, gap, mu, held), held
    held = _active(S, gap - S @ mu, unilateral, slop)
    return _with(S, gap, mu, held), held


def _solves(
    S: np.ndarray, gap: np.ndarray, mu: np.ndarray, unilateral: np.ndarray, held: np.ndarray, slop: np.ndarray
) -> bool:
    """True where nothing pushes and nothing lacks with the rows `held`."""
    if not unilateral.any():
        return True
    try:
        dmu = _with(S, gap, mu, held)
    except np.linalg.LinAlgError:
        return False
    pushes = unilateral & (mu + dmu < -slop / np.maximum(np.abs(np.diag(S)), np.finfo(float).tiny))
    lacks = ~held & (gap + S @ dmu < -slop)
    return not (pushes | lacks).any()


def _with(S: np.ndarray, gap: np.ndarray, mu: np.ndarray, held: np.ndarray) -> np.ndarray:
    """The change with which the rows `held` close and the others carry nothing."""
    dmu, among = np.where(held, 0.0, -mu), S[np.ix_(held, held)]
    size = np.sqrt(np.abs(np.diag(among)))
    if not (size > 0).all() or (len(among) and np.linalg.cond(among / np.outer(size, size)) > _DEPENDENT):
        raise np.linalg.LinAlgError("rows of the actuation depend on each other")
    dmu[held] = np.linalg.solve(among, -(gap + S @ dmu)[held])
    return dmu


def _active(S: np.ndarray, gap: np.ndarray, unilateral: np.ndarray, slop: np.ndarray) -> np.ndarray:
    """Mask (m,) of the rows that hold; gap: without any multiplier. Rows are scaled to a compliance of one, so that
    those of cables and chambers compare."""
    size = np.sqrt(np.maximum(np.abs(np.diag(S)), np.finfo(float).tiny))
    S, gap, slop = S / np.outer(size, size), gap / size, slop / size
    bilateral = ~unilateral
    relief = np.linalg.solve(S[np.ix_(bilateral, bilateral)], np.column_stack([S[bilateral], gap[bilateral]]))
    left = np.column_stack([S[unilateral], gap[unilateral]]) - S[np.ix_(unilateral, bilateral)] @ relief
    compliance, free = left[:, :-1][:, unilateral], left[:, -1]
    W, distance = np.zeros((3 * len(free), 3 * len(free))), np.zeros(3 * len(free))
    W[::3, ::3] = (compliance + compliance.T) / 2 + _SOFT * np.eye(len(free))  # points without friction
    distance[::3] = free
    forces = normal_forces(W, distance)
    if forces is None:
        raise NoActiveSetError("no rows that hold solve the problem")
    held = bilateral.copy()
    held[unilateral] = (forces[:, 0] > 0) | (free + compliance @ forces[:, 0] <= slop[unilateral])
    return held
