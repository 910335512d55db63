"""The lower end of a reach is as far as the other actuators move each one."""

import numpy as np
import pytest
from support.blocks import bar

from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import force
from cfem.equilibrium.system.problem import Problem
from cfem.init.let_out import let_out


def test_of_two_opposite_cables_each_is_let_out_by_their_coupling():
    np.testing.assert_allclose(let_out(np.array([[2.0, -1.5], [-1.5, 2.0]]), np.array([8.0, 8.0])), [-6, -6])


def test_one_actuator_alone_and_actuators_that_shorten_each_other_are_not_let_out():
    assert let_out(np.array([[3.0]]), np.array([5.0])).tolist() == [0]
    assert let_out(np.array([[2.0, 0.5], [0.5, 2.0]]), np.array([5.0, 5.0])).tolist() == [0, 0]


def test_nothing_is_let_out_by_more_than_its_room():
    compliance, reach = np.array([[2.0, -1.5], [-1.5, 2.0]]), np.array([8.0, 8.0])
    np.testing.assert_allclose(let_out(compliance, reach, np.array([5.0, np.inf])), [-5, -6])


def test_no_pull_within_the_reach_lets_out_more_and_some_pull_as_much():
    """Three cables of unlike strokes; a chamber's units beside them change nothing."""
    angles = 2 * np.pi * np.arange(3) / 3
    W, reach = np.cos(angles[:, None] - angles) + 0.2, np.array([10.0, 7.0, 12.0])
    low, forces = let_out(W, reach), np.random.default_rng(0).random((200_000, 3)) ** 2
    moved = forces @ W
    within = moved / (moved / reach).max(axis=1, keepdims=True)  # each pull as far as the reach allows
    assert (within.min(axis=0) >= low - 1e-9).all() and within.min(axis=0) == pytest.approx(low, rel=0.02)
    units = np.array([1.0, 1.0, 500.0])
    np.testing.assert_allclose(let_out(W * np.outer(units, units), reach * units), low * units)


def test_the_finite_element_bar_is_let_out_by_so_much():
    """Small strokes, so that the bar is linear: the bound is met where one of two cables is pulled alone."""
    robot = bar()
    problem, reach = Problem(robot), np.full(2, 0.05)
    compliance = solve(problem, force(np.zeros(2))).condensed.W_aa
    ended = solve(problem, force(np.array([0.05 / compliance[0, 0], 0.0])))
    low = let_out(compliance, reach)
    assert (low < 0).all() and ended.delta_a[1] == pytest.approx(low[1], rel=0.02)
