"""The outer surface of bodies, against areas and volumes of solids."""

import numpy as np
import pytest
from support.blocks import block, hexahedra

from cfem.constraint.surface import outer_surface


def volume(surface) -> float:
    corners = surface.rest[surface.triangles]
    return float(np.einsum("ij,ij->", np.cross(corners[:, 0], corners[:, 1]), corners[:, 2]) / 6)


@pytest.mark.parametrize("order, mesh", [(1, block), (2, block), (1, hexahedra)])
def test_triangles_enclose_the_body_and_weights_are_shares_of_its_surface(order, mesh):
    body = mesh((2, 3, 4), (2, 2, 3), order) if mesh is block else mesh((2, 3, 4), (2, 2, 3))
    surface = outer_surface(body.X, body.facets)
    assert volume(surface) == pytest.approx(24)
    assert surface.weights.sum() == pytest.approx(1) and (surface.weights > 0).all()
    # the mean height of the surface of a box is half of it; that of its square follows from the sides' areas
    height = surface.rest[:, 2]
    assert surface.weights @ height == pytest.approx(2)
    np.testing.assert_array_equal(body.X[surface.nodes], surface.rest)
    assert set(surface.nodes) == set(body.facets.ravel())


def test_a_closed_cavity_is_no_part_of_it():
    body = block((3, 3, 3), (3, 3, 3))
    centre = np.abs(body.X[body.cells].mean(axis=1) - 1.5).max(axis=1) > 0.5
    from cfem.mechanics.mesh import boundary_facets

    facets = boundary_facets(body.cells[centre])
    surface = outer_surface(body.X, facets)
    assert volume(surface) == pytest.approx(27) and len(surface.triangles) < len(facets)
