"""Compliance of all nodes of a surface, against what finite elements with every node as a contact point say."""

from dataclasses import replace

import numpy as np
import pytest

from cfem.constraint.contact import make_contact
from cfem.equilibrium.contact.node_compliance import node_response
from cfem.equilibrium.contact.patch_compliance import patch_response
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import displacement
from cfem.equilibrium.system.problem import Problem
from cfem.mechanics.surface_turns import members_of, rotations, spread
from cfem.predict.contact.surface.node_model import node_patches
from cfem.predict.load import load_model
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh

STATES = np.array([[0.5], [3.0]])
NEAR = 12.0  # mm


@pytest.fixture(scope="module")
def model(bar):
    return load_model(bar / "models" / "bar" / "spectral")


@pytest.fixture(scope="module")
def robot(bar):
    return build_robot(*load_scene_and_mesh(bar / "pipelines" / "bar" / "scene.yaml"))


@pytest.fixture(scope="module")
def response(model, robot):
    return node_response(robot, model.skin.watched, STATES, np.array([0, 1]), 30, NEAR, 12.0)


@pytest.fixture(scope="module")
def exact(model, robot):
    return patch_response(robot, model.skin.watched, node_patches(model), STATES)


@pytest.fixture(scope="module")
def turns(model, robot):
    """Of each state, rotations of the nodes by finite elements."""
    skin, found, start = model.skin, [], None
    members = members_of(skin.triangles, np.arange(len(skin.rest)), len(skin.rest))
    for delta in STATES:
        solved = solve(Problem(robot), displacement(delta), start, slack=False)
        assert solved.converged
        found.append(rotations(spread(members, skin.rest, solved.state.x[skin.nodes])))
    return found


@pytest.mark.parametrize("number", [0, 1])
def test_pairs_that_are_near_have_the_compliance_of_finite_elements(model, response, exact, turns, number):
    k, m = response.modes.shape[1], len(model.skin.rest)
    modes, R = response.modes.astype(float).reshape(m, 3, k), turns[number]
    own, (i, j) = exact.own[number].reshape(m, 3, m, 3), response.pairs.T
    by_modes = modes[i] @ response.by_modes[number] @ modes[j].swapaxes(1, 2)
    found = R[i] @ (by_modes + response.left[number]) @ R[j].swapaxes(1, 2)
    assert (np.linalg.norm(model.skin.rest[i] - model.skin.rest[j], axis=1) <= NEAR).all() and len(i) > 4 * m
    assert found == pytest.approx(
        own[i, :, j], abs=2e-4 * np.abs(own).max()
    )  # the learned surface turns by so much else


def test_modes_leave_little_between_nodes_that_are_far_from_each_other(model, response, exact, turns):
    k, m = response.modes.shape[1], len(model.skin.rest)
    modes = (turns[0] @ response.modes.reshape(m, 3, k)).reshape(3 * m, k)
    left = (exact.own[0] - modes @ response.by_modes[0] @ modes.T).reshape(m, 3, m, 3)
    far = np.linalg.norm(model.skin.rest[:, None] - model.skin.rest, axis=2) > NEAR
    assert np.abs(left.swapaxes(1, 2)[far]).max() < 0.02 * np.abs(exact.own[0]).max()


def test_the_tip_follows_forces_on_nodes(model, response, exact, turns):
    m = len(model.skin.rest)
    for number in range(len(STATES)):
        tip = (response.tip[number].reshape(-1, m, 1, 3) @ turns[number].swapaxes(1, 2)).reshape(-1, 3 * m)
        assert tip == pytest.approx(exact.tip[number], abs=1e-6 * np.abs(exact.tip[number]).max())


def test_contact_points_that_the_scene_names_hold_nothing(model, robot, response):
    """They did: the force of a finger with three of them on a ball was 8 to 12 times too large."""
    named = make_contact(robot.body.mesh, np.array([50.0, 0.0, 5.0]), 2.0, "named")
    names = tuple(f"named.{axis}" for axis in "xyz")
    touching = replace(robot, contacts=(named,), rows=replace(robot.rows, contacts=names))
    same = node_response(touching, model.skin.watched, STATES, np.array([0, 1]), 30, NEAR, 12.0)
    np.testing.assert_array_equal(same.by_modes, response.by_modes)
    np.testing.assert_array_equal(same.left, response.left)
