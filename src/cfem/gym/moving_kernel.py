"""Many robots that move, one step in time of all of them: compiled loops over lanes, a robot in each.

The step is that of `cfem.motion.step`, the implicit midpoint rule with the learned functions expanded about the middle
that is expected, in coordinates q / scale, where M = R R and the loss forms are S S with learned symmetric R and S.
Robots differ in stiffness and viscosity. Where displacements are commanded of cables that only pull, each is held and
pulls or is slack and longer than commanded; which, is found by trying."""

from typing import NamedTuple

import numpy as np
from numba import njit

from cfem.gym.lanes import LANES, LaneSeries, Sums, add_up, fill_basis, room_of

FAST = {"contract", "reassoc", "nsz", "arcp"}  # a number that is none stays none


class LearnedMotion(NamedTuple):
    """Motion of one model, in coordinates q / scale.

    forces: series of grad Psi and of its Hessian (packed)
    inertia: series of R, of its slopes by each actuator, and of S of each loss form, packed triangles
    relaxation: (losses,) s
    kappa: (n_r,) stiffness of the inner motions
    n_q: coordinates
    smallest: velocity, times s, below which no digits count"""

    forces: LaneSeries
    inertia: LaneSeries
    relaxation: np.ndarray
    kappa: np.ndarray
    n_q: int
    smallest: float


class Lanes(NamedTuple):
    """States of LANES robots.

    q, p, v, gain: (n_q, LANES) as of `cfem.motion.step.CondensedMotion`
    command: (n_a, LANES) forces during the step or displacements at its end
    lam: (n_a, LANES) forces in it
    held: (n_a, LANES) 1 where an actuator stands at its command
    stiffness, viscosity: (LANES,) times those of the model"""

    q: np.ndarray
    p: np.ndarray
    v: np.ndarray
    gain: np.ndarray
    command: np.ndarray
    lam: np.ndarray
    held: np.ndarray
    stiffness: np.ndarray
    viscosity: np.ndarray


class Room(NamedTuple):
    """Arrays that a step works with.

    about: (n_a, LANES)
    forces, inertia: series there
    M, drag, fixed, A: (n_q, n_q, LANES), mass, slope of the viscous force by velocity, slope of the equations but for
        the turning, a matrix to eliminate
    turning: (n_a, n_q, LANES)
    new: (n_q, LANES) velocity that is sought
    rest, Mv, force, work, product, change: alike"""

    about: np.ndarray
    forces: Sums
    inertia: Sums
    M: np.ndarray
    drag: np.ndarray
    fixed: np.ndarray
    A: np.ndarray
    turning: np.ndarray
    new: np.ndarray
    rest: np.ndarray
    Mv: np.ndarray
    force: np.ndarray
    work: np.ndarray
    product: np.ndarray
    change: np.ndarray


@njit(cache=True, no_cpython_wrapper=True, no_cfunc_wrapper=True, error_model="numpy")
def room_for(learned, n_a):
    n = learned.n_q
    return Room(
        np.empty((n_a, LANES)), room_of(learned.forces, n_a), room_of(learned.inertia, n_a),
        np.empty((n, n, LANES)), np.empty((n, n, LANES)), np.empty((n, n, LANES)), np.empty((n, n, LANES)),
        np.empty((n_a, n, LANES)), np.empty((n, LANES)), np.empty((n, LANES)), np.empty((n, LANES)),
        np.empty((n, LANES)), np.empty((n, LANES)), np.empty((n, LANES)), np.empty((n, LANES)),
    )  # fmt: skip


@njit(cache=True, no_cpython_wrapper=True, no_cfunc_wrapper=True, fastmath=FAST, error_model="numpy")
def _times(S, first, x, factor, out):
    """Adds factor S x to out (n, LANES), S a packed triangle that begins at row `first`."""
    n, place = x.shape[0], first
    for i in range(n):
        for b in range(LANES):
            out[i, b] += factor * S[place, b] * x[i, b]
        place += 1
        for j in range(i + 1, n):
            for b in range(LANES):
                value = factor * S[place, b]
                out[i, b] += value * x[j, b]
                out[j, b] += value * x[i, b]
            place += 1


@njit(cache=True, no_cpython_wrapper=True, no_cfunc_wrapper=True, error_model="numpy")
def _place(n, i, j):
    """Position of (i, j) in a packed triangle."""
    i, j = min(i, j), max(i, j)
    return i * n - i * (i - 1) // 2 + j - i


@njit(cache=True, no_cpython_wrapper=True, no_cfunc_wrapper=True, fastmath=FAST, error_model="numpy")
def _add_square(S, first, factor, out):
    """Adds factor (LANES,) S S to out (n, n, LANES), S a packed triangle that begins at row `first`."""
    n = out.shape[0]
    value = np.empty(LANES)
    for i in range(n):
        for j in range(i, n):
            for b in range(LANES):
                value[b] = 0.0
            for k in range(n):
                left, right = first + _place(n, i, k), first + _place(n, k, j)
                for b in range(LANES):
                    value[b] += S[left, b] * S[right, b]
            for b in range(LANES):
                out[i, j, b] += factor[b] * value[b]
            if j > i:
                for b in range(LANES):
                    out[j, i, b] = out[i, j, b]


@njit(cache=True, no_cpython_wrapper=True, no_cfunc_wrapper=True, fastmath=FAST, error_model="numpy")
def expand(learned, lanes, room, dt):
    """The learned functions about the middle that room.new leads to."""
    n_a, n_q = lanes.command.shape[0], learned.n_q
    triangle, half = n_q * (n_q + 1) // 2, dt / 2
    for a in range(n_a):
        for b in range(LANES):
            room.about[a, b] = lanes.q[a, b] + half * room.new[a, b]
    fill_basis(room.about, learned.forces, room.forces.table, room.forces.basis)
    add_up(learned.forces.values, room.forces.basis, room.forces.sums)
    for row in range(n_a + n_a * (n_a + 1) // 2):
        for b in range(LANES):
            room.forces.sums[row, b] *= lanes.stiffness[b]
    fill_basis(room.about, learned.inertia, room.inertia.table, room.inertia.basis)
    add_up(learned.inertia.values, room.inertia.basis, room.inertia.sums)
    for i in range(n_q):
        for j in range(n_q):
            for b in range(LANES):
                room.M[i, j, b] = 0.0
                room.drag[i, j, b] = 0.0
    factor = np.ones(LANES)
    _add_square(room.inertia.sums, 0, factor, room.M)
    for loss in range(len(learned.relaxation)):
        for b in range(LANES):
            factor[b] = learned.relaxation[loss] * lanes.viscosity[b] * lanes.stiffness[b]
        _add_square(room.inertia.sums, (1 + n_a + loss) * triangle, factor, room.drag)
    for i in range(n_q):
        for j in range(n_q):
            for b in range(LANES):
                room.fixed[i, j, b] = room.M[i, j, b] + half * room.drag[i, j, b]
            if i < n_a and j < n_a:
                place = n_a + _place(n_a, i, j)
                for b in range(LANES):
                    room.fixed[i, j, b] += half * half * room.forces.sums[place, b]
            elif i == j:
                for b in range(LANES):
                    room.fixed[i, j, b] += half * half * learned.kappa[i - n_a] * lanes.stiffness[b]


@njit(cache=True, no_cpython_wrapper=True, no_cfunc_wrapper=True, fastmath=FAST, error_model="numpy")
def turn(learned, room, n_a, half):
    """Fills room.turning (n_a, n_q, LANES): half a step times the slope of M v by the actuators."""
    n_q = learned.n_q
    triangle = n_q * (n_q + 1) // 2
    for i in range(n_q):
        for b in range(LANES):
            room.work[i, b] = 0.0
            for a in range(n_a):
                room.turning[a, i, b] = 0.0
    _times(room.inertia.sums, 0, room.new, 1.0, room.work)
    for a in range(n_a):
        for i in range(n_q):
            for b in range(LANES):
                room.product[i, b] = 0.0
        _times(room.inertia.sums, (1 + a) * triangle, room.work, half, room.turning[a])
        _times(room.inertia.sums, (1 + a) * triangle, room.new, half, room.product)
        _times(room.inertia.sums, 0, room.product, 1.0, room.turning[a])


@njit(cache=True, no_cpython_wrapper=True, no_cfunc_wrapper=True, fastmath=FAST, error_model="numpy")
def assemble(learned, lanes, room, forces, half):
    """Residual `room.rest` of the equations at room.new, and Mv, in a step of twice `half` s."""
    n_a, n_q = lanes.command.shape[0], learned.n_q
    for i in range(n_q):
        for b in range(LANES):
            room.Mv[i, b] = 0.0
            room.force[i, b] = 0.0
        for j in range(n_q):
            for b in range(LANES):
                room.Mv[i, b] += room.M[i, j, b] * room.new[j, b]
                room.force[i, b] -= room.drag[i, j, b] * room.new[j, b]
        if i >= n_a:
            for b in range(LANES):
                eta = lanes.q[i, b] + half * room.new[i, b]
                room.force[i, b] -= learned.kappa[i - n_a] * lanes.stiffness[b] * eta
    for a in range(n_a):
        for b in range(LANES):
            room.work[a, b] = lanes.q[a, b] + half * room.new[a, b] - room.about[a, b]
            room.force[a, b] -= room.forces.sums[a, b]
            if forces:
                room.force[a, b] += lanes.command[a, b]
        for i in range(n_q):
            for b in range(LANES):
                room.Mv[i, b] += room.work[a, b] / half * room.turning[a, i, b]
                room.force[a, b] += room.turning[a, i, b] * room.new[i, b] / (2 * half)
    for a in range(n_a):
        for c in range(n_a):
            place = n_a + _place(n_a, a, c)
            for b in range(LANES):
                room.force[a, b] -= room.forces.sums[place, b] * room.work[c, b]
    for i in range(n_q):
        for b in range(LANES):
            room.rest[i, b] = half * room.force[i, b] + lanes.p[i, b] - room.Mv[i, b]


@njit(cache=True, no_cpython_wrapper=True, no_cfunc_wrapper=True, fastmath=FAST, error_model="numpy")
def matrix(lanes, room):
    """Matrix room.A: minus the derivative of the residual by velocity; the rows and columns of held ones are those of
    1."""
    n_a, n = lanes.command.shape[0], room.A.shape[0]
    free, free_column = np.ones(LANES), np.ones(LANES)
    for i in range(n):
        for b in range(LANES):
            free[b] = 1.0 - lanes.held[i, b] if i < n_a else 1.0
            room.change[i, b] = room.rest[i, b] * free[b]
        for j in range(n):
            for b in range(LANES):
                room.A[i, j, b] = room.fixed[i, j, b]
            if j < n_a:
                for b in range(LANES):
                    room.A[i, j, b] += room.turning[j, i, b]
            if i < n_a:
                for b in range(LANES):
                    room.A[i, j, b] -= room.turning[i, j, b]
            for b in range(LANES):
                free_column[b] = 1.0 - lanes.held[j, b] if j < n_a else 1.0
                room.A[i, j, b] *= free[b] * free_column[b]
            if i == j:
                for b in range(LANES):
                    room.A[i, j, b] += 1.0 - free[b]


@njit(cache=True, no_cpython_wrapper=True, no_cfunc_wrapper=True, fastmath=FAST, error_model="numpy")
def eliminate(A, x):
    """Solves A y = x and writes y into x (n, LANES), without pivots, which the positive matrices of these steps do not
    need."""
    n, share = A.shape[0], np.empty(LANES)
    for k in range(n):
        for i in range(k + 1, n):
            for b in range(LANES):
                share[b] = A[i, k, b] / A[k, k, b]
                x[i, b] -= share[b] * x[k, b]
            for j in range(k + 1, n):
                for b in range(LANES):
                    A[i, j, b] -= share[b] * A[k, j, b]
    for k in range(n - 1, -1, -1):
        for j in range(k + 1, n):
            for b in range(LANES):
                x[k, b] -= A[k, j, b] * x[j, b]
        for b in range(LANES):
            x[k, b] /= A[k, k, b]


@njit(cache=True, no_cpython_wrapper=True, no_cfunc_wrapper=True, error_model="numpy")
def advance(room, before, tolerance, smallest, count):
    """Moves room.new by room.change. before (LANES,): how far it went the last time, changed to how far now. Returns
    how many of the first `count` lanes are to go on, by the rate at which changes have fallen."""
    unsolved = 0
    for b in range(count):
        size, moved = smallest, 0.0
        for i in range(room.new.shape[0]):
            size, moved = max(size, abs(room.new[i, b])), max(moved, abs(room.change[i, b]))
        rate = min(moved / before[b], 1.0) if before[b] > 0 else 1.0
        before[b] = moved
        if not moved * rate <= tolerance * size:
            unsolved += 1
    for i in range(room.new.shape[0]):
        for b in range(LANES):
            room.new[i, b] += room.change[i, b]
    return unsolved


@njit(cache=True, no_cpython_wrapper=True, no_cfunc_wrapper=True, fastmath=FAST, error_model="numpy")
def carry_on(room):
    """Carries `rest` and Mv on to first order in the last change."""
    n_a, n_q = room.turning.shape[0], room.new.shape[0]
    for i in range(n_q):
        for j in range(n_q):
            for b in range(LANES):
                room.rest[i, b] -= room.fixed[i, j, b] * room.change[j, b]
                room.Mv[i, b] += room.M[i, j, b] * room.change[j, b]
        for a in range(n_a):
            for b in range(LANES):
                room.rest[i, b] -= room.turning[a, i, b] * room.change[a, b]
                room.Mv[i, b] += room.turning[a, i, b] * room.change[a, b]
        if i < n_a:
            for j in range(n_q):
                for b in range(LANES):
                    room.rest[i, b] += room.turning[i, j, b] * room.change[j, b]
