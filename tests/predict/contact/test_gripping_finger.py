"""A finger whose points are touched one by one, from the energy of its rigid patch, against finite elements."""

from dataclasses import replace

import numpy as np
import pytest
from support.blocks import bar

from cfem.condensed import Rows
from cfem.condensed.rotation import turn
from cfem.constraint.contact import make_contact
from cfem.equilibrium.contact.held_patch import contact_points, patch_of
from cfem.equilibrium.contact.patch_compliance import within_patch
from cfem.equilibrium.contact.points import PlacedRobot
from cfem.equilibrium.system.actuation import displacement
from cfem.equilibrium.system.problem import Problem
from cfem.plant.fem_patch import FemPatch
from cfem.predict.contact.gripping_finger import LearnedFinger, WithinPatch

ACTUATORS = displacement(np.array([0.04, 0.02]))
LIFT = np.array([-0.01, 0.005, -0.03, -0.01, 0.005, -0.03, -0.01, 0.005, -0.03])
LEAN = np.array([0.005, 0.0, 0.0, 0.005, 0.0, 0.0, -0.01, 0.0, 0.0])


@pytest.fixture(scope="module")
def both():
    """The bar with three points on its end, by finite elements, and from the energy of its rigid patch."""
    plain = bar(element="hex8", contact=True)
    places = [(60.0, 3.0, 3.0), (60.0, 7.0, 3.0), (60.0, 5.0, 8.0)]
    contacts = tuple(make_contact(plain.body.mesh, np.array(at), 2.0, f"p{i}") for i, at in enumerate(places))
    names = tuple(f"p{i}.{axis}" for i in range(3) for axis in "xyz")
    robot = replace(plain, contacts=contacts, rows=Rows(plain.rows.effectors, plain.rows.actuators, names))
    problem = Problem(robot)
    patch = patch_of(contact_points(problem), turns=True)
    within = WithinPatch(*within_patch(robot, patch))
    turn, shift = np.diag([1.0, -1.0, -1.0]), np.array([1.0, 2.0, 3.0])
    return PlacedRobot(problem, turn, shift), LearnedFinger(FemPatch(robot, turns=True), patch, within, turn, shift)


def test_both_have_their_points_at_the_same_places(both):
    np.testing.assert_allclose(both[0].points, both[1].points, atol=1e-12)


@pytest.mark.parametrize("apart", [np.zeros(9), 0.001 * np.array([1, 0, 0, 0, -1, 0, 0, 0, 1])])
def test_forces_and_compliance_of_single_points_are_those_of_finite_elements(both, apart):
    """A rigid movement, a lean, and points that move apart: forces within 1 % of the largest."""
    delta = LIFT + LEAN + apart
    (fe, soft), (learned, yields) = (one.respond(ACTUATORS, delta, None) for one in both)
    assert learned.converged and fe.converged and not fe.slack.any()
    np.testing.assert_allclose(learned.delta_c, delta, atol=1e-12)
    np.testing.assert_allclose(learned.lambda_c, fe.lambda_c, atol=0.01 * np.abs(fe.lambda_c).max())
    np.testing.assert_allclose(learned.lambda_a, fe.lambda_a, atol=0.01 * np.abs(fe.lambda_a).max())
    np.testing.assert_allclose(yields, soft, atol=0.01 * np.abs(soft).max())


def test_points_follow_the_actuators_as_differences_of_its_own_answers_say(both):
    finger, h = both[1], 1e-5
    delta = LIFT + LEAN
    here, yields = finger.respond(ACTUATORS, delta, None)
    for axis in range(2):
        moved = ACTUATORS.target + h * np.eye(2)[axis]
        there, _ = finger.respond(displacement(moved), delta, here)
        # at fixed places the forces change by what it takes to bring the points back
        change = (there.lambda_c - here.lambda_c) / h
        np.testing.assert_allclose(-yields @ change, here.by_actuators[:, axis], rtol=2e-3, atol=1e-4)


def test_a_patch_that_buckles_has_no_answer(both):
    class Weak:
        def slopes(self, delta):
            return np.zeros((1, 8)), -np.eye(8)[None]

    found, _ = replace(both[1], model=Weak()).respond(ACTUATORS, LIFT, None)
    assert not found.converged


def test_the_patch_is_placed_to_rounding(both):
    """What is missing of the place would be a force, and contact without forces would never be at rest."""
    finger, missing = both[1], []
    for seed in range(20):
        delta = LIFT + LEAN * np.random.default_rng(seed).uniform(-3, 3)
        X, size, _ = finger._placed(delta, np.zeros(6))
        shapes = np.kron(np.eye(3), turn(X[3:]).R) @ finger.within.shapes
        missing.append(np.abs(delta - finger.patch.displacement(X) - shapes @ size).max())
    assert max(missing) <= 1e-14 * np.abs(finger.patch.points).max()
