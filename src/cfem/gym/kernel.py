"""Many robots of one spectral model at once, each in equilibrium under its own command: compiled loops over a batch.

Displacements u are commanded of actuators that may only pull: an actuator stands at delta_i >= u_i, its force
lambda_i >= 0, one of both an equality (a cable that would have to push goes slack). That is the minimum of Psi - w . e
over delta >= u, with loads w on the effectors, found by Newton's method: each step is the minimum of the quadratic
model under the same bounds. Forces are commanded of the others: the minimum of Psi - w . e - lambda . delta. The first
step from where a robot was is that of its last Hessian and costs no series."""

from typing import NamedTuple

import numpy as np
from numba import njit

from cfem.gym.lanes import LANES, add_up, fill_basis, room_of

NEWTON = 14  # evaluations of a robot


@njit(cache=True, error_model="numpy")
def _solve(H, g, free, step, L):
    """Solves H_ff step_f = -g_f - H_fc step_c for the free rows of `step`; the others keep theirs. L: room. False where
    H_ff is not positive definite."""
    n = len(g)
    for i in range(n):
        if not free[i]:
            continue
        for j in range(i + 1):
            if not free[j]:
                continue
            value = H[i, j]
            for k in range(j):
                if free[k]:
                    value -= L[i, k] * L[j, k]
            if i == j:
                if value <= 1e-30:
                    return False
                L[i, i] = np.sqrt(value)
            else:
                L[i, j] = value / L[j, j]
    for i in range(n):
        if free[i]:
            value = -g[i]
            for k in range(n):
                if not free[k]:
                    value -= H[i, k] * step[k]
            for k in range(i):
                if free[k]:
                    value -= L[i, k] * step[k]
            step[i] = value / L[i, i]
    for i in range(n - 1, -1, -1):
        if free[i]:
            value = step[i]
            for k in range(i + 1, n):
                if free[k]:
                    value -= L[k, i] * step[k]
            step[i] = value / L[i, i]
    return True


@njit(cache=True, error_model="numpy")
def _quadratic(H, g, room, bounded, free, step, L, tolerance):
    """The step that minimises g . step + step . H step / 2 over step >= -room (n,), where bounded; else over all.
    free: which rows are not at their bound, a guess and then what was found. False where there is none."""
    n = len(g)
    for _ in range(2 * n + 1):
        for i in range(n):
            if not free[i]:
                step[i] = -room[i]
        if not _solve(H, g, free, step, L):
            return False
        changed = False
        if bounded:
            for i in range(n):
                if free[i] and step[i] < -room[i]:
                    free[i] = False
                    changed = True
            if not changed:
                for i in range(n):
                    if not free[i]:
                        slope = g[i]
                        for k in range(n):
                            slope += H[i, k] * step[k]
                        if slope < -tolerance[i]:
                            free[i] = True
                            changed = True
        if not changed:
            return True
    return True


class CommandLaw(NamedTuple):
    """Meaning of commands.

    forces: whether commands are forces
    pulls: whether no actuator pushes
    longest: (n_a,) mm of one Newton step
    tolerance: (n_a,) N
    loads: place of the slopes of the loaded effector rows among the outputs, which their Hessians follow (packed)"""

    forces: bool
    pulls: bool
    longest: np.ndarray
    tolerance: np.ndarray
    loads: int


class Place(NamedTuple):
    """Room for the equilibrium of one robot."""

    x: np.ndarray  # where its actuators are
    u: np.ndarray  # its command
    g: np.ndarray  # slope of what is least
    H: np.ndarray  # (n_a, n_a) Hessian of it
    free: np.ndarray
    room: np.ndarray
    step: np.ndarray
    L: np.ndarray


@njit(cache=True, error_model="numpy")
def _move(place, law):
    """Moves `place.x` by one step of Newton's method, at most the longest, within the bounds x >= u where cables
    pull."""
    x, g, H, u, free, room, step = place.x, place.g, place.H, place.u, place.free, place.room, place.step
    n, bounded = len(x), law.pulls and not law.forces
    for i in range(n):
        room[i] = x[i] - u[i]
        free[i] = not bounded or room[i] > 0 or g[i] < -law.tolerance[i]
    if not _quadratic(H, g, room, bounded, free, step, place.L, law.tolerance):
        for i in range(n):
            step[i] = -law.longest[i] if g[i] > 0 else law.longest[i]
    share = 1.0
    for i in range(n):
        if free[i] and share * abs(step[i]) > law.longest[i]:  # others are at their bound, as commanded
            share = law.longest[i] / abs(step[i])
    for i in range(n):
        x[i] += share * step[i] if free[i] else step[i]
        if (bounded and x[i] < u[i]) or not free[i]:
            x[i] = u[i]


@njit(inline="always", error_model="numpy")  # else numba optimises it again in its caller
def _begin(b, place, law, delta, known, out):
    """Sets where robot b is sought first: where the last Hessian leads to."""
    n_a, entry = len(place.x), len(place.x)
    for i in range(n_a):
        place.x[i] = delta[b, i]
    if law.forces:
        return
    if not law.pulls or not known[b]:
        for i in range(n_a):
            place.x[i] = max(place.x[i], place.u[i]) if law.pulls else place.u[i]
        return
    for i in range(n_a):
        place.g[i] = out[b, i]
        for j in range(i, n_a):
            place.H[i, j] = place.H[j, i] = out[b, entry]
            entry += 1
    _move(place, law)


@njit(inline="always", error_model="numpy")
def _slopes(b, lane, place, law, sums, w, softer):
    """Slopes g and H of robot b at place.x, loads taken off; `sums` then has the actuators' forces without those of
    loads. Returns what is left of the equations, in tolerances."""
    n_a, entry, size, loaded = len(place.x), len(place.x), 0.0, w.shape[1]
    for i in range(n_a):
        for r in range(loaded):
            sums[i, lane] -= sums[law.loads + r * n_a + i, lane] * w[b, r] * softer
        place.g[i] = sums[i, lane] - (place.u[i] * softer if law.forces else 0.0)
        if law.forces or (law.pulls and (place.g[i] < 0 or place.x[i] > place.u[i])):
            size = max(size, abs(place.g[i]) / law.tolerance[i])
        for j in range(i, n_a):
            place.H[i, j] = sums[entry, lane]
            for r in range(loaded):
                second = law.loads + loaded * n_a + r * (n_a * (n_a + 1) // 2) + entry - n_a
                place.H[i, j] -= sums[second, lane] * w[b, r] * softer
            place.H[j, i] = place.H[i, j]
            entry += 1
    return size


@njit(cache=True, error_model="numpy")
def equilibria(u, w, law, delta, known, q, softer, series, out):
    """Equilibria of B robots under their commands; returns the number that did not converge.

    u: (B, n_a) commands
    w: (B, k) loads on k effector rows in N, or (0, 0)
    delta: (B, n_a) where the actuators were, and where they are then
    known: (B,) whether `out` has the forces and the Hessian there
    q, softer: (B, n_q) and (B,) parameters
    out: (B, outputs) the series then, whose first n_a are the forces, without those of the loads, and the next the
        Hessian (packed, of the energy alone)"""
    B, n_a = u.shape
    n, width = n_a + q.shape[1], out.shape[1]
    t, sums = np.zeros((n, LANES)), room_of(series, n)
    square, row = (n_a, n_a), np.empty((5, n_a))
    place = Place(row[0], row[1], row[2], np.empty(square), np.empty(n_a, np.bool_), row[3], row[4], np.empty(square))
    robot_of, evaluations_left = (
        np.full(LANES, -1),
        np.zeros(LANES, np.int64),
    )  # which robot a lane works on; its evaluations left
    following, busy, failed = 0, 0, 0
    while following < B or busy > 0:
        for lane in range(LANES):  # a lane that is done takes the next robot
            if robot_of[lane] >= 0 or following >= B:
                continue
            b, robot_of[lane], evaluations_left[lane] = following, following, NEWTON
            following, busy = following + 1, busy + 1
            for i in range(n_a, n):
                t[i, lane] = q[b, i - n_a]
            for i in range(n_a):
                place.u[i] = u[b, i]
            _begin(b, place, law, delta, known, out)
            for i in range(n_a):
                t[i, lane] = place.x[i]
        fill_basis(t, series, sums.table, sums.basis)
        add_up(series.values, sums.basis, sums.sums)
        for lane in range(LANES):
            b = robot_of[lane]
            if b < 0:
                continue
            for i in range(n_a):
                place.x[i], place.u[i] = t[i, lane], u[b, i]
            size = _slopes(b, lane, place, law, sums.sums, w, softer[b])
            evaluations_left[lane] -= 1
            if size > 1.0 and evaluations_left[lane] > 0:
                _move(place, law)
                for i in range(n_a):
                    t[i, lane] = place.x[i]
                continue
            failed += 0 if size <= 1.0 else 1
            for j in range(width):
                out[b, j] = sums.sums[j, lane]
            for i in range(n_a):
                delta[b, i] = place.x[i]
            known[b], robot_of[lane], busy = True, -1, busy - 1
    return failed
