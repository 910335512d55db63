"""Several obstacles asked together say what each says alone."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.closed import octahedral_sphere

from cfem.contact.obstacle import Box, Capsule, ClosedMesh, Plane, Sphere
from cfem.contact.obstacle_set import ObstacleSet
from cfem.contact.surface.closed_surface import ClosedSurface

MESH = ClosedMesh(ClosedSurface(*octahedral_sphere(1)))
SHAPES = [Plane(), Sphere(2.0), MESH, Box(np.array([1.0, 2.0, 3.0])), Capsule(1.0, 2.5), Plane()]


def world(shapes):
    rng = np.random.default_rng(3)
    posed = [replace(one, R=Rotation.random(rng=rng).as_matrix(), t=6 * rng.normal(size=3)) for one in shapes]
    return ObstacleSet(tuple(posed)), 8 * rng.normal(size=(200, 3))


@pytest.mark.parametrize("shapes", [SHAPES, SHAPES[:2], [MESH, MESH], [SHAPES[4]]])
def test_each_point_meets_the_obstacle_that_is_nearest(shapes):
    several, points = world(shapes)
    distance, which = several.nearest(points)
    alone = np.array([one.distance(points) for one in several.obstacles])
    np.testing.assert_allclose(distance, alone.min(axis=0), atol=1e-12)
    np.testing.assert_array_equal(which, alone.argmin(axis=0))
    bounded = several.nearest(points, 2.0)
    np.testing.assert_array_equal(bounded[0], np.minimum(distance, 2.0))
    np.testing.assert_array_equal(bounded[1][distance < 2.0], which[distance < 2.0])
    frames = np.array([several.obstacles[i].frames(x[None])[0] for i, x in zip(which, points, strict=True)])
    np.testing.assert_allclose(several.frames(which, points), frames, atol=1e-12)


def test_bends_are_the_derivative_of_the_normals():
    several, points = world(SHAPES[1:5])
    which, h = several.nearest(points)[1], 1e-6
    sides = [[several.frames(which, points + sign * h * axis)[:, 0] for axis in np.eye(3)] for sign in (1, -1)]
    slopes = np.moveaxis(np.subtract(*sides) / (2 * h), 0, 2)
    rounded = np.array([isinstance(several.obstacles[i], Sphere | Capsule) for i in which])
    expected = np.where(rounded[:, None, None], slopes, 0.0)  # a mesh is flat, and so is a box but at its edges
    assert rounded.sum() > 20
    np.testing.assert_allclose(several.bends(which, points), expected, atol=1e-7)


FAR = replace(MESH, t=np.array([0.0, 0.0, 99.0]))  # with a mesh, obstacles are asked one by one


@pytest.mark.parametrize("others", [(), (FAR,)])
@pytest.mark.parametrize(("depth", "deep"), [(-0.5, False), (0.0, False), (0.4, False), (0.6, True)])
def test_a_point_is_deep_where_twice_as_far_in_another_side_is_nearer(depth, deep, others):
    """A plate 2 mm thick: the middle is 1 mm below either side."""
    R = Rotation.from_rotvec([0.3, -0.7, 0.2]).as_matrix()
    plate = ObstacleSet((Box(np.array([9.0, 9.0, 1.0]), R=R, t=np.ones(3)), *others))
    places = np.array([[0.0, 0.0, 1.0 - depth], [50.0, 0.0, 0.0], [1.0, 0.0, 0.9]]) @ R.T + 1.0
    distance, which = plate.nearest(places)
    assert plate.deep(which, places, distance, 0.7) == deep


def test_a_half_space_has_no_other_side():
    ground, places = ObstacleSet((Plane(),)), np.array([[0.0, 0.0, -0.9], [1.0, 0.0, -0.3]])
    distance, which = ground.nearest(places)
    assert (distance < 0).all() and not ground.deep(which, places, distance, 0.7)
