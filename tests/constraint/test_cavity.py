import re

import numpy as np
import pytest
from constraint.meshes import MIDDLE, VOID, bricks, carved, hollow, icosphere
from hypothesis import example, given
from hypothesis import strategies as st
from support.blocks import block

from cfem.constraint.cavity import enclosed, make_cavity
from cfem.core.errors import SpecError
from cfem.mechanics.element import shape

KINDS = ["tet4", "tet10", "hex8"]
CHAMBERS = {}
for _kind in KINDS:
    _mesh = hollow(_kind)
    CHAMBERS[_kind] = _mesh, _mesh.facets[enclosed(_mesh, MIDDLE)]
every_kind = pytest.mark.parametrize("kind", KINDS)
numbers = st.lists(st.floats(-2, 2), min_size=9, max_size=9)


def chamber(kind):
    mesh, facets = CHAMBERS[kind]
    return mesh, make_cavity(mesh.X, facets, "chamber")


@every_kind
def test_a_box(kind):
    mesh, row = chamber(kind)
    assert row.rest_volume == pytest.approx(VOID, rel=1e-13)
    assert row.value(mesh.X)[0] == 0.0
    assert row.value(mesh.X * [1.5, 1, 1])[0] == pytest.approx(VOID / 2, rel=1e-12)


@every_kind
def test_pressure_pushes_the_walls_outward_by_their_area(kind):
    mesh, row = chamber(kind)
    force = row.gradient(mesh.X)[0]
    for axis, area in enumerate([24.0, 24.0, 36.0]):
        at = mesh.X[row.nodes, axis]
        # the rim's nodes are also of the neighbouring walls, whose normals lie across
        assert force[at > at.max() - 1e-9, axis].sum() == pytest.approx(area, rel=1e-12)
        assert force[at < at.min() + 1e-9, axis].sum() == pytest.approx(-area, rel=1e-12)


@every_kind
@given(entries=numbers)
@example(entries=[-1.0, 0.0, 0.0, 2.225073858507e-311, 0.0, 0.0, 0.0, 0.0, 0.0])  # elimination would divide by it
def test_an_affine_motion_scales_the_volume_by_its_determinant(kind, entries):
    mesh, row = chamber(kind)
    F = np.eye(3) + np.reshape(entries, (3, 3))
    grown = row.value(mesh.X @ F.T + [5.0, -3, 8])[0] + VOID
    assert grown == pytest.approx(F[0] @ np.cross(F[1], F[2]) * VOID, rel=1e-11, abs=1e-9)


@every_kind
def test_orientation_of_the_facets_does_not_matter(kind):
    mesh, facets = CHAMBERS[kind]
    back = {3: [0, 2, 1], 6: [0, 2, 1, 5, 4, 3], 4: [0, 3, 2, 1]}[facets.shape[1]]
    x = mesh.X + 0.3 * np.random.default_rng(0).standard_normal(mesh.X.shape)
    one, other = (make_cavity(mesh.X, part, "chamber") for part in (facets, facets[:, back]))
    np.testing.assert_allclose(other.value(x), one.value(x), rtol=1e-11)
    np.testing.assert_allclose(other.gradient(x), one.gradient(x), atol=1e-12)


@every_kind
def test_curved_facets_against_flat_ones(kind):
    """Each bent facet cut into n^2 flat ones that lie on it; n = 8, 16 extrapolated twice (error of n^-2, n^-4)."""
    mesh, row = chamber(kind)
    x = mesh.X + 0.2 * np.random.default_rng(1).standard_normal(mesh.X.shape)
    coarse, middle, fine = (_flat_volume(x, row.cliques[0], n) for n in (4, 8, 16))
    once = [(4 * b - a) / 3 for a, b in ((coarse, middle), (middle, fine))]
    limit = (16 * once[1] - once[0]) / 15
    assert row.rest_volume + row.value(x)[0] == pytest.approx(abs(limit), rel=1e-9)


def _flat_volume(x, facets, n):
    s, t = (part.ravel() for part in np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij"))
    number = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    corner, right, up, across = (
        part.ravel() for part in (number[:-1, :-1], number[1:, :-1], number[:-1, 1:], number[1:, 1:])
    )
    lower, upper = np.column_stack([corner, right, up]), np.column_stack([right, across, up])
    if facets.shape[1] == 4:
        N = shape(8, np.column_stack([2 * s / n - 1, 2 * t / n - 1, -np.ones(len(s))]))[:, :4]
    else:
        L = np.column_stack([1 - (s + t) / n, s / n, t / n, np.zeros(len(s))])
        N = shape(4, L)[:, :3] if facets.shape[1] == 3 else shape(10, L)[:, [0, 1, 2, 4, 5, 6]]
        lower, upper = (part[(s + t)[part].max(axis=1) <= n] for part in (lower, upper))
    points = np.einsum("qa,gad->gqd", N, x[facets])
    return np.linalg.det(points[:, np.vstack([lower, upper])]).sum() / 6


def test_icosahedron():
    X, facets = icosphere(0)
    edge = np.linalg.norm(X[facets[0, 0]] - X[facets[0, 1]])
    assert make_cavity(X, facets, "ball").rest_volume == pytest.approx(5 * (3 + np.sqrt(5)) / 12 * edge**3, rel=1e-13)


@pytest.mark.parametrize("order, rate, error", [(1, 2, 1e-2), (2, 4, 1e-4)])
def test_sphere(order, rate, error):
    """Flat triangles tend to the sphere as h^2, curved ones whose nodes lie on it as h^4."""
    errors = [abs(make_cavity(*icosphere(level, order), "ball").rest_volume / (4 / 3 * np.pi) - 1) for level in (2, 3)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(rate, abs=0.1)
    assert errors[1] < error


def test_far_from_the_origin_nothing_is_lost():
    X, facets = icosphere(2)
    there = np.array([1e4, -2e4, 0.0])
    near, far = (make_cavity(X + shift, facets, "ball") for shift in (0.0, there))
    assert far.rest_volume == pytest.approx(near.rest_volume, rel=1e-11)
    np.testing.assert_allclose(far.gradient(X + there), near.gradient(X), atol=1e-11)


def test_two_chambers_of_one_actuator():
    X, facets = icosphere(1)
    both = make_cavity(np.vstack([X, X + 5]), np.vstack([facets, facets + len(X)]), "pair")
    assert both.rest_volume == pytest.approx(2 * make_cavity(X, facets, "one").rest_volume, rel=1e-12)


@every_kind
def test_enclosed_finds_the_wall_of_a_void(kind):
    mesh, facets = CHAMBERS[kind]
    inner = (np.abs(mesh.X[mesh.facets] - MIDDLE) <= [3.001, 3.001, 2.001]).all(axis=(1, 2))
    np.testing.assert_array_equal(facets, mesh.facets[inner])
    off_centre = MIDDLE + [2.9, -2.8, 1.7]
    np.testing.assert_array_equal(enclosed(mesh, off_centre), np.flatnonzero(inner))


@pytest.mark.parametrize("make", [block, bricks])
def test_enclosed_tells_voids_apart(make):
    """Two that touch in one node; and one inside a body that floats in another."""
    touching = carved(
        make((6, 6, 6), (6, 6, 6)), lambda c: ~((np.abs(c - 2) < 1).all(axis=1) | (np.abs(c - 4) < 1).all(axis=1))
    )
    nested = carved(make((7, 7, 7), (7, 7, 7)), lambda c: np.isin(np.abs(c - 3.5).max(axis=1).round(), [1, 3]))
    for mesh, point, volume in (
        (touching, [2.0, 2, 2], 8),
        (touching, [4.0, 4, 4], 8),
        (nested, [3.5, 3.5, 3.5], 1),
        (nested, [5.5, 3.5, 3.5], 125),
    ):
        wall = mesh.facets[enclosed(mesh, np.array(point) + 0.1)]
        assert make_cavity(mesh.X, wall, "void").rest_volume == pytest.approx(volume)


@pytest.mark.parametrize(
    "point, part",
    [
        ([1.0, 1, 1], "cavity: its inside point (1, 1, 1) mm lies in the material"),
        ([-5.0, 1, 1], "lies outside the body and in no closed chamber"),
        ([3.0, 5, 4], "lies on the boundary of the body"),
    ],
)
@every_kind
def test_a_point_that_no_void_encloses_is_named(kind, point, part):
    with pytest.raises(SpecError, match=re.escape(part)):
        enclosed(CHAMBERS[kind][0], np.array(point))
    with pytest.raises(SpecError, match="in the material"):
        enclosed(block((1, 1, 1), (2, 2, 2)), np.full(3, 0.45), "chamber 'left'")


@every_kind
def test_an_open_cavity_is_named_with_its_hole(kind):
    mesh, facets = CHAMBERS[kind]
    corners = 4 if kind == "hex8" else 3
    with pytest.raises(SpecError) as found:
        make_cavity(mesh.X, facets[1:], "chamber")
    hole = re.search(r"'chamber' is not closed: (\d+) edges .*, around \((.*)\) mm \(close", str(found.value))
    assert int(hole[1]) == corners
    middle = mesh.X[facets[0, :corners]].mean(axis=0)
    np.testing.assert_allclose(np.array(hole[2].split(","), float), middle, rtol=1e-5)
    with pytest.raises(SpecError, match="in 2 places, one of them around"):
        make_cavity(np.vstack([mesh.X, mesh.X + 50]), np.vstack([facets[1:], facets[1:] + len(mesh.X)]), "pair")


def test_other_bad_surfaces_are_named():
    X, facets = icosphere(1)
    turned = np.vstack([facets[:1, ::-1], facets[1:]])
    for bad, x, part in [
        (turned, X, "3 edges do not lie between two facets of the same orientation"),
        (np.vstack([facets, facets]), X, "is not closed"),
        (np.vstack([facets, facets[:1]]), X, "is not closed"),
        (facets, X * [1, 1, 0], "cavity 'ball' has no volume"),
        (facets[:0], X, "cavity 'ball' has no facets"),
    ]:
        with pytest.raises(SpecError, match=part):
            make_cavity(x, bad, "ball")
