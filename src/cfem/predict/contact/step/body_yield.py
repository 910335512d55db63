"""How pairs yield as contact moves the rigid bodies that they are on, exactly to the first order: with forces that
change, with the levers of the forces that there are, and with forces of obstacles that turn with these.

Pairs (p) whose forces change by dp, on known patches (c), of which some are near obstacles (d), move the bodies by xi:

    F = B^T dp + E T xi                         on the known patches, before forces turn with the places
    x = C F + L xi                              how these go
    xi = Y (G^T dp + G_n^T (T xi + P F) + H x)

B says how pairs depend on patches, and E which patches are near. C and P are of
`cfem.contact.patch_forces.TurningCompliance`. G, G_n and L are levers of the pairs, of the first d of these, which are
with obstacles, and of the patches. H is the change of the wrench by levers that change, T that of the forces by the
bodies: those that slide turn with their obstacles, and as they move past a curved surface."""

from dataclasses import dataclass

import numpy as np
from numba import njit

from cfem.contact.law.newton import eliminate
from cfem.contact.rigid_bodies import add_lever


@dataclass(frozen=True, eq=False)
class BodyYield:
    """mobility: (3 p, 3 p) mm/N by which pairs yield beside what their patches do, None: no body moves
    turning: (3 d, 3 p) change of the forces of obstacles, as they turn, by those of the pairs; None: none turns"""

    mobility: np.ndarray | None
    turning: np.ndarray | None


@njit(cache=True, error_model="numpy")
def moved_bodies(levers, Y, compliance, turning):
    """G xi (3 p, 3 p) and T xi (3 d, 3 p) by the pairs' forces; False where bodies have no such motion.

    levers: G, L, H and T (`levers`)
    Y: (6 b, 6 b)
    compliance: (3 c, 3 p), C B^T
    turning: (3 d, 3 p), E^T P B^T, or of size 0 where no force turns with its place"""
    G, L, H, T = levers
    near = len(T)
    wrench, change = _product(H, compliance), _product(H, L)
    if len(turning):
        _add(wrench, _product(G[:near].T, turning))
    _add(wrench, G.T)
    if T.any():
        _add(change, _product(wrench[:, :near], T))
    left, xi = _product(Y, change), _product(Y, wrench)
    for i in range(len(left)):
        for j in range(len(left)):
            left[i, j] = (1.0 if i == j else 0.0) - left[i, j]
    sound = eliminate(left, xi)
    return _product(G, xi), _product(T, xi), sound


@njit(cache=True, error_model="numpy")
def levers(places, near, at, which, known, soft, forces, push, slides, bends, of_robots, bodies, of_obstacles, centres):
    """G (3 p, 6 b), L (3 c, 6 b), H (6 b, 3 c) and T (3 d, 6 b) of patches near (d,) obstacles `which` (N,), which are
    at `at` (d,) among known (c,) ones, and then of pairs of soft surfaces, soft (q, c).

    Of all patches: places (N, 3) mm and push (N, 3) N of obstacles; forces (c, 3) N: all on known ones; slides (d,)
    bool: patches whose forces turn; bends (d, 3, 3) N/mm: their change with the place, of size 0 without; of_robots
    (r,), bodies (N,), of_obstacles (n,) and centres (b, 3) mm: of `Bodies` and `RigidBodies`"""
    d, c, columns = len(near), len(known), 6 * len(centres)
    G, L = np.zeros((3 * (d + len(soft)), columns)), np.zeros((3 * c, columns))
    H, T = np.zeros((columns, 3 * c)), np.zeros((3 * d, columns))
    for i in range(c):
        body = of_robots[bodies[known[i]]]
        add_lever(L[3 * i : 3 * i + 3], body, places[known[i]], centres, 1.0)
        _add_cross(H[:, 3 * i : 3 * i + 3], body, forces[i], -1.0)
    for i in range(d):
        first, body = 3 * at[i], of_obstacles[which[near[i]]]
        for a in range(3):
            for b in range(columns):
                G[3 * i + a, b] = L[first + a, b]
        add_lever(G[3 * i : 3 * i + 3], body, places[near[i]], centres, -1.0)
        _add_cross(H[:, first : first + 3], body, push[near[i]], 1.0)
        if slides[i]:
            _add_cross(T[3 * i : 3 * i + 3].T, body, push[near[i]], 1.0)
        for a in range(3 if len(bends) else 0):
            for e in range(3):
                for b in range(columns):
                    T[3 * i + a, b] += bends[i, a, e] * G[3 * i + e, b]
    for pair in range(len(soft)):
        for i in range(c):
            if soft[pair, i] != 0.0:
                for a in range(3):
                    for b in range(columns):
                        G[3 * (d + pair) + a, b] += soft[pair, i] * L[3 * i + a, b]
    return G, L, H, T


@njit(cache=True, error_model="numpy")
def _add_cross(torques, body, force, sign):
    """Adds to torques (6 b, 3) on a body a share of the cross product of a force with what they are by; nothing where
    body is -1."""
    if body < 0:
        return
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        torques[6 * body + 3 + a, c] += sign * force[b]
        torques[6 * body + 3 + a, b] -= sign * force[c]


@njit(cache=True, error_model="numpy")
def _product(A, B):
    product = np.zeros((len(A), B.shape[1]))
    for i in range(len(A)):
        for k in range(len(B)):
            share = A[i, k]
            if share != 0.0:
                for j in range(B.shape[1]):
                    product[i, j] += share * B[k, j]
    return product


@njit(cache=True, error_model="numpy")
def _add(into, matrix):
    for i in range(len(into)):
        for j in range(into.shape[1]):
            into[i, j] += matrix[i, j]
