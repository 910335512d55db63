import numpy as np
import pytest
from support.blocks import block

from cfem.contact.surface.crossing import crossings
from cfem.contact.surface.facets import unmatched_edges
from cfem.core.errors import InputError
from cfem.robot.mesh.mend import mend

MESH = block((6.0, 2.0, 2.0), (12, 4, 4))
_, CORNERS = np.unique(MESH.facets, return_inverse=True)
X, FACETS = MESH.X[np.unique(MESH.facets)], CORNERS.reshape(-1, 3)


def volume(X, triangles):
    """By the divergence theorem: positive where the normals point out of the material."""
    return np.linalg.det(X[triangles]).sum() / 6


def mended(X, triangles):
    X, triangles, said, bodies = mend(X, triangles, "body")
    assert bodies == 1
    assert len(unmatched_edges(triangles)) == 0
    assert len(np.unique(triangles)) == len(X)
    return X, triangles, said


def test_a_sound_surface_stays_as_it_is():
    found, triangles, said = mended(X, FACETS)
    np.testing.assert_array_equal(found[triangles], X[FACETS])
    assert said == ()


def test_triangles_each_with_corners_of_their_own_are_joined():
    found, triangles, said = mended(X[FACETS].reshape(-1, 3), np.arange(FACETS.size).reshape(-1, 3))
    assert len(found) == len(X) and volume(found, triangles) == pytest.approx(24)
    assert said == (f"merged {FACETS.size - len(X)} duplicate nodes",)


def test_copies_and_lines_are_dropped():
    more = np.vstack([FACETS, FACETS[:2], [[0, 0, 1]]])
    _, triangles, said = mended(X, more)
    assert len(triangles) == len(FACETS) and "dropped 3 triangles" in said[0]


def test_normals_point_out_of_the_material_whatever_they_did():
    turned = FACETS.copy()
    turned[::3] = turned[::3, ::-1]
    for triangles in (turned, FACETS[:, ::-1]):
        found, right, said = mended(X, triangles)
        assert volume(found, right) == pytest.approx(24) and "normals" in said[0]


@pytest.mark.parametrize(
    "missing, begins, ends",
    [(1, "closed a hole, ", "body's extent wide"), (2, "closed 2 holes, ", "body's extent wide at most")],
)
def test_holes_are_closed(missing, begins, ends):
    found, triangles, said = mended(X, FACETS[missing:])
    assert said[0].startswith(begins) and said[0].endswith(ends)
    assert volume(found, triangles) == pytest.approx(24, rel=0.02)


def test_a_surface_that_passes_through_itself_at_a_place_is_smoothed_there():
    top = np.flatnonzero(np.isclose(X, [3.0, 1.0, 2.0]).all(axis=1))
    through = X.copy()
    through[top] = [3.1, 1.05, -0.3]
    found, triangles, said = mended(through, FACETS)
    assert len(crossings(found, triangles)[0]) == 0 and "passed through itself" in said[0]
    assert volume(found, triangles) == pytest.approx(24, rel=0.03)


def box(low, high):
    """A box of twelve triangles, as CAD programs write it."""
    corners = block((1.0, 1.0, 1.0), (1, 1, 1))
    return low + corners.X * (np.asarray(high, float) - low), corners.facets


@pytest.mark.parametrize(
    "low, high",
    [((5.0, -1.0, -1.0), (7.0, 3.0, 3.0)), ((5.0, 0.5, 0.5), (7.0, 1.5, 1.5)), ((6.0, -1.0, -1.0), (7.0, 3.0, 3.0))],
    ids=["around", "through", "touching"],
)
@pytest.mark.parametrize("coarse", [True, False])
def test_bodies_that_overlap_or_touch_are_no_flaw_that_a_small_move_mends(low, high, coarse):
    first, triangles = box((0.0, 0.0, 0.0), (6.0, 2.0, 2.0)) if coarse else (X, FACETS)
    second, others = box(low, high)
    with pytest.raises(InputError, match=r"touch or pass through each other, around \([-\d., ]+\)"):
        mend(np.vstack([first, second]), np.vstack([triangles, others + len(first)]), "body")


def test_moves_that_would_make_another_body_are_left_out():
    """An end of a coarse bar folded through its side: smoothed, it would lose a tenth of its volume."""
    bar = block((6.0, 2.0, 2.0), (3, 1, 1))
    through = bar.X.copy()
    through[(bar.X[:, 0] == 6.0) & (bar.X[:, 2] == 2.0)] = [[2.0, 0.0, -1.0], [2.0, 2.0, -1.0]]
    assert len(crossings(through, bar.facets)[0]) > 0
    found, _, said = mended(through, bar.facets)
    np.testing.assert_array_equal(found, through)
    assert said == ()


def test_the_normals_of_a_cavity_point_into_it():
    inner = 0.25 * (X - X.mean(axis=0)) + X.mean(axis=0)
    for facets in (FACETS, FACETS[:, ::-1]):
        found, triangles, _ = mended(np.vstack([X, inner]), np.vstack([FACETS, facets + len(X)]))
        assert volume(found, triangles) == pytest.approx(24 * (1 - 0.25**3))


def test_a_sliver_is_turned_into_a_triangle():
    """A node on the edge of a triangle, joined by a triangle without area."""
    a, b, c = FACETS[0]
    on_edge = np.vstack([X, (X[a] + X[b]) / 2])
    new = len(X)
    neighbour = next(i for i, f in enumerate(FACETS) if i and {a, b} <= set(f.tolist()))
    far = next(n for n in FACETS[neighbour] if n not in (a, b))
    others = np.delete(FACETS, [0, neighbour], axis=0)
    split = [[a, b, c], [a, new, b], [b, new, far], [new, a, far]]  # the second lies on a line
    found, triangles, said = mended(on_edge, np.vstack([others, split]))
    sides = found[triangles]
    area = np.linalg.norm(np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0]), axis=1)
    assert area.min() > 0.02 and "edges of 1 sliver" in said[0] and volume(found, triangles) == pytest.approx(24)


def test_what_cannot_be_mended_is_said():
    top = X[FACETS][:, :, 2].min(axis=1) > 2 - 1e-9
    with pytest.raises(InputError, match=r"body: the surface is not closed: an opening of 6\.3"):
        mend(X, FACETS[~top], "body")
    with pytest.raises(InputError, match="surface branches"):
        mend(np.vstack([X, [[9.0, 9, 9]]]), np.vstack([FACETS, [[FACETS[0, 0], FACETS[0, 1], len(X)]]]), "body")


def test_of_several_bodies_the_largest_is_taken_or_the_one_that_is_asked_for():
    """A hollow one, a larger one that is turned inside out, and a small one within the hollow."""
    middle = X.mean(axis=0)

    def scaled(factor, shift=0.0):
        return factor * (X - middle) + middle + shift

    parts = [X, scaled(0.5), scaled(2.0, 50.0), scaled(0.1)]
    facets = [FACETS, FACETS, FACETS[:, ::-1], FACETS]
    everything = np.vstack([each + index * len(X) for index, each in enumerate(facets)])
    for body, expected in ((1, 24 * 8), (2, 24 * (1 - 0.125)), (3, 24 * 0.001)):
        found, triangles, said, bodies = mend(np.vstack(parts), everything, "file", body)
        assert bodies == 3 and volume(found, triangles) == pytest.approx(expected)
        assert any(f"took body {body} of 3, which hold 90, 9.9, 0.011 % of the volume" in phrase for phrase in said)
    with pytest.raises(InputError, match="file: has 3 bodies, and the scene asks for number 4"):
        mend(np.vstack(parts), everything, "file", 4)
    with pytest.raises(InputError, match="file: has 1 body, and the scene asks for number 2"):
        mend(X, FACETS, "file", 2)
