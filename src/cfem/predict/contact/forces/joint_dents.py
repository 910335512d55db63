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


class DentedPlaces(NamedTuple):
    """What forces do by dents.

    places: (c, 3) mm beyond C f
    energy: N mm, stored beyond f . C f / 2
    share: of D that is taken
    change: (3 c, 3 c) mm/N of C, without what gives way
    mine: (p,) entries that give way, h (p,) N there, and factor (p, p): the upper Cholesky factor of what they yield
    systems: factorisations that it took"""

    places: np.ndarray
    energy: float
    share: float
    change: np.ndarray
    mine: np.ndarray
    h: np.ndarray
    factor: np.ndarray
    systems: int


@njit(cache=True, error_model="numpy")
def dented_places(forces, C, triples, change, pressed, start):
    """`DentedPlaces` under forces (c, 3) N of nodes with compliance C (3 c, 3 c) mm/N and the fields of `JointDents`;
    pressed (c,) bool: nodes that give way. start (p,): h of the same nodes under other forces that took all of D, from
    which the search begins, or of another size: from 0. Where C - D[g] is positive definite there is one h at most."""
    c, b, p = len(forces), 0, 0
    place, f = np.full(c, -1), forces.copy().reshape(-1)
    for i in range(c):  # the others are moved, but neither bear forces nor give way
        if pressed[i] or forces[i, 0] != 0.0 or forces[i, 1] != 0.0 or forces[i, 2] != 0.0:
            place[i] = b
            b += 1
            p += 3 * pressed[i]
    borne, mine, among, n = np.empty(3 * b), np.empty(p, dtype=np.int64), np.empty(p, dtype=np.int64), 0
    for i in range(c):
        for a in range(3):
            if place[i] >= 0:
                borne[3 * place[i] + a] = forces[i, a]
            if pressed[i]:
                mine[n], among[n] = 3 * i + a, 3 * place[i] + a
                n += 1
    C_pp, h, factor = np.empty((p, p)), np.zeros(p), np.zeros((p, p))
    for i in range(p):
        for j in range(p):
            C_pp[i, j] = C[mine[i], mine[j]]
    some, some_change = _among(place, triples, change)
    share, systems, begin = 1.0, 0, 1
    if len(start) == p > 0:
        begin = 0
        for i in range(p):  # by a loop: a copy of an array takes seconds to compile
            h[i] = start[i]
    for trial in range(begin, 2 + HALVINGS):
        stable, steps = _give_way(borne, C_pp, some, some_change, among, share, h, factor)
        systems += steps
        if not stable:
            share /= 1.0 if trial == 0 else 2.0
            h[:] = 0.0
            continue
        g, moved, energy = f.copy(), np.zeros(3 * c), 0.0
        for i in range(p):
            g[mine[i]] += h[i]
        bent = changed(g, triples, change)
        for i in range(3 * c):
            for j in range(3 * c):
                bent[i, j] *= share
                moved[i] += bent[i, j] * g[j]
            energy += f[i] * moved[i] / 2 - g[i] * moved[i] / 6
            moved[i] /= 2
        for i in range(p):
            for j in range(p):
                energy += h[i] * C_pp[i, j] * h[j] / 2
        return DentedPlaces(moved.reshape(c, 3), energy, share, bent, mine, h, factor, systems)
    nothing, none = np.empty(0, dtype=np.int64), np.zeros((0, 0))
    return DentedPlaces(np.zeros((c, 3)), 0.0, 0.0, np.zeros((3 * c, 3 * c)), nothing, np.zeros(0), none, systems)


@njit(cache=True, error_model="numpy")
def _give_way(f, C_pp, triples, change, mine, share, h, factor):
    """Finds h (p,) N at the entries `mine` of f, from what it is, and the factor of C - D[f + h] there. Returns False
    where Newton's method leaves the stable branch, and the factorisations: one a step."""
    p, size, g, step = len(mine), 0.0, f.copy(), np.empty(len(mine))
    for i in range(p):
        g[mine[i]] += h[i]
    for force in f:
        size = max(size, abs(force))
    if not p:
        return True, 0
    for iteration in range(1, ITERATIONS + 1):
        bent, largest = changed(g, triples, change), 0.0
        for i in range(p):
            step[i] = 0.0
            for j in range(len(g)):
                step[i] += share * bent[mine[i], j] * g[j] / 2
            for j in range(p):
                step[i] -= C_pp[i, j] * h[j]
                factor[i, j] = C_pp[i, j] - share * bent[mine[i], mine[j]]
        if not factorise(factor):
            return False, iteration
        _forwards(factor, step.reshape(-1, 1))
        for i in range(p - 1, -1, -1):
            for j in range(i + 1, p):
                step[i] -= factor[i, j] * step[j]
            step[i] /= factor[i, i]
        for i in range(p):
            h[i] += step[i]
            g[mine[i]] += step[i]
            largest = max(largest, abs(step[i]))
        if largest <= EXACT * size:
            return True, iteration
    return False, ITERATIONS


@njit(cache=True, error_model="numpy")
def factorise(A):
    """Puts the Cholesky factor U, A = U^T U, into the upper half of A. False where A is not positive definite."""
    for i in range(len(A)):
        if not A[i, i] > 0:
            return False
        A[i, i] = np.sqrt(A[i, i])
        for j in range(i + 1, len(A)):
            A[i, j] /= A[i, i]
        for r in range(i + 1, len(A)):
            share = A[i, r]
            for j in range(r, len(A)):
                A[r, j] -= share * A[i, j]
    return True


@njit(cache=True, error_model="numpy")
def _forwards(factor, by):
    """U^-T by (p, n), in place."""
    for i in range(len(by)):
        for r in range(i):
            share = factor[r, i]
            for j in range(by.shape[1]):
                by[i, j] -= share * by[r, j]
        for j in range(by.shape[1]):
            by[i, j] /= factor[i, i]


@njit(cache=True, error_model="numpy")
def dent_slopes(change, mine, factor):
    """(3 c, 3 c) mm/N: derivative of the places by the forces, symmetric; of fields of `DentedPlaces`."""
    half, slopes = np.empty((len(mine), len(change))), np.empty((len(change), len(change)))
    for r in range(len(mine)):
        for j in range(len(change)):
            half[r, j] = change[mine[r], j]
    _forwards(factor, half)
    for i in range(len(change)):
        for j in range(i, len(change)):
            slopes[i, j] = (change[i, j] + change[j, i]) / 2
        for r in range(len(mine)):
            share = half[r, i]
            for j in range(i, len(change)):
                slopes[i, j] += share * half[r, j]
        for j in range(i + 1, len(change)):
            slopes[j, i] = slopes[i, j]
    return slopes


@njit(cache=True, error_model="numpy")
def changed(forces, triples, change):
    """D[forces] (3 c, 3 c) mm/N; forces (3 c,) N, and the two fields of `JointDents`. Of blocks of two nodes the later
    ones mirror the others."""
    bent, c = np.zeros((len(forces), len(forces))), len(forces) // 3
    loaded = np.zeros(c, dtype=np.bool_)
    for row in range(len(forces)):
        loaded[row // 3] |= forces[row] != 0.0
    for t in range(len(triples)):
        i, j, k = triples[t, 0], triples[t, 1], triples[t, 2]
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
    for t in range(len(triples)):  # by loops: whole arrays take seconds to compile
        if place[triples[t, 0]] < 0 or place[triples[t, 1]] < 0 or place[triples[t, 2]] < 0:
            continue
        for a in range(3):
            chosen[n, a] = place[triples[t, a]]
            for b in range(3):
                for d in range(3):
                    some[n, a, b, d] = change[t, a, b, d]
        n += 1
    return chosen, some
