"""Smallest distances of surfaces to obstacles, against closed forms and against many points of the surface."""

from itertools import cycle, product

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.closed import box_arrays, octahedral_sphere
from support.fast_cases import fast_are

from cfem.contact.clearance import nearest_of_surface
from cfem.contact.obstacle import Box, Capsule, ClosedMesh, Plane, Sphere
from cfem.contact.surface.closed_surface import ClosedSurface

DIRECTIONS, TRIANGLES = octahedral_sphere(3)
SHAPES = {
    "plane": Plane(),
    "sphere": Sphere(2.0),
    "box": Box(np.array([1.0, 2.0, 3.0])),
    "capsule": Capsule(1.0, 2.5),
    "mesh": ClosedMesh(ClosedSurface(DIRECTIONS * (2 + np.sin(4 * DIRECTIONS[:, :1])), TRIANGLES)),
}


@pytest.mark.parametrize("name, away", fast_are(zip(SHAPES, cycle([8.0, 3.0])), product(SHAPES, [8.0, 3.0])))
def test_no_point_of_the_surface_is_nearer(name, away):
    """A coarse potato beside the obstacle, or into it, of triangles as large as the obstacle's edges."""
    rng = np.random.default_rng(3)
    directions, triangles = octahedral_sphere(1)
    nodes = 3 * directions * rng.uniform(0.8, 1.2, (len(directions), 1)) + [0, 0, away]
    turn = Rotation.random(rng=rng).as_matrix() if name != "plane" else np.eye(3)
    shape = SHAPES[name]
    obstacle = type(shape)(**{**vars(shape), "R": turn}) if name != "mesh" else ClosedMesh(shape.surface, R=turn)
    found = nearest_of_surface(nodes, triangles, obstacle, 1e-3)
    shares = np.vstack([rng.dirichlet(np.ones(3), 2000), np.eye(3)])
    sampled = obstacle.distance((shares @ nodes[triangles]).reshape(-1, 3)).min()
    assert found.at_least <= found.distance <= obstacle.distance(nodes).min()
    assert found.distance - found.at_least <= 1e-3 + 1e-12
    assert found.at_least - 1e-12 <= sampled < found.distance + 0.05
    np.testing.assert_allclose(found.shares @ nodes[triangles[found.triangle]], found.place, atol=1e-12)
    assert obstacle.distance(found.place[None])[0] == pytest.approx(found.distance, abs=1e-9)
    np.testing.assert_allclose(obstacle.normals(found.place[None])[0], found.normal, atol=1e-12)


def test_between_the_nodes_of_a_face():
    """The corner of a box, a ball and a mesh above the middle of a face whose nodes are far away."""
    nodes, triangles = box_arrays([-50, -50, -10], [50, 50, 0])
    tilted = Rotation.from_rotvec(np.arctan(np.sqrt(2)) * np.array([1, -1, 0]) / np.sqrt(2)).as_matrix()  # corner down
    corner = Box(np.full(3, 2.0), R=tilted, t=np.array([3.0, 4.0, 5.0]))
    surface = ClosedSurface(*box_arrays([-2, -2, -2], [2, 2, 2]))
    expected = 5 - 2 * np.sqrt(3)
    ball = Sphere(1.0, t=np.array([7.0, -9.0, 5.0]))
    for obstacle, distance in ((corner, expected), (ball, 4.0), (ClosedMesh(surface, R=tilted, t=corner.t), expected)):
        found = nearest_of_surface(nodes, triangles, obstacle)
        assert found.distance == pytest.approx(distance, abs=1e-3)
        np.testing.assert_allclose(found.normal, [0, 0, -1], atol=1e-2)
    np.testing.assert_allclose(nearest_of_surface(nodes, triangles, ball, 1e-6).place[:2], [7, -9], atol=0.01)


def test_flat_on_flat_ends_with_what_is_certain():
    nodes, triangles = box_arrays([-5, -5, 0], [5, 5, 1])
    for gap in (0.5, 0.0):
        below = ClosedMesh(ClosedSurface(*box_arrays([-6, -6, -1 - gap], [6, 6, -gap])))
        found = nearest_of_surface(nodes, triangles, below, 1e-2)
        assert found.distance == pytest.approx(gap, abs=1e-12) and found.at_least > gap - 0.5
