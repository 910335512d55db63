"""Two bars of finite elements that hold a box by their surfaces."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.blocks import bar
from support.held_body import HeldBody, Pose

from cfem.constraint.surface import outer_surface
from cfem.constraint.surface_points import at_nodes
from cfem.contact.obstacle import Box
from cfem.equilibrium.contact.skinned_robot import SkinnedRobot

PLACE, HALF = np.array([52.5, 5.0, 13.3]), np.array([6.0, 4.5, 3.0])
FLIP = np.diag([1.0, -1.0, -1.0])
PULLS = [np.array([0.0, 0.8, 0.8])] * 2
WEIGHT = 1e-2  # N


def held(turn=None):
    """Bars below and above the box, 0.3 mm away from it, all of it turned."""
    turn = np.eye(3) if turn is None else turn
    robot = bar(element="hex8", divisions=(12, 3, 2), cables=3)
    surface = outer_surface(robot.X, robot.body.mesh.facets)
    points = at_nodes(robot.X, robot.body.mesh.facets, surface)
    poses = (np.eye(3), np.zeros(3)), (FLIP, PLACE - FLIP @ PLACE)
    robots = [SkinnedRobot(robot, surface.nodes, surface.triangles, points, turn @ R, turn @ t) for R, t in poses]
    return HeldBody(robots, Box(HALF), Pose(turn, turn @ PLACE), 4.0, 0.9)


def gripped(load, turn=None):
    body = held(turn)
    body.go(body.state.pose, PULLS)
    turn = np.eye(3) if turn is None else turn
    return body.balance(np.concatenate([turn @ load, np.zeros(3)]))


def test_what_holds_a_body_balances_its_load_and_turns_with_everything():
    """Moments are those of the forces about the body's place: the law alone keeps them."""
    load = np.array([0.0, WEIGHT, -WEIGHT])
    state, turn = gripped(load), Rotation.from_rotvec([0.3, -0.5, 0.8]).as_matrix()
    assert state.imbalance < 1e-4 * np.linalg.norm(load)
    assert state.forces.sum(axis=0) == pytest.approx(-load, abs=1e-6)
    assert state.forces[0][2] > 3 * WEIGHT and state.forces[1][2] < -3 * WEIGHT
    assert state.pose.t[2] < PLACE[2] and state.pose.t[1] > PLACE[1]
    other = gripped(load, turn)
    assert other.forces @ turn == pytest.approx(state.forces, abs=1e-3 * np.abs(state.forces).max())
    assert other.pose.t @ turn == pytest.approx(state.pose.t, abs=1e-3)


def test_a_body_without_load_stays_in_the_middle_and_one_that_is_too_heavy_finds_no_balance():
    state = gripped(np.array([0.0, 0.0, 0.0]) + 1e-6)
    assert state.pose.t[1:] == pytest.approx(PLACE[1:], abs=1e-2)
    assert state.forces[0] == pytest.approx(-state.forces[1], abs=1e-5)
    with pytest.raises(RuntimeError, match="free body"):
        gripped(np.array([0.0, 1.0, 0.0]))


def test_poses_go_a_share_of_the_way():
    begin = Pose(np.eye(3), np.zeros(3))
    end = begin.moved(np.array([1.0, 0.0, 0.0, 0.0, 0.0, 2.0]), 4.0)
    half = begin.towards(end, 0.5)
    assert half.t == pytest.approx([0.5, 0, 0]) and half.way(end, 4.0) == pytest.approx(0.5 + 1.0)
    assert Rotation.from_matrix(half.R).as_rotvec() == pytest.approx([0, 0, 0.25])
