"""Patches that face each other: gaps, balance of what they feel, and who never meets."""

import numpy as np
import pytest

from cfem.condensed.patches import Patches, cut
from cfem.constraint.surface import outer_surface
from cfem.contact.detection import (
    FEW,
    NEVER,
    OTHER,
    OWN,
    REGION,
    MayMeet,
    detect,
    may_meet,
    regions,
    separation,
    spacings,
)
from cfem.contact.surface.triangles import mean_normals
from cfem.mechanics.mesh import boundary_facets

UP, DOWN = np.array([0.0, 0, 1]), np.array([0.0, 0, -1])


def sheets(gap):
    """A sheet of 5 x 5 patches, 2 mm apart, that faces up, and a point above its middle that faces down."""
    x, y = np.meshgrid(np.arange(5) * 2.0, np.arange(5) * 2.0)
    floor = np.column_stack([x.ravel(), y.ravel(), 0.02 * x.ravel()])
    places = np.vstack([floor, [4.3, 3.6, 0.02 * 4.3 + gap]])
    normals = np.vstack([np.tile(UP, (25, 1)), DOWN])
    return places, normals, may(OTHER)


def may(code):
    """A point that may meet a sheet of 25 patches."""
    codes = np.full((26, 26), NEVER)
    codes[25, :25] = code
    return MayMeet(np.arange(26), codes)


WIDE = np.full(26, 2.0)


@pytest.mark.parametrize("gap", [0.7, -0.4])
def test_the_gap_is_that_to_the_plane_through_the_faces(gap):
    places, normals, who = sheets(gap)
    points, relative, frames = detect(places, normals, who, WIDE)
    assert points.tolist() == [25]
    up = 1 / np.hypot(1, 0.02)  # of the sheet's normal
    assert frames[0] @ (relative[0] @ places) == pytest.approx([gap * up, 0, 0], abs=1e-12)
    assert frames[0, 0] == pytest.approx([-0.02 * up, 0, up], abs=1e-12)
    assert relative[0] @ np.ones(26) == pytest.approx(0.0, abs=1e-12)


def test_faces_come_and_go_without_a_jump():
    """One of them moves away, then turns away."""
    places, normals, who = sheets(0.3)
    places[7, 2] += 0.2  # so that it counts

    def gap():
        _, relative, frames = detect(places, normals, who, WIDE)
        return float(frames[0, 0] @ (relative[0] @ places)), int((relative[0] != 0).sum())

    found = []
    for x in np.arange(2.0, 6.0, 0.01):
        places[7, 0] = 4.0 - x
        found.append(gap())
    gaps, counts = np.array(found).T
    assert counts.min() < counts.max() and gaps.max() > gaps.min() + 1e-4
    assert np.abs(np.diff(gaps)).max() < 0.03 * (gaps.max() - gaps.min())
    places[7, 0], found = 2.0, []
    for angle in np.arange(0.0, 1.6, 0.01):
        normals[7] = np.sin(angle), 0, np.cos(angle)
        found.append(gap())
    gaps, counts = np.array(found).T
    assert counts[-1] < counts[0] and np.abs(np.diff(gaps)).max() < 0.1 * (gaps.max() - gaps.min())


def test_the_distance_of_bodies_goes_on_where_pairs_are_dropped():
    """A point goes over the edge of a sheet and far away, and its faces fold into a line."""
    places, normals, who = sheets(0.7)
    found, seen = [], []
    for x in np.arange(3.0, 16.0, 0.02):
        places[25] = x, 3.6, 0.02 * x + 0.7
        pairs = detect(places, normals, who, WIDE)
        found.append(separation(places, normals, who, WIDE))
        seen.append(len(pairs[0]))
        if seen[-1]:
            assert found[-1] == pytest.approx(pairs[2][0, 0] @ (pairs[1][0] @ places), abs=1e-12)
    assert 0 < sum(seen) < len(seen)
    assert np.abs(np.diff(found)).max() < 0.2 and found[-1] == pytest.approx(8.04, abs=0.05)
    places, normals, who = sheets(0.7)
    shape, found, seen = places.copy(), [], []
    for narrow in np.geomspace(1.0, 1e-3, 400):
        places[:25, 0] = 4.3 + narrow * (shape[:25, 0] - 4.3)
        found.append(separation(places, normals, who, WIDE))
        seen.append(len(detect(places, normals, who, WIDE)[0]))
    assert 0 < sum(seen) < len(seen) and np.abs(np.diff(found)).max() < 0.2


def test_forces_and_moments_balance():
    places, normals, who = sheets(0.3)
    _, relative, frames = detect(places, normals, who, WIDE)
    forces = relative[0][:, None] * frames[0, 0]
    assert forces.sum(axis=0) == pytest.approx(np.zeros(3), abs=1e-12)
    assert np.cross(places, forces).sum(axis=0) == pytest.approx(np.zeros(3), abs=1e-12)


def test_beyond_an_edge_and_behind_a_wall_of_its_own_nothing_is_met():
    places, normals, who = sheets(0.3)
    aside = places.copy()
    aside[25, 0] = 10.5
    assert not len(detect(aside, normals, who, WIDE)[0])
    deep = np.vstack([places[:25], places[25] - [0, 0, 2.0]])
    _, relative, frames = detect(deep, normals, who, WIDE)
    assert frames[0, 0] @ (relative[0] @ deep) == pytest.approx(-1.7 / np.hypot(1, 0.02))
    assert not len(detect(deep, normals, may(OWN), WIDE)[0])


def test_neighbours_along_the_surface_never_meet_and_normals_point_outwards():
    """A row of eight cubes."""
    X = np.array([[x, y, z] for x in range(9) for y in (0, 1) for z in (0, 1)], float)
    first = 4 * np.arange(8)[:, None]
    cells = first + np.array([0, 4, 6, 2, 1, 5, 7, 3])
    surface = outer_surface(X, boundary_facets(cells))
    patches = cut(surface.rest, surface.weights, 1.2, surface.triangles)
    who = may_meet([regions(surface.rest, surface.triangles, patches)[1]] * 2, [4.0, 4.0])
    n = len(patches)
    assert (np.diag(who) == NEVER).all() and (who[:n, n:] == OTHER).all()
    far = np.abs(patches.rest[:, 0, None] - patches.rest[:, 0])
    assert (who[:n, :n][far > 6.0] == OWN).all() and (who[:n, :n][far < 1.0] == NEVER).all()
    normals = mean_normals(surface.rest, surface.triangles, patches.of, n)
    outward = patches.rest - np.column_stack([patches.rest[:, 0].clip(0.5, 7.5), np.full((n, 2), 0.5)])
    assert ((normals * outward).sum(axis=1) > 0).all()


def test_regions_of_many_points_know_how_far_these_are_apart_along_the_surface():
    """Of a row of forty cubes that are cut fine: two points are nearer or farther than their regions by no more than
    both of these reach."""
    x, y = np.meshgrid(np.linspace(0, 40, 161), np.linspace(0, 1, 5), indexing="ij")
    rest = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    number = np.arange(x.size).reshape(x.shape)
    a, b, c, d = (each.ravel() for each in (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]))
    triangles = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    points = Patches(np.arange(len(rest)), np.ones(len(rest)), rest)
    region, along = regions(rest, triangles, points)
    assert len(along) < 60 < FEW < len(rest)
    apart = np.abs(x.ravel()[:, None] - x.ravel())
    assert np.abs(along[np.ix_(region, region)] - apart).max() < 2 * REGION * np.hypot(40, 1) + 1.0  # across the row
    np.testing.assert_allclose(spacings(rest, triangles, points).mean(), 0.27, atol=0.02)


def test_the_nearest_two_points_that_may_meet_are_found_in_few_regions():
    rng = np.random.default_rng(0)
    places, region = rng.uniform(-9, 9, (300, 3)), rng.integers(0, 8, 300)
    codes = rng.choice([NEVER, OTHER], (8, 8))
    codes = np.maximum(codes, codes.T)
    apart = np.linalg.norm(places[:, None] - places, axis=2)
    apart[codes[np.ix_(region, region)] == NEVER] = np.inf
    outward = np.tile(UP, (300, 1))  # no two face each other
    np.fill_diagonal(codes, NEVER)
    apart[region[:, None] == region] = np.inf
    assert separation(places, outward, MayMeet(region, codes), np.ones(300)) == pytest.approx(apart.min())


def test_a_region_without_points_is_near_nothing():
    """All of its points are held, and touch nothing."""
    places, region = np.array([[5.0, 0.0, 0.0], [-4.0, 0.0, 0.0]]), np.array([0, 2])
    codes = np.array([[NEVER, OTHER, OTHER], [OTHER, NEVER, OTHER], [OTHER, OTHER, NEVER]])
    assert separation(places, np.tile(UP, (2, 1)), MayMeet(region, codes), np.ones(2)) == pytest.approx(9.0)


@pytest.mark.parametrize(("slope", "taken"), [(0.5, True), (2.0, False)])
def test_a_plane_that_leans_far_from_its_faces_normals_is_not_taken(slope, taken):
    """As at an edge, where the faces of both sides make no surface."""
    x, y = np.meshgrid(np.arange(5) * 1.0, np.arange(5) * 1.0)
    floor = np.column_stack([x.ravel(), y.ravel(), slope * x.ravel()])
    places = np.vstack([floor, [2.2, 1.9, slope * 2.2 + 0.4]])
    _, _, frames = detect(places, np.vstack([np.tile(UP, (25, 1)), DOWN]), may(OTHER), WIDE)
    plane = np.array([-slope, 0.0, 1.0]) / np.hypot(1, slope)
    assert frames[0, 0] == pytest.approx(plane if taken else UP, abs=1e-9)
