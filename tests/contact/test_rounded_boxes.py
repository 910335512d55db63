"""Rounded boxes at many points, against brute force and finite differences."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cfem.contact.obstacle import Box, Capsule, Plane, Sphere
from cfem.contact.rounded_boxes import Boxes, bends, frames, nearest


def boxes(count=6, seed=2):
    """Boxes with round edges, sharp ones, capsules and spheres."""
    rng = np.random.default_rng(seed)
    core = rng.uniform(0.5, 2.0, (count, 3))
    core[-2], core[-1] = [0.0, 0.0, 1.5], 0.0
    rounding = rng.uniform(0.3, 1.0, count)
    rounding[0] = 0.0
    reach = np.linalg.norm(core, axis=1) + rounding
    turns = Rotation.random(count, rng=rng).as_matrix()
    return Boxes(turns, 4 * rng.normal(size=(count, 3)), core, rounding, np.zeros(count, dtype=bool), reach)


def distance(made, o, x):
    """From the nearest point of the box without its round edges."""
    s = made.R[o].T @ (x - made.t[o])
    inside = np.clip(s, -made.core[o], made.core[o])
    return np.linalg.norm(s - inside) - made.rounding[o]


def outside(made, count=400):
    rng = np.random.default_rng(5)
    points, numbers = made.t[rng.integers(len(made.t), size=count)] + 3 * rng.normal(size=(count, 3)), None
    numbers = rng.integers(len(made.t), size=count)
    away = np.array([distance(made, o, x) + made.rounding[o] for o, x in zip(numbers, points, strict=True)])
    return numbers[away > 0.05], points[away > 0.05]


def test_normals_are_gradients_and_their_slopes_are_bends():
    made, h = boxes(), 1e-6
    numbers, points = outside(made)
    assert len(points) > 200
    normals, slopes = frames(made, numbers, points)[:, 0], bends(made, numbers, points)
    for axis, step in enumerate(h * np.eye(3)):
        ends = [
            np.array([distance(made, o, x + sign * step) for o, x in zip(numbers, points, strict=True)])
            for sign in (1, -1)
        ]
        np.testing.assert_allclose(normals[:, axis], (ends[0] - ends[1]) / (2 * h), atol=1e-7)
        ahead, behind = (frames(made, numbers, points + sign * step)[:, 0] for sign in (1, -1))
        expected = np.where(made.rounding[numbers, None] > 0, (ahead - behind) / (2 * h), 0.0)
        np.testing.assert_allclose(slopes[:, :, axis], expected, atol=1e-6)
    of_edges = np.linalg.norm(slopes, axis=(1, 2)) > 0
    assert of_edges.any() and not of_edges.all()  # flat sides do not bend


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("shape", [Sphere(2.0), Capsule(2.0, 1.5), Box(np.array([1.0, 1.0, 1.0]))])
def test_normals_turn_on_the_axes_of_a_shape_as_beside_them(shape, axis):
    """A ball has no place where it is flat, a capsule none but along its axis, and a box nothing else than faces."""
    made, point, h = Boxes.of([shape]), np.full((1, 3), 0.0), 1e-6
    point[0, axis] = -5.0
    number, sides = np.zeros(1, dtype=int), h * np.eye(3)
    ends = [np.array([frames(made, number, point + sign * step)[0, 0] for step in sides]) for sign in (1, -1)]
    np.testing.assert_allclose(bends(made, number, point)[0].T, (ends[0] - ends[1]) / (2 * h), atol=1e-9)


def test_within_the_core_the_normal_does_not_turn():
    made = boxes()
    assert not bends(made, np.arange(6), made.t).any()


@pytest.mark.parametrize("farthest", [np.inf, 2.0])
def test_the_nearest_box_is_that_of_brute_force(farthest):
    made, points = boxes(), 6 * np.random.default_rng(8).normal(size=(300, 3))
    alone = np.array([[distance(made, o, x) for o in range(6)] for x in points])
    out = (alone > -made.rounding + 1e-9).all(axis=1)  # within a core the way out is another
    found, which = nearest(made, points, farthest)
    np.testing.assert_allclose(found[out], np.minimum(alone.min(axis=1), farthest)[out], atol=1e-12)
    known = out & (alone.min(axis=1) < farthest)
    np.testing.assert_array_equal(which[known], alone.argmin(axis=1)[known])
    assert known.sum() > 20


def test_arrays_are_those_of_the_obstacles():
    turn = Rotation.from_euler("z", 30, degrees=True).as_matrix()
    made = Boxes.of([Plane(), Sphere(2.0), Box(np.array([3.0, 4.0, 12.0]), R=turn), Capsule(1.0, 2.5, t=np.ones(3))])
    np.testing.assert_array_equal(made.below, [True, False, False, False])
    np.testing.assert_allclose(made.reach, [np.inf, 2.0, 13.0, 3.5])
    np.testing.assert_allclose(made.core[2:], [[3, 4, 12], [0, 0, 2.5]])
    np.testing.assert_allclose(made.rounding, [0, 2, 0, 1])
    np.testing.assert_allclose(made.R[2], turn)
    np.testing.assert_allclose(made.t[3], 1.0)


def test_frames_are_orthonormal_and_right_handed():
    made = boxes()
    numbers, points = outside(made)
    turned = frames(made, numbers, points)
    np.testing.assert_allclose(turned @ turned.swapaxes(1, 2), np.broadcast_to(np.eye(3), turned.shape), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(turned), 1.0)
