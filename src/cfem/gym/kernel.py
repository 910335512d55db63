"""Many robots of one spectral model at once, each in equilibrium under its own command: compiled loops over a batch.

Displacements u are told to actuators that may only pull: an actuator stands at delta_i >= u_i, its force lambda_i >= 0,
one of both an equality (a cable that would have to push goes slack). That is the minimum of Psi over delta >= u, found
by Newton's method on the slack ones. Forces are told to the others: the minimum of Psi - lambda . delta."""

import numpy as np
from numba import njit

import cfem.mechanics.compiling  # noqa: F401  says so while it compiles

NEWTON, LANES = 12, 64  # steps; robots whose series are summed side by side


@njit(cache=True, fastmath=True)
def _evaluate(t, to_box, offset, indices, series, table, value, out):
    """out (n_out, LANES): the series at inputs t (n, LANES); table (n, degree + 1, LANES), value (LANES,): room."""
    n, terms, width = t.shape[0], indices.shape[0], series.shape[1]
    for i in range(n):
        for b in range(LANES):
            z = offset[i]
            for j in range(n):
                z += to_box[i, j] * t[j, b]
            table[i, 0, b] = 1.0
            table[i, 1, b] = z
        for k in range(2, table.shape[1]):
            for b in range(LANES):
                table[i, k, b] = 2.0 * table[i, 1, b] * table[i, k - 1, b] - table[i, k - 2, b]
    for j in range(width):
        for b in range(LANES):
            out[j, b] = 0.0
    for m in range(terms):
        k = indices[m, 0]
        for b in range(LANES):
            value[b] = table[0, k, b]
        for i in range(1, n):
            k = indices[m, i]
            for b in range(LANES):
                value[b] *= table[i, k, b]
        for j in range(width):
            one = series[m, j]
            for b in range(LANES):
                out[j, b] += value[b] * one


@njit(cache=True)
def _solve(H, g, free, step):
    """step on the free rows with H_ff step_f = -g_f, 0 on the others. False where H_ff is not positive definite."""
    n = len(g)
    L = np.zeros((n, n))
    for i in range(n):
        step[i] = 0.0
    for i in range(n):
        if not free[i]:
            continue
        for j in range(i + 1):
            if not free[j]:
                continue
            value = H[i, j]
            for k in range(j):
                value -= L[i, k] * L[j, k]
            if i == j:
                if value <= 1e-300:
                    return False
                L[i, i] = np.sqrt(value)
            else:
                L[i, j] = value / L[j, j]
    for i in range(n):
        if free[i]:
            value = -g[i]
            for k in range(i):
                value -= L[i, k] * step[k]
            step[i] = value / L[i, i]
    for i in range(n - 1, -1, -1):
        if free[i]:
            value = step[i]
            for k in range(i + 1, n):
                value -= L[k, i] * step[k]
            step[i] = value / L[i, i]
    return True


@njit(cache=True, fastmath=True)
def equilibria(u, forces, pulls, delta, q, softer, to_box, offset, indices, series, degree, longest, tolerance, out):
    """u (B, n_a): commands, forces: whether they are forces; pulls: whether no actuator pushes; delta (B, n_a): where
    the actuators were, and where they are then; q (B, n_q), softer (B,): parameters; out (B, n_out): forces of the last
    step in its first n_a columns, and the series then, whose first n_a are the gradient and the next the Hessian
    (packed); longest: mm of one Newton step; tolerance: N. Returns how many did not converge."""
    B, n_a = u.shape
    n, width = n_a + q.shape[1], series.shape[1]
    t, table, value = np.zeros((n, LANES)), np.empty((n, max(degree, 1) + 1, LANES)), np.empty(LANES)
    found, g, step = np.empty((width, LANES)), np.empty(n_a), np.empty(n_a)
    H, free = np.empty((n_a, n_a)), np.empty(n_a, np.bool_)
    who, left = np.full(LANES, -1), np.empty(LANES, np.int64)  # which robot a lane works on; its steps left
    following, busy, failed = 0, 0, 0
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
                slack = pulls and out[b, i] <= tolerance and delta[b, i] > u[b, i]
                t[i, lane] = delta[b, i] if forces or slack else u[b, i]
        _evaluate(t, to_box, offset, indices, series, table, value, found)
        for lane in range(LANES):
            b = who[lane]
            if b < 0:
                continue
            any_free, size, place = False, 0.0, n_a
            for i in range(n_a):
                g[i] = found[i, lane] - (u[b, i] * softer[b] if forces else 0.0)
                free[i] = forces or (pulls and (g[i] < -tolerance or t[i, lane] > u[b, i]))
                any_free = any_free or free[i]
                if free[i]:
                    size = max(size, abs(g[i]))
            left[lane] -= 1
            good = not any_free or size <= tolerance
            if good or left[lane] == 0:
                failed += 0 if good else 1
                for j in range(width):
                    out[b, j] = found[j, lane]
                for i in range(n_a):
                    delta[b, i] = t[i, lane]
                who[lane] = -1
                busy -= 1
                continue
            for i in range(n_a):
                for j in range(i, n_a):
                    H[i, j] = found[place, lane]
                    H[j, i] = found[place, lane]
                    place += 1
            if not _solve(H, g, free, step):
                for i in range(n_a):
                    step[i] = -longest if g[i] > 0 else longest
                    step[i] = step[i] if free[i] else 0.0
            most = 0.0
            for i in range(n_a):
                most = max(most, abs(step[i]))
            share = 1.0 if most <= longest else longest / most
            for i in range(n_a):
                t[i, lane] += share * step[i]
                if not forces and t[i, lane] < u[b, i]:
                    t[i, lane] = u[b, i]
    return failed
