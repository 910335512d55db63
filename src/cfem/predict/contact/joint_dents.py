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
    mine, f, share = np.flatnonzero(np.repeat(pressed, 3)), np.ascontiguousarray(forces, float).ravel(), 1.0
    for _ in range(1 + HALVINGS):
        stable, places, slopes, energy = _dented(f, C, *dents, mine, share)
        if stable:
            return DentedPlaces(places.reshape(-1, 3), (slopes + slopes.T) / 2, energy, share)
        share /= 2
    return DentedPlaces(np.zeros(forces.shape), np.zeros(C.shape), 0.0, 0.0)


@njit(cache=True, error_model="numpy")
def _dented(f, C, triples, change, mine, share):
    """Whether Newton's method stays on the stable branch, with h (3 c,) N at entries `mine` (p,) alone, and fields of
    `DentedPlaces` there; forces f (3 c,) N."""
    n, p = len(f), len(mine)  # by loops: whole arrays take seconds to compile
    g, places, slopes, energy = f.copy(), np.zeros(n), np.zeros((n, n)), 0.0
    L, step, largest = np.empty((p, p)), np.empty(p), 0.0
    for i in range(n):
        largest = max(largest, abs(f[i]))
    for _ in range(ITERATIONS):
        slopes, last = changed(g, triples, change), 0.0
        for a in range(p):
            step[a] = 0.0
            for j in range(n):
                step[a] += share * slopes[mine[a], j] * g[j] / 2
            for b in range(p):
                L[a, b] = C[mine[a], mine[b]] - share * slopes[mine[a], mine[b]]
                step[a] -= C[mine[a], mine[b]] * (g[mine[b]] - f[mine[b]])
        if not _factored(L):
            return False, places, slopes, energy
        _solve(L, step)
        for a in range(p):
            g[mine[a]] += step[a]
            last = max(last, abs(step[a]))
        if last <= EXACT * largest:
            break
    else:
        return False, places, slopes, energy
    slopes, by_given = changed(g, triples, change), np.empty((n, p))
    for i in range(n):
        for j in range(n):
            slopes[i, j] *= share
            places[i] += slopes[i, j] * g[j] / 2
        energy += (f[i] - g[i] / 3) * places[i]
    for a in range(p):
        for b in range(p):
            L[a, b] = C[mine[a], mine[b]] - slopes[mine[a], mine[b]]
            energy += (g[mine[a]] - f[mine[a]]) * C[mine[a], mine[b]] * (g[mine[b]] - f[mine[b]]) / 2
    if not _factored(L):
        return False, places, slopes, energy
    for i in range(n):  # the root of across^T (C - across)^-1 across
        for a in range(p):
            by_given[i, a] = slopes[mine[a], i]
            for b in range(a):
                by_given[i, a] -= L[a, b] * by_given[i, b]
            by_given[i, a] /= L[a, a]
    for i in range(n):
        for j in range(n):
            for a in range(p):
                slopes[i, j] += by_given[i, a] * by_given[j, a]
    return True, places, slopes, energy


@njit(cache=True, error_model="numpy")
def _factored(A):
    """Cholesky's factor of A in place of its lower half. False where it is not positive definite."""
    for i in range(len(A)):
        for j in range(i + 1):
            value = A[i, j]
            for k in range(j):
                value -= A[i, k] * A[j, k]
            if i > j:
                A[i, j] = value / A[j, j]
            elif value > 0:
                A[i, i] = np.sqrt(value)
            else:
                return False
    return True


@njit(cache=True, error_model="numpy")
def _solve(L, x):
    """Solves L L^T x = b, b (n,) in place."""
    for i in range(len(x)):
        for k in range(i):
            x[i] -= L[i, k] * x[k]
        x[i] /= L[i, i]
    for i in range(len(x) - 1, -1, -1):
        for k in range(i + 1, len(x)):
            x[i] -= L[k, i] * x[k]
        x[i] /= L[i, i]


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
