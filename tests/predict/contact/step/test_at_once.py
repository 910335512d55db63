"""Rounds in one call, against the same rounds call by call."""

from dataclasses import replace

import numpy as np
import pytest

from cfem.contact.obstacle import Box, Plane, Sphere
from cfem.contact.obstacle_set import ObstacleSet
from cfem.contact.rigid_bodies import RigidBodies
from cfem.predict.contact.step.at_once import UnpressedScene
from cfem.predict.contact.step.bodies import PlacedModel
from cfem.predict.contact.step.on_obstacles import OnObstacles
from cfem.predict.contact.step.scene import ContactScene, contact_step

DELTA = np.array([2.0])
SHAPES = {"plate": Plane(), "box": Box(np.array([12.0, 12.0, 5.0])), "ball": Sphere(6.0)}


def rigid(along, obstacles):
    """The robot and the first obstacle are on bodies that give way, and that are pushed."""
    mobility = np.diag(np.tile([0.5, 0.5, 0.5, 1e-3, 1e-3, 1e-3], 2))
    before = np.zeros(12)
    before[2] = 0.02
    of_obstacles = np.arange(obstacles)
    return RigidBodies(
        np.array([[0.0, 0.0, 0.0], along]), mobility, before, np.array([0]), np.where(of_obstacles, -1, 1)
    )


def pressed(model, shape, mu):
    """States of a bar on which an obstacle sinks by 0.1 mm a step, and then goes aside; another is far away."""
    places = contact_step(model, DELTA, ()).places
    top, states, state = places[places[:, 2].argmax()], [], None
    turn = np.diag([1.0, -1.0, -1.0])
    half = {"plate": 0.0, "box": 5.0, "ball": 6.0}[shape]
    for down, aside in [(-0.5, 0.0), *[(0.1 * i, 0.0) for i in range(1, 5)], (0.4, 0.05), (0.4, 0.3), (-1.0, 0.3)]:
        at = top + [0.0, aside, half - down]
        obstacles = ObstacleSet((replace(SHAPES[shape], R=turn, t=at), Sphere(1.0, t=np.array([0.0, 0.0, 300.0]))))
        robot = PlacedModel(model, itself=False)
        state = ContactScene([robot], obstacles, mu, rigid(at, 2), even=True).step([DELTA], state)
        states.append(state)
    return states


@pytest.mark.parametrize("mu", [0.0, 0.3])
@pytest.mark.parametrize("shape", list(SHAPES))
def test_they_end_where_rounds_in_parts_do(patched_bar, monkeypatch, shape, mu):
    asked, lawful = [], OnObstacles.lawful
    monkeypatch.setattr(OnObstacles, "lawful", lambda *given: asked.append(0) or lawful(*given))
    at_once, parts = pressed(patched_bar, shape, mu), len(asked)
    monkeypatch.setattr(UnpressedScene, "of", lambda scene: None)
    in_parts = pressed(patched_bar, shape, mu)
    assert parts <= 2 < len(asked) - parts or shape == "ball"  # which turns the forces that slide along it
    for one, other in zip(at_once, in_parts, strict=True):
        assert one.converged and other.converged and one.iterations == other.iterations
        assert one.modes == other.modes and one.deep == other.deep
        for name in ("forces", "change", "places", "stuck", "given", "push"):
            np.testing.assert_allclose(getattr(one, name), getattr(other, name), atol=1e-10, err_msg=name)
        for mine, its in zip(one.answers, other.answers, strict=True):
            np.testing.assert_allclose(mine, its, atol=1e-10)
        for name in ("known", "near", "met", "sticks"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
        for name in ("R", "t"):
            np.testing.assert_allclose(getattr(one, name), getattr(other, name), atol=1e-12)
            np.testing.assert_allclose(getattr(one.obstacles, name), getattr(other.obstacles, name), atol=1e-12)
    assert max(np.abs(state.forces).max() for state in at_once) > 0.005 and not at_once[-1].forces.any()
