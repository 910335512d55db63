"""How forces on neighbouring nodes of a surface dent it together.

C (3 c, 3 c) mm/N is the compliance of c nodes and D its change with forces f (3 c,) N on them. The places
C f + D[f, f] / 2 leave out much where several nodes are pressed: as each of them is dented by the others, it gives way.
The forces that would make its displacement without dents are g = f + h. So the energy of the forces is the stationary
value of

    f . C f / 2 - h . C h / 2 + D[g, g, g] / 6        places C f + D[g, g] / 2

over h at the nodes that have been pressed. Without h this is the second order. With h at all nodes it is the body whose
energy is cubic in the displacements. Newton's method finds h on the branch that begins without forces. Where a surface
softens so far that it carries no more, D is halved."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numba import njit
from scipy.linalg.lapack import dpotrf, dpotrs, dtrtrs

ITERATIONS, EXACT = 30, 1e-8  # of Newton's method; last step, relative to the forces: the error is its square
HALVINGS = 3  # of D, before it is left out


class JointDents(NamedTuple):
    """Dents of c nodes.

    triples (t, 3): nodes i <= j <= k, each triple once
    change (t, 3, 3, 3) mm/N^2: of the compliance of i and j with a force on k"""

    triples: np.ndarray
    change: np.ndarray


@dataclass(frozen=True)
class DentedPlaces:
    """What forces do by dents.

    places: (c, 3) mm beyond C f
    energy: N mm, stored beyond f . C f / 2
    share: of D that is taken
    change: (3 c, 3 c) mm/N of C, without what gives way
    mine: (p,) entries that give way, and factor (p, p): the lower Cholesky factor of what they yield then"""

    places: np.ndarray
    energy: float
    share: float
    change: np.ndarray
    mine: np.ndarray
    factor: np.ndarray

    @cached_property
    def slopes(self) -> np.ndarray:
        """(3 c, 3 c) mm/N: derivative of `places` by the forces, symmetric."""
        slopes = self.change
        if len(self.mine):
            half = dtrtrs(self.factor, slopes[self.mine], lower=1)[0]
            slopes = slopes + half.T @ half
        return (slopes + slopes.T) / 2


def dented_places(forces: np.ndarray, C: np.ndarray, dents: JointDents, pressed: np.ndarray) -> DentedPlaces:
    """Places under forces (c, 3) N; pressed (c,) bool: nodes that give way."""
    bear = np.flatnonzero(pressed | forces.any(axis=1))  # the others are moved, but neither bear forces nor give way
    rows, place = (3 * bear[:, None] + np.arange(3)).ravel(), np.full(len(forces), -1)
    place[bear] = np.arange(len(bear))
    f, among = forces.ravel(), JointDents(*_among(place, *dents))
    mine, share = np.flatnonzero(np.repeat(pressed[bear], 3)), 1.0
    C_pp = C[np.ix_(rows[mine], rows[mine])]
    for _ in range(1 + HALVINGS):
        given = _given_way(f[rows], C_pp, among, mine, share)
        if given is not None:
            h, g = given[0], f.copy()
            g[rows[mine]] += h
            change = share * changed(g, *dents)
            moved = change @ g
            energy = f @ moved / 2 - g @ moved / 6 + h @ C_pp @ h / 2
            return DentedPlaces((moved / 2).reshape(-1, 3), float(energy), share, change, rows[mine], given[1])
        share /= 2
    nothing = np.zeros(0, dtype=np.int64)
    return DentedPlaces(np.zeros(forces.shape), 0.0, 0.0, np.zeros(C.shape), nothing, np.zeros((0, 0)))


def _given_way(
    f: np.ndarray, C_pp: np.ndarray, dents: JointDents, mine: np.ndarray, share: float
) -> tuple[np.ndarray, np.ndarray] | None:
    """h (p,) N at the entries `mine` of f, and the factor of C - D[f + h] there; None where Newton's method leaves the
    stable branch. One factorisation a step."""
    g, h, size, block = f.copy(), np.zeros(len(mine)), np.abs(f).max(), np.ix_(mine, mine)
    if not len(mine):
        return h, np.zeros((0, 0))
    for _ in range(ITERATIONS):
        change = share * changed(g, *dents)
        factor, failed = dpotrf(C_pp - change[block], lower=1, clean=1)
        if failed:
            return None
        step = dpotrs(factor, (change @ g / 2)[mine] - C_pp @ h, lower=1)[0]
        h += step
        g[mine] += step
        if np.abs(step).max(initial=0.0) <= EXACT * size:
            return h, factor
    return None


@njit(cache=True, error_model="numpy")
def changed(forces, triples, change):
    """D[forces] (3 c, 3 c) mm/N; forces (3 c,) N, and the two fields of `JointDents`. Of blocks of two nodes the later
    ones mirror the others."""
    bent, c = np.zeros((len(forces), len(forces))), len(forces) // 3
    loaded = np.zeros(c, dtype=np.bool_)
    for row in range(len(forces)):
        loaded[row // 3] |= forces[row] != 0.0
    for t in range(len(triples)):
        i, j, k = triples[t]
        if not (loaded[i] or loaded[j] or loaded[k]):
            continue
        for a in range(3):
            for b in range(3):
                x, y, sum_k = 3 * i + a, 3 * j + b, 0.0
                by_x, by_y = (forces[x] if i != j else 0.0), (forces[y] if j != k else 0.0)
                for d in range(3):
                    value, z = change[t, a, b, d], 3 * k + d
                    sum_k += value * forces[z]
                    bent[y, z] += value * by_x
                    bent[x, z] += value * by_y
                bent[x, y] += sum_k
    for row in range(len(forces)):
        for column in range(3 * (row // 3)):
            bent[row, column] = bent[column, row]
    return bent


@njit(cache=True, error_model="numpy")
def _among(place, triples, change):
    """Those of both fields of `JointDents` whose three nodes have a `place` (c,), by their places."""
    count, n = 0, 0
    for t in range(len(triples)):
        count += place[triples[t, 0]] >= 0 and place[triples[t, 1]] >= 0 and place[triples[t, 2]] >= 0
    chosen, some = np.empty((count, 3), dtype=np.int64), np.empty((count, 3, 3, 3))
    for t in range(len(triples)):
        i, j, k = place[triples[t, 0]], place[triples[t, 1]], place[triples[t, 2]]
        if i >= 0 and j >= 0 and k >= 0:
            chosen[n], some[n] = (i, j, k), change[t]
            n += 1
    return chosen, some
