import numpy as np
import pytest
from support.blocks import block

from cfem.contact.surface.facets import unmatched_edges
from cfem.robot.mesh.mend import mend
from cfem.robot.mesh.short_edges import without_short_edges

MESH = block((60.0, 20.0, 20.0), (12, 4, 4))
_, CORNERS = np.unique(MESH.facets, return_inverse=True)
X, FACETS = MESH.X[np.unique(MESH.facets)], CORNERS.reshape(-1, 3)


def volume(X, triangles):
    """By the divergence theorem."""
    return np.linalg.det(X[triangles]).sum() / 6


def shortest(X, triangles):
    """mm."""
    corners = X[triangles]
    return np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).min()


def with_a_narrow_band(width):
    """The nodes at x = 5 mm lie `width` mm beside those at x = 0."""
    moved = X.copy()
    moved[np.isclose(X[:, 0], 5.0), 0] = width
    return moved


def test_a_narrow_band_of_faces_is_gone_and_the_body_stays():
    narrow = with_a_narrow_band(0.1)
    triangles, contracted = without_short_edges(narrow, FACETS)
    assert contracted == 16  # nodes around the cross-section, but for those within the end
    assert shortest(narrow, FACETS) == pytest.approx(0.1) and shortest(narrow, triangles) > 4
    assert len(unmatched_edges(triangles)) == 0
    assert volume(narrow, triangles) == pytest.approx(volume(narrow, FACETS), rel=1e-3)
    used = narrow[np.unique(triangles)]
    np.testing.assert_array_equal([used.min(axis=0), used.max(axis=0)], [narrow.min(axis=0), narrow.max(axis=0)])


def test_a_wall_that_is_thin_beside_its_triangles_stays():
    thin = block((60.0, 20.0, 0.1), (12, 4, 1))
    triangles, contracted = without_short_edges(thin.X, thin.facets)
    assert contracted == 0 and len(triangles) == len(thin.facets)


def test_fine_triangles_stay_where_all_are_fine():
    fine = block((60.0, 0.2, 0.2), (300, 1, 1))
    triangles, contracted = without_short_edges(fine.X, fine.facets)
    assert contracted == 0 and len(triangles) == len(fine.facets)


def test_mending_says_so():
    _, triangles, said, _ = mend(with_a_narrow_band(0.1), FACETS, "body")
    assert len(triangles) < len(FACETS) and "contracted 16 edges" in said[0]
