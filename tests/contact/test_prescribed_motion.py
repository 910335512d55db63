"""Obstacles that move: where they are, how far they go, and what they carry."""

from types import SimpleNamespace

import numpy as np
import pytest

from cfem.contact.obstacle import ClosedMesh, Sphere
from cfem.contact.prescribed_motion import ActuatedRobot, Translation, between, stops
from cfem.contact.surface.closed_surface import ClosedSurface

WAY = np.array([[0.0, 0, 0], [3.0, 0, 0], [3.0, 4, 0]])
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])


def test_places_are_straight_between_those_that_are_stated():
    assert between(WAY, 0.25) == pytest.approx([1.5, 0, 0])
    assert between(WAY, 0.75) == pytest.approx([3, 2, 0])
    assert between(WAY, 1.0) == pytest.approx([3, 4, 0]) and between(WAY[:1], 0.7) == pytest.approx([0, 0, 0])


def test_a_rigid_body_carries_what_sticks_to_it():
    course = Translation(Sphere(2.0, t=np.array([0.0, 0, 9])), WAY)
    assert course.at(1.0).t == pytest.approx([3, 4, 9])
    assert course.carried(np.zeros((1, 3)), 1.0, 0.25)[0] == pytest.approx([-1.5, -4, 0])
    assert course.way(0.0, 1.0) == pytest.approx(7.0) == course.way(1.0, 0.0)  # round the corner


def test_steps_are_short_enough_and_lead_to_the_end():
    course = Translation(Sphere(2.0), WAY)
    found = stops([course], 0.0, 1.0, 0.5)
    assert found[0][0] == 0.0 and found[-1][1] == 1.0 and len(found) == 14
    assert all(course.way(*one) <= 0.6 for one in found)
    assert stops([Translation(Sphere(2.0), WAY[:1])], 0.0, 1.0, 0.5) == [] == stops([course], 0.3, 0.3, 0.5)


def test_another_robot_carries_what_sticks_to_its_surface():
    """A tetrahedron that grows with its one actuator, turned by a right angle about z."""
    model = SimpleNamespace(shape=lambda delta: CORNERS * (1 + delta[0]))
    turned = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    made = lambda x: ClosedMesh(ClosedSurface(x, FACES))  # noqa: E731
    course = ActuatedRobot(model, np.array([[0.0], [2.0]]), made, turned, np.array([0.0, 0, 5]))
    point = np.array([[-0.25, 0.5, 5.0]])  # on the face below, at (0.5, 0.25, 0) of its own
    assert course.at(0.0).distance(point)[0] == pytest.approx(0.0, abs=1e-12)
    assert course.carried(point, 0.0, 1.0)[0] == pytest.approx([-0.75, 1.5, 5.0])
    assert course.way(0.0, 1.0) == pytest.approx(2.0)
