"""How forces on neighbouring nodes of a surface dent it together.

C (3 c, 3 c) mm/N is the compliance of c nodes and D its change with forces f (c, 3) N on them. The places
C f + D[f, f] / 2 leave out much where several nodes are pressed. So the energy is taken as cubic in the displacements
u, which gives the same two orders, and of the higher ones how each node yields to the dents of the others:

    u = C g        C f = C g - D[g, g] / 2        energy g . C g / 2 - D[g, g, g] / 6

g are the forces that would make u without dents. Newton's method finds them on the branch that begins without forces.
Where a surface softens so far that it carries no more, D is halved."""

from typing import NamedTuple

import numpy as np
from numba import njit
from scipy.linalg import cho_factor, cho_solve

ITERATIONS, EXACT = 30, 1e-8  # of Newton's method; last step, relative to the forces: the error is its square
HALVINGS = 3  # of D, before it is left out


class JointDents(NamedTuple):
    """Dents of c nodes.

    triples (t, 3): nodes i <= j <= k, each triple once
    change (t, 3, 3, 3) mm/N^2: of the compliance of i and j with a force on k"""

    triples: np.ndarray
    change: np.ndarray


class DentedPlaces(NamedTuple):
    """What forces do by dents.

    places (c, 3) mm: beyond C f
    slopes (3 c, 3 c) mm/N: derivative of `places` by the forces, symmetric
    energy N mm: stored beyond f . C f / 2
    share: of D that is taken"""

    places: np.ndarray
    slopes: np.ndarray
    energy: float
    share: float


def dented_places(forces: np.ndarray, C: np.ndarray, dents: JointDents) -> DentedPlaces:
    """Places under forces (c, 3) N."""
    f, share = forces.ravel(), 1.0
    for _ in range(1 + HALVINGS):
        g = _undented(f, C, dents, share)
        if g is not None:
            change = share * changed(g, *dents)
            slopes = C @ cho_solve(cho_factor(C - change), C) - C
            energy = g @ (C / 2 - change / 6) @ g - f @ C @ f / 2
            return DentedPlaces((change @ g / 2).reshape(-1, 3), (slopes + slopes.T) / 2, float(energy), share)
        share /= 2
    return DentedPlaces(np.zeros(forces.shape), np.zeros(C.shape), 0.0, 0.0)


def _undented(f: np.ndarray, C: np.ndarray, dents: JointDents, share: float) -> np.ndarray | None:
    """g (3 c,) N, None where Newton's method leaves the stable branch."""
    g, without = f.copy(), C @ f
    for _ in range(ITERATIONS):
        change = share * changed(g, *dents)
        try:
            step = cho_solve(cho_factor(C - change), without + (change / 2 - C) @ g)
        except np.linalg.LinAlgError:
            return None
        g += step
        if np.abs(step).max() <= EXACT * np.abs(f).max():
            return g
    return None


@njit(cache=True, error_model="numpy")
def changed(forces, triples, change):
    """D[forces] (3 c, 3 c) mm/N; forces (3 c,) N, and the two fields of `JointDents`."""
    bent = np.zeros((len(forces), len(forces)))
    for t in range(len(triples)):
        i, j, k = triples[t]
        for a in range(3):
            for b in range(3):
                for d in range(3):
                    value, x, y, z = change[t, a, b, d], 3 * i + a, 3 * j + b, 3 * k + d
                    bent[x, y] += value * forces[z]
                    if i != j:
                        bent[y, x] += value * forces[z]
                        bent[y, z] += value * forces[x]
                    if j != k:
                        bent[x, z] += value * forces[y]
                        bent[z, x] += value * forces[y]
                    if i != j and j != k:
                        bent[z, y] += value * forces[x]
    return bent
