"""Cables that stick in their guides and slip, along a history of commands: against capstans in closed form."""

from dataclasses import replace

import numpy as np
import pytest
from support.blocks import bar
from support.rods import LENGTH, rod_problem

from cfem.constraint.attachment import Attachment
from cfem.constraint.cable import make_cable
from cfem.constraint.rod_cable import make_rod_cable
from cfem.equilibrium.friction.guides import solve_slipping
from cfem.equilibrium.friction.sticking import Follower
from cfem.equilibrium.system.actuation import force
from cfem.equilibrium.system.problem import Problem
from cfem.equilibrium.system.solution import Status

OFF, FRICTION, LARGEST = 0.6, 0.4, 0.05


def followed(problem, commands):
    """Equilibrium and where the history has led, after each."""
    follower = Follower(problem)
    _, now = follower.rest()
    found = []
    for command in commands:
        at, now = follower.go(np.atleast_1d(command), now)
        assert at.status is Status.CONVERGED
        found.append((at, now))
    return found


@pytest.fixture(scope="module")
def rod():
    points = np.array([[0, 0, OFF], [LENGTH, 0, OFF]])
    return rod_problem(10, lambda body: [make_rod_cable(body.rod, points, "c", FRICTION)])


def turned(problem, at):
    return abs(problem.evaluate(at.state.x, np.empty(0)).response.rod.strain.e[:, 4].sum())


def turned_in_closed_form(largest, now, bending):
    """rad, of a rod whose cable was pulled by `largest` and let out to `now`. With k = T OFF / EI and dT/ds = -mu k T
    while it slips inwards, T = T0 / (1 + mu k0 s), k0 = T0 OFF / EI; outwards T = T0 / (1 - mu k0 s). It has slipped
    outwards up to where both meet, and sticks beyond."""
    k, k0, mu = largest * OFF / bending, now * OFF / bending, FRICTION
    front = min((1 / k0 - 1 / k) / (2 * mu), LENGTH)
    beyond = np.log((1 + mu * k * LENGTH) / (1 + mu * k * front)) / mu
    return beyond - np.log(1 - mu * k0 * front) / mu


def test_a_rod_sticks_from_the_tip_as_its_cable_is_let_out(rod):
    tensions = [LARGEST, 0.048, 0.04, 0.03, 0.02]
    bending = rod.body.rod.stiffness[0, 4]
    for tension, (at, _) in zip(tensions, followed(rod, tensions), strict=True):
        assert turned(rod, at) == pytest.approx(turned_in_closed_form(LARGEST, tension, bending), rel=1.5e-3)


def test_a_history_of_loading_and_of_full_unloading_slips_everywhere(rod):
    (_, up), _, (at, down) = followed(rod, [LARGEST, 0.03, 0.01])
    for way, tension, now in ((1.0, LARGEST, up), (-1.0, 0.01, down)):
        found, shares = solve_slipping(rod, force(np.array([tension])), ways=way)
        np.testing.assert_allclose(now.tension / tension, shares[0], atol=1e-6)
    assert turned(rod, at) == pytest.approx(turned(rod, found), rel=1e-6)


def test_steps_on_the_way_change_nothing_while_the_direction_stays(rod):
    few, many = followed(rod, [LARGEST, 0.02]), followed(rod, [0.03, LARGEST, 0.04, 0.03, 0.02])
    assert turned(rod, few[-1][0]) == pytest.approx(turned(rod, many[-1][0]), rel=2e-4)


def test_a_loop_dissipates_and_closes(rod):
    """The second loop repeats, and the drive has done work around it."""
    once = [0.02, 0.035, LARGEST, 0.035]
    loop = followed(rod, [*once, *once, 0.02])[len(once) :]
    tension = np.array([0.02, *once[1:], 0.02])
    pulled = np.array([now.delta.sum() for _, now in loop])
    work = ((tension[1:] + tension[:-1]) / 2 * np.diff(pulled)).sum()
    assert pulled[-1] == pytest.approx(pulled[0], rel=1e-6) and work > 0.01 * LARGEST * np.ptp(pulled)


def test_slack_forgets_the_history(rod):
    first, *_, last = followed(rod, [0.03, LARGEST, 0.0, 0.03])
    assert turned(rod, first[0]) == pytest.approx(turned(rod, last[0]), rel=1e-6)


def test_tension_behind_a_capstan_sticks_until_it_slips_back():
    """Over two guides that do not move, to the end of a bar: T1 / T0 = exp(-mu theta) while the cable is pulled in,
    exp(mu theta) while it is let out, and T1 stays between."""
    robot = bar(divisions=(3, 1, 1), cables=0)
    X, pull_point = robot.X, np.array([0.0, 10.0, -30.0])
    nodes = [int(np.argmin(np.linalg.norm(X - place, axis=1))) for place in ([0, 10, 10], [0, 0, 10], [60, 0, 10])]
    points = [Attachment(np.array([node]), np.ones(1), X[node]) for node in nodes]
    cable = make_cable(points, pull_point, "c", FRICTION)
    rows, reach = replace(robot.rows, actuators=("c",)), np.array([[0.0, 8.0]])
    robot = replace(robot, actuators=(cable,), rows=rows, reach=reach, unilateral=np.array([True]))
    tensions, now = np.array([0.02, 0.04, 0.035, 0.01, 0.002, 0.001, 0.002, 0.03]), 0.0
    behind = []
    for tension, (at, to) in zip(tensions, followed(Problem(robot), tensions), strict=True):
        way = np.diff(np.vstack([pull_point, at.state.x[nodes]]), axis=0)
        way /= np.linalg.norm(way, axis=1)[:, None]
        angle = FRICTION * np.arccos((way[1:] * way[:-1]).sum(axis=1)).sum()
        now = np.clip(now, tension * np.exp(-angle), tension * np.exp(angle))
        behind.append(to.tension[-1])
        assert behind[-1] == pytest.approx(now, rel=1e-5)
    assert behind[1] == pytest.approx(behind[2], rel=1e-5) and 1.5 < behind[5] / tensions[5] < 4
