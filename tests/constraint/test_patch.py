"""A force on a patch of a surface: how it spreads, and what is refused."""

import numpy as np
import pytest

from cfem.constraint.patch import PatchLoad
from cfem.constraint.surface import outer_surface
from cfem.core.errors import InputError, SpecError

UP = [0.0, 0.0, 1.0]


def plate(n=20):
    """A square of side 1 mm in n x n x 2 triangles."""
    x, y = np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1))
    rest = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    first = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    a, b, c, d = first, first + 1, first + n + 2, first + n + 1
    triangles = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    weights = np.bincount(triangles.ravel(), minlength=len(rest)) / triangles.size
    return rest, triangles, weights


def test_it_is_the_integral_of_the_bump_over_the_area():
    """Of a full disc: mean (distance / radius)^2 is 1 / 4, by hand."""
    rest, triangles, weights = plate(40)
    found = PatchLoad([0.5, 0.5, 0.0], 0.4, UP).shares(rest, triangles, weights)
    assert found.sum() == pytest.approx(1.0, rel=1e-14) and (found >= 0).all()
    apart = np.linalg.norm(rest - [0.5, 0.5, 0], axis=1)
    assert found @ (apart / 0.4) ** 2 == pytest.approx(0.25, rel=0.01)
    assert found @ rest == pytest.approx([0.5, 0.5, 0.0], abs=1e-9)
    assert not found[apart >= 0.4].any()


def test_a_point_off_the_surface_gets_the_nearest_one_that_is_on_it():
    surface = plate()
    PatchLoad([0.5, 0.52, 0.1], 0.3, UP).shares(*surface)
    said = r"loads.push: \(0.5, 0.52, 0.2\) mm is 0.2 mm off the surface.*the nearest point .*\(0.5, 0.52, 0\) mm"
    with pytest.raises(SpecError, match=said):
        PatchLoad([0.5, 0.52, 0.2], 0.3, UP, "push").shares(*surface)


def test_too_small_a_radius_says_which_one_is_enough():
    surface = plate()
    with pytest.raises(SpecError, match=r"radius of 0.01 mm .* holds 1 nodes .*more than ([0-9.]+) mm") as caught:
        PatchLoad([0.5, 0.5, 0.0], 0.01, UP, "push").shares(*surface)
    enough = float(str(caught.value).rsplit("more than ", 1)[1].split()[0])
    PatchLoad([0.5, 0.5, 0.0], enough * 1.0001, UP).shares(*surface)


@pytest.mark.parametrize(
    ("at", "radius", "force", "said"),
    [
        ([0, 0], 1.0, UP, "at of the load on 'patch' must have three finite numbers"),
        ([0, 0, 0], 1.0, [0, np.nan, 1], "force of the load on 'patch' must have three finite numbers"),
        ([0, 0, 0], 0.0, UP, "radius of the load on 'patch' must be above 0 mm"),
        ([0, 0, 0], np.nan, UP, "radius of the load on 'patch' must be above 0 mm"),
    ],
)
def test_numbers_that_are_none_are_refused(at, radius, force, said):
    with pytest.raises(InputError, match=said):
        PatchLoad(at, radius, force)


def test_what_is_written_is_read_again_and_the_same():
    one = PatchLoad([1, 2, 3], 4.0, [0.1, 0, 0], "push")
    again = PatchLoad(**one.to_json())
    assert one.same(again) and str(one) == "0.1, 0, 0 N on 'push' at (1, 2, 3) mm, radius 4 mm"
    assert not one.same(PatchLoad([1, 2, 3], 4.0, [0.1, 0, 1e-6]))


def test_on_a_finer_mesh_it_is_nearly_the_same_load():
    """Mean place and spread of the force, on two meshes of one square."""
    moments = []
    for n in (10, 25):
        rest, triangles, weights = plate(n)
        found = PatchLoad([0.45, 0.55, 0.0], 0.35, UP).shares(rest, triangles, weights)
        moments.append([*(found @ rest)[:2], found @ (rest**2).sum(axis=1)])
    assert np.allclose(*moments, atol=0.005)


def test_quadratic_facets_have_a_surface_that_takes_it():
    X = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], *[[0.5, 0, 0], [0.5, 0.5, 0], [0, 0.5, 0]]], float)
    X = np.vstack([X, [[0, 0, 0.5], [0.5, 0, 0.5], [0, 0.5, 0.5]]])
    facets = np.array([[0, 2, 1, 6, 5, 4], [0, 1, 3, 4, 8, 7], [0, 3, 2, 7, 9, 6], [1, 2, 3, 5, 9, 8]])
    surface = outer_surface(X, facets)
    found = PatchLoad([0.5, 0.0, 0.0], 0.6, UP).shares(surface.rest, surface.triangles, surface.weights)
    assert found[4] == found.max()
