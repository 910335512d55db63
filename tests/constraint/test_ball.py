"""The quadrature over a ball, against integrals that are known."""

import itertools
from math import factorial, prod

import numpy as np
import pytest
from constraint.meshes import bricks
from support.blocks import block

from cfem.constraint.ball import points_in_ball

MESHES = {"tet4": block((20, 10, 10), (4, 2, 2), distort=0.2), "hex8": bricks((20, 10, 10), (4, 2, 2), distort=0.3)}


def whole(mesh):
    """The points of a ball that holds all of the mesh."""
    return points_in_ball(mesh, np.array([10.0, 5, 5]), 400.0, np.arange(len(mesh.cells)))


def test_the_rule_of_a_tetrahedron_is_of_degree_5():
    """Over the tetrahedron at the origin: a! b! c! / (a + b + c + 3)! (Stroud 1971)."""
    mesh = block((1, 1, 1), (1, 1, 1))
    cell = next(i for i, c in enumerate(mesh.cells) if np.ptp(mesh.X[c], axis=0).all())
    mesh.X[mesh.cells[cell]] = np.vstack([np.zeros(3), np.eye(3)])
    _, _, places, volumes = points_in_ball(mesh, np.zeros(3), 20.0, np.array([cell]))
    assert len(places) == 14
    for powers in itertools.product(range(6), repeat=3):
        if sum(powers) <= 5:
            exact = prod(map(factorial, powers)) / factorial(sum(powers) + 3)
            assert (volumes * (places**powers).prod(axis=1)).sum() == pytest.approx(exact, rel=1e-13), powers


@pytest.mark.parametrize("mesh", MESHES.values(), ids=MESHES)
def test_the_points_of_a_large_ball_fill_the_body(mesh):
    cells, _, places, volumes = whole(mesh)
    assert volumes.sum() == pytest.approx(2000, rel=1e-12)
    assert (volumes @ places / volumes.sum()) == pytest.approx([10, 5, 5], rel=1e-12)
    assert set(cells) == set(range(len(mesh.cells)))


@pytest.mark.parametrize("mesh", MESHES.values(), ids=MESHES)
@pytest.mark.parametrize("part, point", [(1, [6.0, 5, 5]), (2, [6.0, 0, 5]), (4, [6.0, 10, 0]), (8, [0.0, 0, 0])])
def test_the_bump_over_a_ball_and_over_what_faces_and_corners_leave_of_it(mesh, part, point):
    """Of (1 - r^2)^2 over the unit ball: 32 pi / 105."""
    for radius in (0.4, 1.7, 3.0):
        _, _, places, volumes = points_in_ball(mesh, np.array(point), radius, np.arange(len(mesh.cells)))
        r = np.linalg.norm(places - point, axis=1) / radius
        exact = 32 * np.pi / 105 * radius**3 / part
        assert (volumes * (1 - r**2) ** 2).sum() == pytest.approx(exact, rel=2e-4)


def test_only_the_cells_that_are_asked_for():
    mesh = MESHES["tet4"]
    left = np.flatnonzero(mesh.X[mesh.cells].mean(axis=1)[:, 0] < 10)
    cells, _, _, _ = points_in_ball(mesh, np.array([10.0, 5, 5]), 3.0, left)
    assert set(cells) <= set(left)
