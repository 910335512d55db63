"""Two FE robots that hold an object against one FE system of all."""

import numpy as np
from support.blocks import hexahedra

from cfem.condensed import Rows
from cfem.condensed.coupling import Holder, RigidObject
from cfem.constraint.attachment import attach
from cfem.constraint.cable import make_cable
from cfem.constraint.contact import make_contact
from cfem.constraint.effector import make_effector
from cfem.equilibrium.actuation import displacement
from cfem.equilibrium.problem import Problem
from cfem.equilibrium.robot import Robot
from cfem.equilibrium.solve import solve
from cfem.mechanics.body import make_body
from cfem.mechanics.element import ELEMENTS
from cfem.mechanics.material import LAWS
from cfem.mechanics.material.law import Material
from cfem.plant.coupled_plant import CoupledPlant
from cfem.plant.fem_patch import FemPatch


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
        np.array([False]),
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
    fem = [FemPatch(robot, turns=True) for robot in (left, right)]
    holds = [
        Holder(name, model, 1, 6, np.eye(3), np.zeros(3), model.patch.origin)
        for name, model in zip(("left", "right"), fem, strict=True)
    ]
    held = RigidObject(CENTRE, True, np.zeros(6))
    return CoupledPlant(holds, held, np.array([True, True]), np.zeros(2), shape), (left, right), fem


def test_two_fe_bars_on_an_object_are_one_fe_bar_with_a_rigid_middle():
    """As one system with a rigid middle from 8 to 12 mm, and coupled by the plant."""
    whole = fe_bar(10, 0.0, CABLE, MIDDLE[:1], {"left": 0.0, "right": 20.0}, rigid=[(8.0, 12.0)])
    one = solve(Problem(whole), displacement(np.array([0.3])))
    assert one.converged
    plant, (left, right), fem = two_bars(np.zeros((1, 3)))
    # the right cable may be as long as it likes: let out far, it is slack
    found = plant.step(np.array([0.3, -0.3]))
    assert found.status == "converged" and plant.imbalance <= 1e-8
    state = plant.at_displacement(found.delta_a)
    np.testing.assert_allclose(state.lambda_a[0], one.lambda_a[0], rtol=1e-8)
    np.testing.assert_allclose(fem[0].x[face(left, 8.0)], one.state.x[face(whole, 8.0)], atol=1e-8)
    np.testing.assert_allclose(fem[1].x[face(right, 12.0)], one.state.x[face(whole, 12.0)], atol=1e-8)
    assert plant.solves == sum(one.solves for one in fem) >= 2 and plant.updates >= 1 and 0 < plant.softest < 1


def test_the_picture_has_both_robots_and_then_the_object_as_it_moves():
    corners = np.array([[8.0, 0.0, 0.0], [12.0, 2.0, 2.0], [8.0, 2.0, 0.0]])
    plant, (left, right), fem = two_bars(corners)
    rest = np.concatenate([left.X, right.X, corners])
    np.testing.assert_allclose(plant.x, rest, atol=1e-12)
    plant.step(np.array([0.3, 0.0]))
    nodes = np.concatenate([one.x for one in fem])
    np.testing.assert_allclose(plant.x[:-3], nodes, atol=1e-12)
    # the object is glued to the left bar's end: its corners there are that end's
    end = [np.flatnonzero(np.abs(left.X - corner).max(axis=1) < 1e-9)[0] for corner in corners[[0, 2]]]
    np.testing.assert_allclose(plant.x[[-3, -1]], fem[0].x[end], atol=1e-8)


def test_forces_are_refused_in_words():
    plant, *_ = two_bars(np.zeros((1, 3)))
    refused = plant.step(np.ones(2), "force")
    assert refused.status == "the coupled plant takes displacements" and refused.t == 1
    assert refused.x_e.shape == (3,) and np.isnan(refused.x_e).all() and np.isnan(refused.delta_a).all()
    assert plant.step(np.zeros(2)).t == 2


def face(robot, x):
    return np.flatnonzero(np.abs(robot.X[:, 0] - x) < 1e-9)
