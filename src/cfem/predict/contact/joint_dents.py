"""How forces on neighbouring nodes of a surface dent it together.

C (3 c, 3 c) mm/N is the compliance of c nodes and D its change with forces f (3 c,) N on them. The places
C f + D[f, f] / 2 leave out much where several nodes are pressed: as each of them is dented by the others, it gives way.
The forces that would make its displacement without dents are g = f + h. So the energy of the forces is the stationary
value of

    f . C f / 2 - h . C h / 2 + D[g, g, g] / 6        places C f + D[g, g] / 2

over h at the nodes that have been pressed. Without h this is the second order. With h at all nodes it is the body whose
energy is cubic in the displacements. Newton's method finds h on the branch that begins without forces. Where a surface
softens so far that it carries no more, D is halved."""

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


def dented_places(forces: np.ndarray, C: np.ndarray, dents: JointDents, pressed: np.ndarray) -> DentedPlaces:
    """Places under forces (c, 3) N; pressed (c,) bool: nodes that give way."""
    f, mine, share = forces.ravel(), np.flatnonzero(np.repeat(pressed, 3)), 1.0
    C_pp = C[np.ix_(mine, mine)]
    for _ in range(1 + HALVINGS):
        h = _given_way(f, C_pp, dents, mine, share)
        if h is not None:
            g = f + h
            change = share * changed(g, *dents)
            across = change[mine]
            slopes = change + across.T @ cho_solve(cho_factor(C_pp - across[:, mine]), across)
            energy = (f / 2 - g / 6) @ change @ g + h @ C @ h / 2
            return DentedPlaces((change @ g / 2).reshape(-1, 3), (slopes + slopes.T) / 2, float(energy), share)
        share /= 2
    return DentedPlaces(np.zeros(forces.shape), np.zeros(C.shape), 0.0, 0.0)


def _given_way(f: np.ndarray, C_pp: np.ndarray, dents: JointDents, mine: np.ndarray, share: float) -> np.ndarray | None:
    """h (3 c,) N, which has entries `mine` alone; None where Newton's method leaves the stable branch."""
    h = np.zeros_like(f)
    for _ in range(ITERATIONS):
        change = share * changed(f + h, *dents)
        by_dents = (change @ (f + h) / 2)[mine]
        try:
            step = cho_solve(cho_factor(C_pp - change[np.ix_(mine, mine)]), by_dents - C_pp @ h[mine])
        except np.linalg.LinAlgError:
            return None
        h[mine] += step
        if np.abs(step).max(initial=0.0) <= EXACT * np.abs(f).max():
            return h
    return None


@njit(cache=True, error_model="numpy")
def changed(forces, triples, change):
    """D[forces] (3 c, 3 c) mm/N; forces (3 c,) N, and the two fields of `JointDents`."""
    bent, loaded = np.zeros((len(forces), len(forces))), np.zeros(len(forces) // 3, dtype=np.bool_)
    for row in range(len(forces)):
        loaded[row // 3] |= forces[row] != 0.0
    for t in range(len(triples)):
        i, j, k = triples[t]
        if not (loaded[i] or loaded[j] or loaded[k]):
            continue
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
