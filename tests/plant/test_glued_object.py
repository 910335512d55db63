"""Two FE robots that hold an object against one FE system of all."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation
from support.blocks import hexahedra

from cfem.condensed import Rows
from cfem.constraint.attachment import attach
from cfem.constraint.cable import make_cable
from cfem.constraint.contact import make_contact
from cfem.constraint.effector import make_effector
from cfem.contact.obstacle import Box
from cfem.equilibrium.contact.grasp import FreeObject, holding_stiffness
from cfem.equilibrium.contact.points import PlacedRobot
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import displacement
from cfem.equilibrium.system.problem import Problem
from cfem.equilibrium.system.robot import Robot
from cfem.mechanics.body import make_body
from cfem.mechanics.element import ELEMENTS
from cfem.mechanics.material import LAWS
from cfem.mechanics.material.law import Material
from cfem.plant.grip_plant import GripPlant
from cfem.plant.grip_walk import BUCKLES


def fe_bar(cells, start, cable, points, fixed, rigid=()):
    """`cells` unit hexahedra along x from `start`, one cable, contact points at nodes."""
    mesh = hexahedra((cells * 2.0, 2.0, 2.0), (cells, 1, 1))
    mesh = type(mesh)(mesh.X + [start, 0, 0], mesh.cells, mesh.facets)
    body = make_body(mesh, ELEMENTS["hex8"], Material(LAWS["neo-hookean"], 1.0, 0.3))
    pulled = make_cable(
        [attach(mesh, np.array(point), 0.0, "cable") for point in cable[1:]], np.array(cable[0]), "cable"
    )
    tip = make_effector(mesh, np.array(points[0]), 0.0, 3.0, "tip")
    contacts = tuple(make_contact(mesh, np.array(point), 0.0, f"c{i}") for i, point in enumerate(points))
    names = tuple(f"c{i}.{axis}" for i in range(len(points)) for axis in "xyz")
    nodes = {side: np.flatnonzero(np.abs(mesh.X[:, 0] - x) < 1e-9) for side, x in fixed.items()}
    groups = tuple(np.flatnonzero((mesh.X[:, 0] > a - 1e-9) & (mesh.X[:, 0] < b + 1e-9)) for a, b in rigid)
    rows = Rows(("tip.x", "tip.y", "tip.z"), ("cable",), names)
    return Robot(
        "bar",
        body,
        np.concatenate(list(nodes.values())),
        (pulled,),
        (tip,),
        rows,
        np.array([[0.0, 2.0]]),
        np.array([True]),
        10.0,
        contacts=contacts,
        rigid=groups,
    )


MIDDLE, FAR = ([(x, y, z) for y in (0.0, 2.0) for z in (0.0, 2.0)] for x in (8.0, 12.0))
CABLE, SPARE = [(0.0, 2.0, 1.0), (4.0, 2.0, 1.0)], [(20.0, 2.0, 1.0), (16.0, 2.0, 1.0)]
CENTRE = np.array([10.0, 1.0, 1.0])


def two_bars(shape):
    """Bars of 8 mm on either side of an object from 8 to 12 mm."""
    left, right = (
        fe_bar(4, *one) for one in ((0.0, CABLE, MIDDLE, {"left": 0.0}), (12.0, SPARE, FAR, {"right": 20.0}))
    )
    fingers = [PlacedRobot(Problem(robot), np.eye(3), np.zeros(3)) for robot in (left, right)]
    # the points are glued to places beside the box, too
    held = FreeObject(Box(np.array([1.5, 0.9, 0.9]), t=CENTRE), CENTRE, np.zeros(6))
    return GripPlant(fingers, np.array([0, 1, 2]), held, "bilateral", 0.0, shape), (left, right)


def test_two_fe_bars_on_an_object_are_one_fe_bar_with_a_rigid_middle():
    """As one system with a rigid middle from 8 to 12 mm, and coupled by the plant."""
    whole = fe_bar(10, 0.0, CABLE, MIDDLE[:1], {"left": 0.0, "right": 20.0}, rigid=[(8.0, 12.0)])
    one = solve(Problem(whole), displacement(np.array([0.3])))
    assert one.converged
    plant, (left, right) = two_bars(np.zeros((1, 3)))
    # the right cable may be as long as it likes: let out far, it is slack
    found = plant.step(np.array([0.3, -0.3]))
    assert found.status == "converged" and plant.imbalance <= 1e-8 and 0 < plant.softest < 1
    np.testing.assert_allclose(found.lambda_a, [one.lambda_a[0], 0.0], rtol=1e-8, atol=1e-12)
    at_left, at_right = (state.state.x for state in plant.solved)
    np.testing.assert_allclose(at_left[face(left, 8.0)], one.state.x[face(whole, 8.0)], atol=1e-8)
    np.testing.assert_allclose(at_right[face(right, 12.0)], one.state.x[face(whole, 12.0)], atol=1e-8)
    account = plant.account()
    assert account["points"] == {"open": 0, "stick": 8, "slip": 0} and account["imbalance"] == plant.imbalance
    assert plant.sentence().startswith(f"object: forces and moments balance to {plant.imbalance:.1e}")


def test_the_stiffness_that_holds_the_object_is_the_slope_of_the_wrench_on_it():
    plant, _ = two_bars(np.zeros((1, 3)))
    plant.step(np.array([0.3, 0.2]))
    K = holding_stiffness(plant.last, plant._points(plant.last))
    for row, size in ((0, 1e-4), (2, 1e-4), (3, 1e-3), (5, 1e-3)):
        ways = []
        for sign in (1, -1):
            pushed, _ = two_bars(np.zeros((1, 3)))
            pushed._held = replace(pushed._held, load=sign * size * np.eye(6)[row])
            pushed.step(np.array([0.3, 0.2]))
            there = pushed.last.around
            turned = Rotation.from_matrix(there.R @ plant.last.around.R.T).as_rotvec()
            ways.append(np.concatenate([there.x - plant.last.around.x, turned]))
        moved = (ways[0] - ways[1]) / 2
        # the robots' compliance is that of a state nearby; without the moments of the arms 0.3 would be missing
        np.testing.assert_allclose(K @ moved, size * np.eye(6)[row], atol=5e-3 * size)


def test_an_object_that_is_not_held_stably_is_no_answer(monkeypatch):
    plant, _ = two_bars(np.zeros((1, 3)))
    monkeypatch.setattr("cfem.plant.grip_walk.holding_stiffness", lambda state, points: -np.eye(6))
    assert BUCKLES in plant.step(np.array([0.3, 0.0])).status


def test_the_picture_has_both_robots_and_then_the_object_as_it_moves():
    corners = np.array([[8.0, 0.0, 0.0], [12.0, 2.0, 2.0], [8.0, 2.0, 0.0]])
    plant, (left, right) = two_bars(corners)
    rest = np.concatenate([left.X, right.X, corners])
    np.testing.assert_allclose(plant.x, rest, atol=1e-12)
    plant.step(np.array([0.3, 0.0]))
    np.testing.assert_allclose(plant.x[:-3], np.concatenate([one.state.x for one in plant.solved]), atol=1e-12)
    # the object is glued to the left bar's end: its corners there are that end's
    end = [np.flatnonzero(np.abs(left.X - corner).max(axis=1) < 1e-9)[0] for corner in corners[[0, 2]]]
    np.testing.assert_allclose(plant.x[[-3, -1]], plant.solved[0].state.x[end], atol=1e-8)


def test_forces_are_refused_in_words():
    plant, _ = two_bars(np.zeros((1, 3)))
    refused = plant.step(np.ones(2), "force")
    assert refused.status == "robots that hold an object take displacements" and refused.t == 1
    assert refused.x_e.shape == (3,) and np.isnan(refused.x_e).all() and np.isnan(refused.delta_a).all()
    assert plant.step(np.zeros(2)).t == 2


def face(robot, x):
    return np.flatnonzero(np.abs(robot.X[:, 0] - x) < 1e-9)
