"""How deep surfaces have gone through themselves, by boxes whose overlaps are known."""

import numpy as np
import pytest
from support.blocks import block
from support.closed import box_arrays

from cfem.constraint.surface import triangulated
from cfem.contact.surface.overlap import boundary_of, depth_in_itself
from cfem.mechanics.mesh import Mesh, boundary_facets
from cfem.stability.families.chambers import SIZE, hollow_mesh


@pytest.mark.parametrize("gap", [0.5, -0.25, -0.6])
def test_a_surface_that_goes_through_itself_is_told_how_deep(gap):
    """Two boxes of one surface, the smaller above the larger: its corners lie in the other by what they overlap."""
    low, faces = box_arrays([0, 0, 0], [4, 4, 2])
    high, _ = box_arrays([0.5, 0.5, 2 + gap], [3.5, 3.5, 4 + gap])
    nodes, triangles = np.vstack([low, high]), np.vstack([faces, faces + len(low)])
    every = np.arange(len(nodes))
    assert depth_in_itself(nodes, triangles, every) == pytest.approx(max(0.0, -gap), abs=1e-9)
    assert depth_in_itself(nodes, triangles, every[: len(low)]) == 0.0


def fork():
    """Two prongs of 2 x 4 x 8 mm, 2 mm apart, on a base of 6 x 4 x 2 mm."""
    plain = block((6, 4, 10), (6, 4, 10))
    centre = plain.X[plain.cells].mean(axis=1)
    kept = plain.cells[(centre[:, 2] < 2) | (centre[:, 0] < 2) | (centre[:, 0] > 4)]
    used, cells = np.unique(kept, return_inverse=True)
    return Mesh(plain.X[used], cells.reshape(-1, 4), boundary_facets(cells.reshape(-1, 4)))


@pytest.mark.parametrize("lean", [0.4, 0.8, 0.9])
def test_prongs_that_are_pushed_into_each_other_overlap_by_what_they_moved_beyond_the_gap(lean):
    """Each moves sideways by `lean` of the gap of 2 mm at its end, in proportion to its height squared. The ends lie in
    one plane and are not within each other; the way out of the nodes 1 mm below is at right angles to the sides."""
    mesh = fork()
    boundary, x = boundary_of(mesh.X, triangulated(mesh.facets)), mesh.X.copy()
    shift = lean * 2 * ((x[:, 2] - 2).clip(0) / 8) ** 2
    x[:, 0] += np.where(x[:, 0] < 3, shift, -shift)
    overlap = boundary.overlap(x)
    assert (overlap.depth > 0) == (lean > 0.5)
    if overlap.depth:
        across, slope = 4 * lean * (7 / 8) ** 2 - 2, 2 * lean * (1 - (7 / 8) ** 2)
        assert overlap.depth == pytest.approx(across / np.hypot(1, slope), rel=0.02)
        assert mesh.X[overlap.node, 2] == 9.0 and mesh.X[overlap.node, 0] in (2.0, 4.0)


def test_walls_of_a_chamber_that_pass_through_each_other_are_found_and_those_that_bulge_are_not():
    mesh = hollow_mesh("tet4")
    boundary = boundary_of(mesh.X, triangulated(mesh.facets))
    assert len(boundary.chambers) == 1 and boundary.at_rest == 0.0
    walls, middle = np.unique(boundary.chambers[0]), np.asarray(SIZE) / 2
    x = mesh.X.copy()
    x[walls, 2] = middle[2] + 1.05 * (x[walls, 2] - middle[2])
    assert boundary.overlap(x).depth == 0.0
    height = np.ptp(mesh.X[walls, 2])
    x = mesh.X.copy()
    apart = np.abs(mesh.X[walls] - middle)
    inner = walls[(apart[:, :2] < 0.99 * apart[:, :2].max(axis=0)).all(axis=1)]
    x[inner, 2] = middle[2] - 0.2 * (x[inner, 2] - middle[2])
    assert 0.05 * height < boundary.overlap(x).depth <= 0.2 * height * 1.001


def test_what_overlaps_at_rest_counts_only_where_it_gets_deeper():
    low, faces = box_arrays([0, 0, 0], [4, 4, 2])
    high, _ = box_arrays([0.5, 0.5, 1.5], [3.5, 3.5, 4])
    X, triangles = np.vstack([low, high]), np.vstack([faces, faces + len(low)])
    boundary = boundary_of(X, triangles)
    assert boundary.at_rest == pytest.approx(0.5, abs=1e-9) and boundary.overlap(X).depth == 0.0
    deeper = X - np.where(np.arange(len(X)) < len(low), 0.0, 0.2)[:, None] * [0, 0, 1]
    assert boundary.overlap(deeper).depth == pytest.approx(0.7, abs=1e-9)
