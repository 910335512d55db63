"""Many robots of one spectral model at once, each in equilibrium under its own command: compiled loops over a batch.

Displacements u are told to actuators that may only pull: an actuator stands at delta_i >= u_i, its force lambda_i >= 0,
one of both an equality (a cable that would have to push goes slack). That is the minimum of Psi - w . e over
delta >= u, with loads w on the effectors, found by Newton's method: each step is the minimum of the quadratic model
under the same bounds. Forces are told to the others: the minimum of Psi - w . e - lambda . delta. The first step from
where a robot was is that of its last Hessian and costs no series."""

import numpy as np
from numba import njit

from cfem.gym.lanes import LANES, add_up, fill_basis

NEWTON = 14  # evaluations of a robot


@njit(cache=True, error_model="numpy")
def _solve(H, g, free, step, L):
    """step on the free rows with H_ff step_f = -g_f - H_fc step_c; the others keep theirs. L: room. False where H_ff is
    not positive definite."""
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
                        if slope < -tolerance:
                            free[i] = True
                            changed = True
        if not changed:
            return True
    return True


@njit(cache=True, error_model="numpy")
def _move(x, g, H, u, bounded, free, room, step, L, tolerance, longest):
    """x (n,) by one step of Newton's method, at most `longest`, within the bounds x >= u where bounded."""
    n = len(x)
    for i in range(n):
        room[i] = x[i] - u[i]
        free[i] = not bounded or room[i] > 0 or g[i] < -tolerance
    if not _quadratic(H, g, room, bounded, free, step, L, tolerance):
        for i in range(n):
            step[i] = -longest if g[i] > 0 else longest
    most = 0.0
    for i in range(n):
        if free[i]:  # those at their bound are where they are told to be, however far
            most = max(most, abs(step[i]))
    share = 1.0 if most <= longest else longest / most
    for i in range(n):
        x[i] += share * step[i] if free[i] else step[i]
        if (bounded and x[i] < u[i]) or not free[i]:
            x[i] = u[i]


@njit(cache=True, fastmath=True, error_model="numpy")
def equilibria(u, w, forces, pulls, delta, known, q, softer, series, first_e, longest, tolerance, out):
    """u (B, n_a): commands, forces: whether they are forces; pulls: whether no actuator pushes; w (B, n_e): loads on
    the effectors in N, or (0, 0); delta (B, n_a): where the actuators were, and where they are then; known (B,):
    whether out has the forces and the Hessian there; q (B, n_q), softer (B,): parameters; first_e: place of the
    effectors' gradient among the outputs, which their Hessians follow; out (B, outputs): the series then, whose first
    n_a are the forces, without those of the loads, and the next the Hessian (packed, of the energy alone); longest: mm
    of one Newton step; tolerance: N. Returns how many did not converge."""
    B, n_a = u.shape
    n, width = n_a + q.shape[1], out.shape[1]
    t, table = np.zeros((n, LANES)), np.empty((n, series.highest + 1, LANES))
    basis, found = np.zeros((series.values.shape[1], LANES)), np.empty((series.values.shape[0], LANES))
    x, g, step, room = np.empty(n_a), np.empty(n_a), np.empty(n_a), np.empty(n_a)
    H, L, free, told = (
        np.empty((n_a, n_a)),
        np.empty((n_a, n_a)),
        np.empty(n_a, np.bool_),
        np.empty(n_a),
    )
    who, left = np.full(LANES, -1), np.zeros(LANES, np.int64)  # which robot a lane works on; its evaluations left
    following, busy, failed, bounded = 0, 0, 0, pulls and not forces
    while following < B or busy > 0:
        for lane in range(LANES):  # a lane that is done takes the next robot
            if who[lane] >= 0 or following >= B:
                continue
            b = following
            following += 1
            busy += 1
            who[lane], left[lane] = b, NEWTON
            for i in range(n_a, n):
                t[i, lane] = q[b, i - n_a]
            for i in range(n_a):
                x[i] = delta[b, i]
                told[i] = u[b, i]
            if forces:
                pass
            elif not pulls:
                x[:] = told
            elif known[b]:
                place = n_a
                for i in range(n_a):
                    g[i] = out[b, i]
                    for j in range(i, n_a):
                        H[i, j] = H[j, i] = out[b, place]
                        place += 1
                _move(x, g, H, told, bounded, free, room, step, L, tolerance, longest)
            else:
                for i in range(n_a):
                    x[i] = max(x[i], told[i])
            for i in range(n_a):
                t[i, lane] = x[i]
        fill_basis(t, series, table, basis)
        add_up(series.values, basis, found)
        for lane in range(LANES):
            b = who[lane]
            if b < 0:
                continue
            size, place = 0.0, n_a
            for i in range(n_a):
                x[i], told[i] = t[i, lane], u[b, i]
                g[i] = found[i, lane]
                for r in range(w.shape[1]):
                    g[i] -= found[first_e + r * n_a + i, lane] * w[b, r] * softer[b]
                found[i, lane] = g[i]
                if forces:
                    g[i] -= told[i] * softer[b]
                if forces or (pulls and (g[i] < 0 or x[i] > told[i])):
                    size = max(size, abs(g[i]))
            left[lane] -= 1
            if size <= tolerance or left[lane] == 0:
                failed += 0 if size <= tolerance else 1
                for j in range(width):
                    out[b, j] = found[j, lane]
                for i in range(n_a):
                    delta[b, i] = x[i]
                known[b] = True
                who[lane] = -1
                busy -= 1
                continue
            for i in range(n_a):
                for j in range(i, n_a):
                    for r in range(w.shape[1]):
                        second = first_e + w.shape[1] * n_a + r * (n_a * (n_a + 1) // 2) + place - n_a
                        found[place, lane] -= found[second, lane] * w[b, r] * softer[b]
                    H[i, j] = H[j, i] = found[place, lane]
                    place += 1
            _move(x, g, H, told, bounded, free, room, step, L, tolerance, longest)
            for i in range(n_a):
                t[i, lane] = x[i]
    return failed
