from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from support.closed import octahedral_sphere

from cfem.contact.obstacle import Box, Capsule, ClosedMesh, Cylinder, Ellipsoid, Plane, Sphere, tangents
from cfem.contact.surface.closed_surface import ClosedSurface
from cfem.core.errors import SpecError

DIRECTIONS, TRIANGLES = octahedral_sphere(2)
RUGGED = ClosedMesh(ClosedSurface(DIRECTIONS * (3 + np.sin(4 * DIRECTIONS[:, :1])), TRIANGLES))
CURVED = [Cylinder(1.5, 2.0), Ellipsoid(np.array([1.0, 2.0, 3.0]))]
CONVEX = [Plane(), Sphere(2.0), Box(np.array([1.0, 2.0, 3.0])), Capsule(1.0, 2.5), *CURVED]
SHAPES = [*CONVEX, RUGGED]


def posed(shape, seed: int):
    rng = np.random.default_rng(seed)
    return replace(shape, R=Rotation.random(rng=rng).as_matrix(), t=3 * rng.normal(size=3)), rng


@settings(max_examples=50, deadline=None)
@given(st.sampled_from(SHAPES), st.integers(0, 10**6))
def test_normals_are_the_gradient_of_the_distance(shape, seed):
    obstacle, rng = posed(shape, seed)
    points = obstacle.t + 4 * rng.normal(size=(20, 3))
    h = 1e-5
    steps = h * np.eye(3)
    sides = [[obstacle.distance(points + sign * step) for step in steps] for sign in (1, -1)]
    gradient = (np.subtract(*sides) / (2 * h)).T
    second = np.abs(np.sum(sides, axis=0) - 2 * obstacle.distance(points)).max(axis=0) / h**2
    smooth = second < 1e2  # a kink between the samples shows as a curvature of 1 / h
    assert smooth.sum() >= 15
    np.testing.assert_allclose(obstacle.normals(points)[smooth], gradient[smooth], atol=1e-7)


@settings(max_examples=50, deadline=None)
@given(st.sampled_from(SHAPES), st.integers(0, 10**6))
def test_the_distance_is_the_way_to_the_surface(shape, seed):
    obstacle, rng = posed(shape, seed)
    points = obstacle.t + 4 * rng.normal(size=(20, 3))
    distance = obstacle.distance(points)
    foot = points - distance[:, None] * obstacle.normals(points)
    np.testing.assert_allclose(obstacle.distance(foot), 0.0, atol=1e-12)
    # Nothing nearer: the distance is 1-Lipschitz.
    others = points + rng.normal(size=points.shape)
    assert (np.abs(obstacle.distance(others) - distance) <= np.linalg.norm(others - points, axis=1) + 1e-12).all()


@pytest.mark.parametrize("shape", CURVED)
def test_bends_are_the_slope_of_the_normals(shape):
    obstacle, rng = posed(shape, 3)
    points, h = obstacle.t + 4 * rng.normal(size=(60, 3)), 1e-5
    sides = [[obstacle.normals(points + sign * step) for step in h * np.eye(3)] for sign in (1, -1)]
    slopes = (np.subtract(*sides) / (2 * h)).transpose(1, 2, 0)
    s = (points - obstacle.t) @ obstacle.R
    smooth = np.ones(60, dtype=bool)
    if isinstance(shape, Cylinder):  # of its rim nothing is known
        smooth = (np.hypot(s[:, 0], s[:, 1]) < 1.45) | (np.abs(s[:, 2]) < 1.95)
    assert smooth.sum() > 10
    np.testing.assert_allclose(obstacle.bends(points)[smooth], slopes[smooth], atol=1e-7)
    assert np.abs(slopes[smooth]).max() > 0.1


@settings(max_examples=50, deadline=None)
@given(st.sampled_from(SHAPES), st.integers(0, 10**6))
def test_frames_are_right_handed_and_start_with_the_normal(shape, seed):
    obstacle, rng = posed(shape, seed)
    points = obstacle.t + 4 * rng.normal(size=(20, 3))
    frames = obstacle.frames(points)
    np.testing.assert_allclose(frames @ frames.transpose(0, 2, 1), np.tile(np.eye(3), (20, 1, 1)), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(frames), 1.0)
    np.testing.assert_allclose(frames[:, 0], obstacle.normals(points), atol=1e-12)


def test_frames_change_little_over_a_small_turn_of_the_normal():
    polar, around = np.meshgrid(np.linspace(0, 2.9, 100), np.linspace(0, 2 * np.pi, 100), indexing="ij")
    normals = np.stack([np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar)], axis=-1)
    frames = tangents(normals.reshape(-1, 3)).reshape(100, 100, 3, 3)
    assert np.abs(np.diff(frames, axis=0)).max() < 0.05
    assert np.abs(np.diff(frames, axis=1)).max() < 0.2


@pytest.mark.parametrize(
    ("shape", "point", "distance"),
    [
        (Plane(), [5.0, 1.0, -2.0], -2.0),
        (Sphere(2.0), [0.0, 0.0, 0.0], -2.0),
        (Sphere(2.0), [0.0, 3.0, 4.0], 3.0),
        (Box(np.array([1.0, 2.0, 3.0])), [4.0, 6.0, 3.0], 5.0),
        (Box(np.array([1.0, 2.0, 3.0])), [0.5, 0.0, 0.0], -0.5),
        (Box(np.array([1.0, 2.0, 3.0])), [1.0, 2.0, 3.0], 0.0),
        (Capsule(1.0, 2.5), [0.0, 0.0, 2.0], -1.0),
        (Capsule(1.0, 2.5), [3.0, 0.0, 6.5], 4.0),
        (Cylinder(1.5, 2.0), [0.0, 0.0, 0.5], -1.5),
        (Cylinder(1.5, 2.0), [0.0, 4.5, 6.0], 5.0),
        (Ellipsoid(np.array([1.0, 2.0, 3.0])), [0.0, 0.0, 0.0], -1.0),
        (Ellipsoid(np.array([1.0, 2.0, 3.0])), [0.0, -5.0, 0.0], 3.0),
        (Ellipsoid(np.full(3, 2.0)), [0.0, 3.0, 4.0], 3.0),
    ],
)
def test_known_distances(shape, point, distance):
    assert shape.distance(np.array([point])) == pytest.approx(distance)
    assert np.linalg.norm(shape.normals(np.array([point]))) == pytest.approx(1.0)


@settings(max_examples=25, deadline=None)
@given(st.sampled_from(SHAPES), st.integers(0, 10**6), st.sampled_from([0.1, 1.0, 5.0]))
def test_no_point_of_a_triangle_is_nearer_than_its_bound(shape, seed, size):
    obstacle, rng = posed(shape, seed)
    corners = obstacle.t + 5 * rng.normal(size=(20, 1, 3)) + size * rng.normal(size=(20, 3, 3))
    centre, bound = obstacle.at_least(corners)
    np.testing.assert_allclose(centre, obstacle.distance(corners.mean(axis=1)), atol=1e-12)
    shares = np.vstack([rng.dirichlet(np.full(3, 0.5), 60), np.eye(3)])
    inside = (shares @ corners).reshape(-1, 3)
    assert (obstacle.distance(inside).reshape(20, -1) >= bound[:, None] - 1e-11).all()
    assert (bound >= centre - np.linalg.norm(corners - corners.mean(axis=1)[:, None], axis=2).max(axis=1) - 1e-12).all()


@pytest.mark.parametrize("shape", CONVEX)
def test_a_convex_shape_has_a_convex_distance(shape):
    obstacle, rng = posed(shape, 5)
    one, other = obstacle.t + 4 * rng.normal(size=(2, 500, 3))
    share = rng.uniform(size=500)
    between = share[:, None] * one + (1 - share[:, None]) * other
    mean = share * obstacle.distance(one) + (1 - share) * obstacle.distance(other)
    assert (obstacle.distance(between) <= mean + 1e-12).all()


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Sphere(1.0, R=-np.eye(3)), "not a rotation"),
        (lambda: Plane(t=np.array([0, np.nan, 0])), "finite"),
        (lambda: Sphere(0.0), "radius of a sphere"),
        (lambda: Capsule(-1.0, 1.0), "radius of a capsule"),
        (lambda: Capsule(1.0, -1.0), "half length"),
        (lambda: Box(np.array([1.0, 0.0, 1.0])), "half extents"),
        (lambda: Box(np.array([1.0, 1.0])), "half extents"),
    ],
)
def test_an_obstacle_that_cannot_be_is_refused(make, words):
    with pytest.raises(SpecError, match=words):
        make()
