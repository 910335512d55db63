"""Patches of a surface: means of their nodes, which lie together on the surface."""

import numpy as np
import pytest
from support.blocks import box

from cfem.condensed.patches import cut, edges, on_sharp_edges
from cfem.constraint.surface import outer_surface


def two_plates(gap):
    """Two plates of 40 x 20 x 2 mm, one above the other."""
    one = box((40, 20, 2), (8, 4, 1), "hex8")
    return [outer_surface(one.X + [0, 0, up], one.facets) for up in (0.0, 2.0 + gap)]


def test_a_patch_lies_on_one_side_of_a_gap():
    low, high = two_plates(1.0)
    rest, count = np.vstack([low.rest, high.rest]), len(low.rest)
    triangles = np.vstack([low.triangles, high.triangles + count])
    patches = cut(rest, np.ones(len(rest)), 8.0, triangles)
    sides = [set((members >= count).tolist()) for members in patches.members]
    assert all(len(side) == 1 for side in sides) and len(patches) > 20


def test_every_node_is_near_its_patch_and_shares_are_whole():
    low, _ = two_plates(1.0)
    patches = cut(low.rest, low.weights, 8.0, low.triangles)
    assert np.bincount(patches.of, patches.shares) == pytest.approx(np.ones(len(patches)))
    assert np.linalg.norm(low.rest - patches.rest[patches.of], axis=1).max() < 2 * 8.0
    assert patches.mean(low.rest) == pytest.approx(patches.rest)


def test_edges_have_their_lengths():
    graph = edges(np.array([[0.0, 0, 0], [3, 0, 0], [0, 4, 0]]), np.array([[0, 1, 2]]))
    assert graph.toarray() == pytest.approx(np.array([[0, 3, 4], [0, 0, 5], [0, 0, 0]], float))


def test_sharp_edges_of_a_box_are_found_and_inner_ones_are_not():
    block = box((40, 20, 10), (8, 4, 2), "hex8")
    whole = outer_surface(block.X, block.facets)
    ends = np.isclose(whole.rest, 0.0) | np.isclose(whole.rest, [40, 20, 10])
    assert (on_sharp_edges(whole.rest, whole.triangles) == (ends.sum(axis=1) >= 2)).all()
    inside_out = whole.triangles[:, ::-1]  # of a hollow: its edges are concave
    assert not on_sharp_edges(whole.rest, inside_out).any()


@pytest.mark.parametrize("apart", [5.0, 8.0, 15.0])
def test_patches_of_their_own_keep_places_of_straight_edges_on_the_surface(apart):
    """Means of flat faces and of straight edges lie on them; only those round a corner do not."""
    block = box((40, 20, 10), (16, 8, 4), "hex8")
    whole = outer_surface(block.X, block.facets)
    depth = {}
    for sharp in (False, True):
        patches = cut(whole.rest, whole.weights, apart, whole.triangles, sharp)
        within = np.minimum(patches.rest, np.array([40, 20, 10]) - patches.rest)
        depth[sharp] = np.sort(within, axis=1)[:, 0]
        assert np.bincount(patches.of, patches.shares) == pytest.approx(np.ones(len(patches)))
    assert depth[False].max() > 0.5
    inside = np.sum(depth[True] > 1e-9)
    assert inside <= 8 and len(depth[True]) > 3 * inside  # one a corner
