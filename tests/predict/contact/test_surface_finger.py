"""A learned bar whose nodes touch a body, against differences of itself and against finite elements."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from cfem.constraint.surface import outer_surface
from cfem.constraint.surface_points import at_nodes
from cfem.contact.obstacle import Box
from cfem.equilibrium.contact.grasp import FreeObject
from cfem.equilibrium.contact.skinned_robot import SkinnedRobot
from cfem.equilibrium.contact.surface_robot import PlacedSurface
from cfem.equilibrium.system.actuation import displacement
from cfem.plant.grip_plant import GripPlant
from cfem.predict.contact.surface_finger import SurfaceFinger

HALF, GAP, ASIDE, MU = np.array([5.0, 14.0, 3.0]), 0.2, 7.0, 0.8
FLIP = np.diag([1.0, -1.0, -1.0])
AT = displacement(np.array([2.0]))


@pytest.fixture(scope="module")
def finger(nodes):
    """Four nodes on the upper side, near the free end."""
    rest = nodes.patches.rest
    upper = np.flatnonzero((rest[:, 2] > rest[:, 2].max() - 1e-6) & (rest[:, 0] > 45))
    return SurfaceFinger(nodes, FLIP, np.array([0.0, 1.0, 30.0]), upper[:4])


FORCES = np.tile([0.0, 3e-3, -4e-3], 4)


@pytest.fixture(scope="module")
def pressed(finger):
    """Under 5 mN on each node, inwards, and its compliance."""
    return finger.under(AT, FORCES)


def test_points_are_where_forces_bring_them(finger, pressed):
    """Forces and displacements are in the robot's frame, the surface is in the scene's."""
    state, rest = pressed[0], finger.touched.patches.rest
    assert state.converged
    np.testing.assert_array_equal(state.lambda_c, FORCES)
    np.testing.assert_array_equal(state.forces[finger.numbers].ravel(), FORCES)
    assert np.count_nonzero(state.forces.any(axis=1)) == 4
    np.testing.assert_allclose((state.places - rest)[finger.numbers].ravel(), state.delta_c, atol=1e-12)
    np.testing.assert_array_equal(finger.surface(state), state.places @ FLIP.T + finger.shift)
    np.testing.assert_array_equal(finger.surface(None), rest @ FLIP.T + finger.shift)
    np.testing.assert_allclose(finger.points, finger.surface(None)[finger.numbers])


def test_compliance_is_the_derivative_of_the_places_by_the_forces(finger, pressed):
    compliance = pressed[1]
    step = 1e-4 * np.random.default_rng(1).normal(size=12)
    ahead, behind = (finger.under(AT, FORCES + side * step)[0] for side in (1, -1))
    moved, expected = (ahead.delta_c - behind.delta_c) / 2, compliance @ step
    np.testing.assert_allclose(moved, expected, atol=1e-4 * np.abs(expected).max())
    np.testing.assert_allclose(compliance, compliance.T, atol=1e-12)


def test_slopes_by_the_actuators_are_those_of_one_energy(finger, pressed):
    """Psi - f x is an energy of actuators and forces f: points x move with the actuators as forces take off from those
    of the actuators."""
    here = pressed[0]
    step, h = 1e-4 * np.random.default_rng(2).normal(size=12), 1e-3
    ahead, behind = (finger.under(AT, FORCES + side * step)[0] for side in (1, -1))
    assert (ahead.lambda_a - behind.lambda_a) / 2 == pytest.approx(-here.by_actuators.T @ step, rel=1e-2)
    ahead, behind = (finger.under(displacement(AT.target + side * h), FORCES)[0] for side in (1, -1))
    np.testing.assert_allclose(
        (ahead.delta_c - behind.delta_c) / (2 * h), here.by_actuators[:, 0], rtol=1e-4, atol=1e-6
    )
    assert (ahead.lambda_a - behind.lambda_a) / (2 * h) == pytest.approx(here.stiffness.ravel(), rel=1e-4)


def test_slopes_of_two_actuators_are_told_apart(finger, pressed, monkeypatch):
    """A robot whose points and forces are known functions of its actuators, by its own differences."""
    A, B = np.random.default_rng(3).normal(size=(12, 2)), np.array([[2.0, 0.5], [0.5, 3.0]])
    model = SimpleNamespace(reach=np.array([[0.0, 4.0], [-2.0, 0.0]]))
    two = replace(finger, touched=SimpleNamespace(model=model, patches=finger.touched.patches))

    def loaded(self, delta, forces):
        answers = SimpleNamespace(pull=B @ delta + forces.sum(), error=0.0)
        places = {"places": np.zeros((1, 3)), "moved": A @ delta}
        return SimpleNamespace(answers=answers, **places, forces=forces, on_known=forces)

    monkeypatch.setattr(SurfaceFinger, "_loaded", loaded)
    monkeypatch.setattr(SurfaceFinger, "_moved", lambda self, loaded: loaded.moved)
    delta = np.array([1.0, -0.7])
    state = two._response(two._loaded(delta, FORCES), delta)
    np.testing.assert_allclose(state.by_actuators, A, atol=1e-9)
    np.testing.assert_allclose(state.stiffness, B, atol=1e-9)


def test_another_choice_of_points_is_the_same_state(finger, pressed):
    here = pressed[0]
    other = finger.touching(np.union1d(finger.numbers, [0, 7]))
    seen = other.seen(here, finger)
    there = np.searchsorted(other.numbers, finger.numbers)
    np.testing.assert_allclose(seen.delta_c.reshape(-1, 3)[there].ravel(), here.delta_c, atol=1e-12)
    np.testing.assert_array_equal(seen.lambda_c.reshape(-1, 3)[there].ravel(), here.lambda_c)
    assert seen.lambda_a == pytest.approx(here.lambda_a)
    assert other.inside(seen) and finger.distance(seen) == finger.distance(here)
    far = finger.under(AT, 100 * FORCES)[0]
    assert far.error > here.error and not finger.inside(far)


@pytest.fixture(scope="module")
def held(robot, nodes):
    """A block between two bars below and two above, side by side, which bend towards each other and press with one node
    each: finite elements and learned ones, after the grasp."""
    rest = nodes.patches.rest
    centre = np.array([rest[:, 0].max() - 2.0, 0.0, rest[:, 2].max() + GAP + HALF[2]])
    aside = [np.array([0.0, y, 0.0]) for y in (-ASIDE, ASIDE)]
    places = [(R, centre - R @ centre + y) for R in (np.eye(3), FLIP) for y in aside]
    surface = outer_surface(robot.X, robot.body.mesh.facets)
    points = at_nodes(robot.X, robot.body.mesh.facets, surface)

    def grip(fingers):
        load = np.array([0.0, 2e-4, -2e-4, 0, 0, 0])
        body = FreeObject(Box(HALF, t=centre), centre, load)
        plant = GripPlant(fingers, np.arange(5), body, "coulomb", MU, centre[None], np.full(4, 0.12), longest=0.05)
        assert plant.grasp() == "converged"
        return plant

    fe = [
        PlacedSurface.at_rest(SkinnedRobot(robot, surface.nodes, surface.triangles, points, R, t, itself=False))
        for R, t in places
    ]
    return grip(fe), grip([SurfaceFinger(nodes, R, t) for R, t in places])


def test_learned_bars_hold_a_block_as_finite_elements_do(held):
    fe, learned = held
    np.testing.assert_allclose(learned.forces(), fe.forces(), atol=0.02 * np.abs(fe.forces()).max())
    np.testing.assert_allclose(learned.last.around.x, fe.last.around.x, atol=0.01)
    assert all(finger.inside(state) for finger, state in zip(learned.fingers, learned.solved, strict=True))


def test_a_moment_turns_the_block_about_the_line_between_the_bars_as_in_finite_elements(held):
    """The moment is about the normal of the touched sides, where each robot alone would let it turn. What is off is how
    these forces change the compliance of a bar's end, of which the modes of this coarse skin know four fifths."""
    turned = []
    for plant in held:
        before = plant.last.around
        plant._held.load[5] = 0.03  # N mm about z
        assert plant.take(1.0) == "converged"
        turned.append((plant.last.around.R @ before.R.T)[1, 0])
    assert turned[1] == pytest.approx(turned[0], rel=0.15) and turned[0] > 1e-5
