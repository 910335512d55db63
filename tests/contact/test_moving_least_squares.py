"""Planes before points and the faces near them, against NumPy's own least squares and a search of all pairs."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from cfem.contact.detection import NEVER, OTHER, OWN, MayMeet
from cfem.contact.moving_least_squares import OPPOSED, WITHIN, kernel, near_faces, planes_before


def cloud(seed, count=60):
    """Places, normals, distances to neighbours from 0.3 to 3 mm, and who may meet whom by 12 regions."""
    rng = np.random.default_rng(seed)
    places, normals = rng.uniform(-5, 5, (count, 3)), rng.standard_normal((count, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    codes = rng.choice([NEVER, OWN, OTHER], (12, 12))
    regions = rng.integers(0, 12, count)
    return places, normals, rng.uniform(0.3, 3.0, count), MayMeet(regions, codes)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6))
def test_near_faces_are_those_of_a_search_of_all_pairs(seed):
    places, normals, wide, who = cloud(seed)
    points, faces = near_faces(places, normals, wide, who.regions, who.codes, *who.balls(places), 0.5, OWN)
    expected = []
    for i in range(len(places)):
        for j in range(len(places)):
            apart, code = places[i] - places[j], who.codes[who.regions[i], who.regions[j]]
            near = np.linalg.norm(apart) < WITHIN * wide[j] and normals[i] @ normals[j] < OPPOSED
            behind = code == OWN and apart @ normals[j] < -0.5 * wide[j]
            if near and code != NEVER and not behind:
                expected.append((i, j))
    assert sorted(zip(points.tolist(), faces.tolist(), strict=True)) == expected


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6), st.floats(-0.5, 0.5), st.floats(-0.5, 0.5))
def test_a_point_before_a_plane_is_as_far_as_the_plane_is(seed, slope, lean):
    """Faces anywhere on a plane, each with a distance to its neighbours of its own."""
    rng = np.random.default_rng(seed)
    normal = np.array([-slope, -lean, 1.0]) / np.sqrt(1 + slope**2 + lean**2)
    floor = rng.uniform(-2, 2, (30, 2))
    places = np.vstack([np.column_stack([floor, floor @ [slope, lean]]), [0.2, -0.1, 0.0] + 0.8 * normal])
    normals = np.vstack([np.tile(normal, (30, 1)), -normal])
    wide = np.append(rng.uniform(1.0, 2.0, 30), 1.5)
    planes = planes_before(np.array([30]), np.array([0, 30]), np.arange(30), places, normals, wide)
    expected = normal @ (places[30] - places[0])
    np.testing.assert_allclose(planes.gaps, [expected], atol=1e-9)
    np.testing.assert_allclose(planes.frames[0, 0], normal, atol=1e-9)
    assert abs(planes.weights.sum() - 1) < 1e-9  # forces balance
    foot = planes.weights @ places[:30]
    np.testing.assert_allclose(np.cross(places[30] - foot, normal), 0, atol=1e-9)  # moments, too


def test_the_plane_is_that_of_weighted_least_squares():
    """Of a curved floor: the second plane, fitted square on the first."""
    rng = np.random.default_rng(3)
    floor = rng.uniform(-2, 2, (40, 2))
    places = np.vstack([np.column_stack([floor, 0.1 * (floor**2).sum(axis=1)]), [0.3, 0.2, 0.6]])
    up = np.array([0.0, 0.0, 1.0])
    normals, wide = np.vstack([np.tile(up, (40, 1)), -up]), np.full(41, 1.2)
    planes = planes_before(np.array([40]), np.array([0, 40]), np.arange(40), places, normals, wide)
    apart, n = places[:40] - places[40], up
    G = np.sqrt([kernel(square) for square in (apart**2).sum(axis=1) / 1.2**2])
    for _ in range(2):
        t = np.linalg.svd(n[None])[2][1:]
        fit = np.linalg.lstsq(G[:, None] * np.column_stack([np.ones(40), apart @ t.T]), G * (apart @ n), rcond=None)[0]
        gap, before = -fit[0], n
        n = (n - fit[1:] @ t) / np.linalg.norm(n - fit[1:] @ t)
    np.testing.assert_allclose(planes.gaps[0], gap, atol=1e-9)
    np.testing.assert_allclose(planes.frames[0, 0], before, atol=1e-9)
