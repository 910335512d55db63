"""A cable in the channel of a rod: its derivatives, its length on an arc, and the polygon that it is the limit of."""

import numpy as np
import pytest
from support.rods import rod_body

from cfem.constraint.rod_cable import make_rod_cable
from cfem.equilibrium.friction.guides import slipping
from cfem.mechanics.rod.element import screw


def strains(body, seed=0, size=0.2):
    return size * np.random.default_rng(seed).standard_normal((len(body.rod.length), 6))


def test_derivatives_are_those_of_the_length():
    body = rod_body(5)
    cable = make_rod_cable(body.rod, np.array([[0, 0.5, 0.8], [30, 0.2, 0.3], [70, -0.4, 0.1]]), "c")
    e, h = strains(body), 1e-5
    at = cable.strained(e)
    for element, part in ((0, 4), (1, 5), (2, 3), (3, 0), (3, 1), (4, 4)):
        step = np.zeros_like(e)
        step[element, part] = h
        ahead, behind = cable.strained(e + step), cable.strained(e - step)
        assert (ahead.value - behind.value) / (2 * h) == pytest.approx(at.by_e[element, part], abs=1e-9)
        slope = (ahead.by_e - behind.by_e)[element] / (2 * h)
        np.testing.assert_allclose(slope, at.second[element][:, part], atol=1e-9)


def test_on_an_arc_it_is_an_arc():
    body = rod_body(4)
    cable = make_rod_cable(body.rod, np.array([[0, 0, 0.7], [100, 0, 0.7]]), "c")
    e = np.zeros((4, 6))
    e[:, 4] = -0.3  # radius 25 / 0.3 about -y: the side of +z is inside
    assert cable.strained(e).value == pytest.approx(4 * 0.7 * 0.3)


def test_it_is_the_limit_of_polygons():
    """Of points that the sections between the ends of an element carry, on the screw that it is bent to."""
    body, e = rod_body(1), np.array([[3.0, 1.0, -2.0, 0.5, 0.9, -0.4]])
    cable = make_rod_cable(body.rod, np.array([[10, 0.5, 0.8], [90, -0.6, 0.3]]), "c")
    shares = np.linspace(0.1, 0.9, 2001)
    h = body.rod.length[0]
    p, turn = screw(shares[:, None] * e, shares * h)
    r = np.array([0.5, 0.8]) + ((shares - 0.1) / 0.8)[:, None] * np.array([-1.1, -0.5])
    points = p + (turn @ np.column_stack([np.zeros(len(r)), r])[:, :, None])[:, :, 0]
    length = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
    assert cable.rest_length - cable.strained(e).value == pytest.approx(length, rel=2e-6)


def test_slipping_loses_tension_by_the_angle_turned():
    body = rod_body(10)
    cable = make_rod_cable(body.rod, np.array([[0, 0, 0.0], [100, 0, 0.0]]), "c", friction=0.3)
    angle = 1.2
    along = np.linspace(0, angle, 11)
    centres = 100 / angle * np.column_stack([np.sin(along), np.zeros(11), 1 - np.cos(along)])
    x = body.mesh.X.copy()
    for nodes, centre, a in zip(body.sections.nodes, centres, along, strict=True):
        turn = np.array([[np.cos(a), 0, -np.sin(a)], [0, 1, 0], [np.sin(a), 0, np.cos(a)]])
        x[nodes] = centre + (body.mesh.X[nodes] - body.mesh.X[nodes].mean(axis=0)) @ turn.T
    for way in (1, -1):
        shares = slipping(cable, x, way)
        assert shares[-1] == pytest.approx(np.exp(-way * 0.3 * angle), rel=0.02)
        assert (np.diff(shares) * way < 0).all()
