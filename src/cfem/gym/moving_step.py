"""Ticks of many robots that move: steps of `moving_kernel`, which cables are slack, and where effectors are."""

from typing import NamedTuple

import numpy as np
from numba import njit

from cfem.gym.lanes import LANES, LaneSeries, add_up, fill_basis, room_of
from cfem.gym.moving_kernel import (
    FAST,
    Lanes,
    advance,
    assemble,
    carry_on,
    eliminate,
    expand,
    matrix,
    room_for,
    turn,
)

EXPANSIONS, CHOICES, NEWTON = 3, 4, 6  # at most, of a step: of the learned functions; of the slack cables; for each
NEAR = 20.0  # tolerances of velocity, in half widths of the learned box: how far an expansion may be from its middle


class Effectors(NamedTuple):
    """Series of where effectors are at rest, and of their motion by the inner ones: H row by row, then E row by row
    (packed), or nothing; in coordinates q / scale."""

    still: LaneSeries
    moving: LaneSeries
    curved: bool


@njit(cache=True, no_cpython_wrapper=True, no_cfunc_wrapper=True, fastmath=FAST, error_model="numpy")
def _distance(learned, lanes, room, dt):
    """Distance of the middles of the step from those of the expansion, in half widths; of the farthest lane."""
    n_a, to_box, most = lanes.command.shape[0], learned.inertia.to_box, 0.0
    for k in range(n_a):
        for b in range(LANES):
            z = 0.0
            for a in range(n_a):
                z += to_box[k, a] * (lanes.q[a, b] + dt / 2 * room.new[a, b] - room.about[a, b])
            most = max(most, abs(z))
    return most


@njit(cache=True, no_cpython_wrapper=True, no_cfunc_wrapper=True, error_model="numpy")
def _choose(lanes, room, dt, small, short, count):
    """Changes which cables are held where one would push, by more than small, or would be slack and shorter than
    commanded. Returns how many of the first `count` robots that were."""
    wrong = 0
    for b in range(count):
        changed = False
        for a in range(lanes.command.shape[0]):
            if lanes.held[a, b] > 0:
                if room.rest[a, b] > dt / 2 * small:
                    lanes.held[a, b], changed = 0.0, True
            elif lanes.q[a, b] + dt * room.new[a, b] < lanes.command[a, b] - short:
                lanes.held[a, b], changed = 1.0, True
                room.new[a, b] = (lanes.command[a, b] - lanes.q[a, b]) / dt
        wrong += changed
    return wrong


@njit(inline="always", error_model="numpy")  # else numba optimises it again in its caller
def _step(learned, lanes, room, forces, pulls, dt, small, tolerance, count):
    """Takes one step of all lanes. Returns of how many of the first `count` robots the equations were not solved."""
    n_a, n_q = lanes.command.shape[0], learned.n_q
    for i in range(n_q):
        for b in range(LANES):
            room.new[i, b] = lanes.v[i, b] + dt * lanes.gain[i, b]
            if i < n_a and lanes.held[i, b] > 0:
                room.new[i, b] = (lanes.command[i, b] - lanes.q[i, b]) / dt
    failed, before = 0, np.empty(LANES)
    for _ in range(EXPANSIONS):
        expand(learned, lanes, room, dt)
        for _ in range(CHOICES):
            before[:] = 0.0
            for _ in range(NEWTON):
                turn(learned, room, n_a, dt / 2)
                assemble(learned, lanes, room, forces, dt / 2)
                matrix(lanes, room)
                eliminate(room.A, room.change)
                failed = advance(room, before, tolerance, learned.smallest / dt, count)
                if failed == 0:
                    break
            carry_on(room)
            if forces or not pulls:
                break
            wrong = _choose(lanes, room, dt, small, 1e-9, count)
            failed += wrong
            if not wrong:
                break
        if _distance(learned, lanes, room, dt) <= NEAR * tolerance:
            break
    for i in range(n_q):
        for b in range(LANES):
            if i < n_a:
                lanes.lam[i, b] = lanes.command[i, b] if forces else -2 / dt * room.rest[i, b] * lanes.held[i, b]
            lanes.p[i, b] = 2 * room.Mv[i, b] - lanes.p[i, b]
            lanes.q[i, b] += dt * room.new[i, b]
            lanes.gain[i, b] = (room.new[i, b] - lanes.v[i, b]) / dt
            lanes.v[i, b] = room.new[i, b]
    return failed


@njit(cache=True, no_cpython_wrapper=True, no_cfunc_wrapper=True, fastmath=FAST, error_model="numpy")
def _effectors(effectors, lanes, still, moving, room, tip, outside):
    """Fills tip (n_e, LANES) mm from rest, and outside (LANES,): how far the actuators are from the middle of the
    learned box, in half widths."""
    n_e, n_a = tip.shape[0], lanes.command.shape[0]
    n_r = lanes.q.shape[0] - n_a
    for a in range(n_a):
        for b in range(LANES):
            room.about[a, b] = lanes.q[a, b]
    fill_basis(room.about, effectors.still, still.table, still.basis)
    add_up(effectors.still.values, still.basis, still.sums)
    for b in range(LANES):
        outside[b] = 0.0
    for a in range(n_a):
        for b in range(LANES):
            outside[b] = max(outside[b], abs(still.table[a, 1, b]))
    fill_basis(room.about, effectors.moving, moving.table, moving.basis)
    add_up(effectors.moving.values, moving.basis, moving.sums)
    place = n_e * n_r
    for e in range(n_e):
        for b in range(LANES):
            tip[e, b] = still.sums[e, b]
        for r in range(n_r):
            for b in range(LANES):
                tip[e, b] += moving.sums[e * n_r + r, b] * lanes.q[n_a + r, b]
        if effectors.curved:
            for r in range(n_r):
                for s in range(r, n_r):
                    factor = 0.5 if r == s else 1.0
                    for b in range(LANES):
                        product = lanes.q[n_a + r, b] * lanes.q[n_a + s, b]
                        tip[e, b] += factor * moving.sums[place, b] * product
                    place += 1


@njit(cache=True, error_model="numpy")
def ticks(learned, effectors, state, begin, end, forces, pulls, dt, substeps, small, tolerance, tip, outside):
    """Advances B robots by a tick; returns how many steps of robots were not solved.

    state: `Lanes` of (n, B) instead of (n, LANES), changed in place
    begin, end: (n_a, B) commands at both ends of the tick, between which they move evenly: forces, or displacements
    pulls: whether actuators only pull
    dt, substeps: s of a step, and steps of the tick
    small: force that counts as none
    tolerance: of a step, share of the velocities
    tip, outside: (n_e, B) and (B,), see `_effectors`"""
    (n_a, B), n_q, failed = begin.shape, learned.n_q, 0
    lanes = Lanes(
        np.zeros((n_q, LANES)), np.zeros((n_q, LANES)), np.zeros((n_q, LANES)), np.zeros((n_q, LANES)),
        np.zeros((n_a, LANES)), np.zeros((n_a, LANES)), np.zeros((n_a, LANES)), np.ones(LANES), np.ones(LANES),
    )  # fmt: skip
    room, still, moving = room_for(learned, n_a), room_of(effectors.still, n_a), room_of(effectors.moving, n_a)
    tip_lanes, outside_lanes = np.empty((tip.shape[0], LANES)), np.empty(LANES)
    for first in range(0, B, LANES):
        count = min(LANES, B - first)
        _copy(state, lanes, first, 0, count)
        for step in range(substeps):
            share = (step + (0.5 if forces else 1.0)) / substeps  # a force of its mean, a displacement of its end
            for a in range(n_a):
                for b in range(count):
                    lanes.command[a, b] = begin[a, first + b] + share * (end[a, first + b] - begin[a, first + b])
            failed += _step(learned, lanes, room, forces, pulls, dt, small, tolerance, count)
        _effectors(effectors, lanes, still, moving, room, tip_lanes, outside_lanes)
        _copy(lanes, state, 0, first, count)
        for b in range(count):
            outside[first + b] = outside_lanes[b]
            for e in range(tip.shape[0]):
                tip[e, first + b] = tip_lanes[e, b]
    return failed


@njit(inline="always", error_model="numpy")
def _copy(source, to, first, to_first, count):
    """Copies count robots from place `first` on, to place `to_first` on."""
    for b in range(count):
        for i in range(source.q.shape[0]):
            to.q[i, to_first + b], to.p[i, to_first + b] = source.q[i, first + b], source.p[i, first + b]
            to.v[i, to_first + b], to.gain[i, to_first + b] = source.v[i, first + b], source.gain[i, first + b]
        for a in range(source.held.shape[0]):
            to.lam[a, to_first + b], to.held[a, to_first + b] = source.lam[a, first + b], source.held[a, first + b]
        to.stiffness[to_first + b] = source.stiffness[first + b]
        to.viscosity[to_first + b] = source.viscosity[first + b]
