"""Elements against elasticity's closed forms: no shear locking of hexahedra, no volume locking of tet10p0 and hex8.

Loads are so small that linear theory holds to 1e-3."""

from dataclasses import replace

import numpy as np
import pytest
from support.blocks import block, box, hexahedra
from support.boundary_value import newton

from cfem.mechanics.body import make_body, response
from cfem.mechanics.element import ELEMENTS
from cfem.mechanics.material import LAWS
from cfem.mechanics.material.law import Material
from cfem.mechanics.mesh import Mesh, boundary_facets, quadratic

YOUNG = 2.0


def mapped(element, divisions, motion):
    """The unit cube's structured mesh after `motion`; edges stay straight."""
    if ELEMENTS[element].n_nodes == 8:
        mesh = hexahedra((1, 1, 1), divisions)
        return replace(mesh, X=motion(mesh.X))
    mesh = block((1, 1, 1), divisions)
    X = motion(mesh.X)
    facets = boundary_facets(mesh.cells)
    return Mesh(*(quadratic(X, mesh.cells, facets) if ELEMENTS[element].order == 2 else (X, mesh.cells, facets)))


def surface_load(mesh, nodes, traction):
    """(n, 3) N: consistent forces of traction (3,) MPa, or of a pressure (a number, MPa), on the plane facets all of
    whose nodes are in the mask `nodes`: to equal parts on corners, or on the mid-edge nodes of quadratic triangles."""
    facets = mesh.facets[nodes[mesh.facets].all(axis=1)]
    corners = mesh.X[facets[:, : 4 if facets.shape[1] == 4 else 3]]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2  # times the area
    if facets.shape[1] == 4:
        normal *= 2  # a parallelogram
    force = -traction * normal if np.isscalar(traction) else np.linalg.norm(normal, axis=1)[:, None] * traction
    receivers = facets[:, 3:] if facets.shape[1] == 6 else facets
    load = np.zeros(mesh.X.shape)
    np.add.at(load, receivers, force[:, None] / receivers.shape[1])
    return load


def displacement(mesh, element, poisson, held, load):
    body = make_body(mesh, ELEMENTS[element], Material(LAWS["neo-hookean"], YOUNG, poisson))
    return newton(body, mesh.X, held, load, 1e-6) - mesh.X, body


def plain_hexahedra(body):
    """Without the incompatible modes."""
    element = replace(body.element, bubbles=0)
    solids = (
        replace(part, element=element, gradients=np.ascontiguousarray(part.gradients[:, :, :8])) for part in body.solids
    )
    return replace(body, element=element, solids=tuple(solids))


def bending(poisson, divisions, clamped=True):
    """Tip deflections of a 20 x 1 x 1 mm cantilever of hexahedra, with and without incompatible modes, both over
    P L^3 / (3 E I) + P L / (k G A), k of Cowper (The shear coefficient in Timoshenko's beam theory, J. Appl. Mech. 33,
    1966). clamped: the whole end; else it may bulge in its plane."""
    mesh = box((20, 1, 1), divisions, "hex8")
    body = make_body(mesh, ELEMENTS["hex8"], Material(LAWS["neo-hookean"], YOUNG, poisson))
    root, tip, bottom = mesh.X[:, 0] < 1e-9, mesh.X[:, 0] > 20 - 1e-9, mesh.X[:, 2] < 1e-9
    held = np.repeat(root[:, None], 3, axis=1)
    if not clamped:
        held[:, 2] &= bottom
        held[:, 1] &= bottom & (mesh.X[:, 1] < 1e-9)
    force, shear, coefficient = 1e-6, YOUNG / (2 * (1 + poisson)), 10 * (1 + poisson) / (12 + 11 * poisson)
    load = surface_load(mesh, tip, np.array([0, 0, force]))
    exact = force * 20**3 / (3 * YOUNG / 12) + force * 20 / (coefficient * shear)
    solutions = (newton(each, mesh.X, held, load, 1e-6) - mesh.X for each in (body, plain_hexahedra(body)))
    return [u[tip, 2].mean() / exact for u in solutions]


@pytest.mark.parametrize("poisson", [0.0, 0.3])
def test_slender_cantilever_of_hexahedra(poisson):
    """Eight elements of 2.5 x 1 x 1 mm. Without the modes such a hexahedron is too stiff in plane bending by
    (1 / (1 - nu) + (l / h)^2 / 2) / (1 + nu) (Cook et al., Concepts and Applications of Finite Element Analysis, 4th
    ed., on the bilinear rectangle)."""
    ours, plain = bending(poisson, (8, 1, 1))
    assert ours == pytest.approx(1, abs=0.02)
    assert 1 / plain == pytest.approx((1 / (1 - poisson) + 2.5**2 / 2) / (1 + poisson), rel=0.03)
    assert plain < 0.3


def test_slender_cantilever_of_hexahedra_next_to_incompressible():
    """Where the end may bulge. With the end clamped as a whole the deflection of this mesh is 11 % too small, and 3.5 %
    with 40 x 4 x 4 elements: these nine modes leave some volume locking where a clamp hinders bulging (Simo, Armero
    and Taylor, CMAME 110, 1993, add three modes against it)."""
    ours, plain = bending(0.499, (20, 1, 1), clamped=False)
    assert ours == pytest.approx(1, abs=0.02)
    assert plain < 0.5


@pytest.mark.parametrize("poisson", [0.3, 0.499])
@pytest.mark.parametrize("element", ["tet10p0", "hex8"])
def test_thick_walled_cylinder(element, poisson):
    """Lame's: radii 1 and 2 mm, internal pressure p, plane strain (Timoshenko and Goodier, Theory of Elasticity, 3rd
    ed., section 28): u_r = (1 + nu) p a^2 / (E (b^2 - a^2)) ((1 - 2 nu) r + b^2 / r), of uniform dilatation."""
    mesh, radial, dilatation, pressure = cylinder(element, poisson)
    r = np.linalg.norm(mesh.X[:, :2], axis=1)
    scale = (1 + poisson) * pressure / (3 * YOUNG)
    np.testing.assert_allclose(radial, scale * ((1 - 2 * poisson) * r + 4 / r), rtol=0.01)
    np.testing.assert_allclose(dilatation, 2 * (1 - 2 * poisson) * scale, rtol=0.3)


def test_linear_tetrahedra_lock_in_the_incompressible_cylinder():
    mesh, radial, dilatation, pressure = cylinder("tet4", 0.499)
    r = np.linalg.norm(mesh.X[:, :2], axis=1)
    scale = 1.499 * pressure / (3 * YOUNG)
    assert (radial / (scale * (0.002 * r + 4 / r))).min() < 0.6
    assert np.abs(dilatation).max() > 10 * 0.004 * scale


def cylinder(element, poisson):
    """Mesh of a quarter of the cylinder, radial displacement (n,) mm, dilatation at the quadrature points, and p."""

    def ring(X):
        radius, angle = 1 + X[:, 0], np.pi / 2 * X[:, 1]
        return np.stack([radius * np.cos(angle), radius * np.sin(angle), 0.2 * X[:, 2]], axis=1)

    divisions, pressure = (8, 12, 1), 1e-5
    mesh = mapped(element, divisions, ring)
    inner = mapped(element, divisions, lambda X: X).X[:, 0] < 1e-9
    held = np.stack([mesh.X[:, 0] < 1e-9, mesh.X[:, 1] < 1e-9, np.ones(len(mesh.X), dtype=bool)], axis=1)
    u, body = displacement(mesh, element, poisson, held, surface_load(mesh, inner, pressure))
    radial = (u[:, :2] * mesh.X[:, :2]).sum(axis=1) / np.linalg.norm(mesh.X[:, :2], axis=1)
    dilatation = response(body, mesh.X + u).solids[0].point_pressure / body.solids[0].bulk
    return mesh, radial, dilatation, pressure


def cook(element, n, poisson):
    """Vertical displacement (mm) of the upper right corner of Cook's membrane (48 mm long, 44 mm high on the left where
    it is held, 16 mm on the right where it is sheared; Cook, J. Struct. Div. 100, 1974) in plane strain."""

    def membrane(X):
        return np.stack([48 * X[:, 0], 44 * X[:, 0] + X[:, 1] * (44 - 28 * X[:, 0]), 2 * X[:, 2]], axis=1)

    mesh = mapped(element, (n, n, 1), membrane)
    held = np.zeros(mesh.X.shape, dtype=bool)
    held[:, 2] = True
    held[mesh.X[:, 0] < 1e-9] = True
    right = mesh.X[:, 0] > 48 - 1e-9
    u, _ = displacement(mesh, element, poisson, held, surface_load(mesh, right, np.array([0, 1e-4, 0])))
    return u[right & (mesh.X[:, 1] > 60 - 1e-9), 1].mean()


def test_cooks_membrane_next_to_incompressible():
    """Against a fine mesh of hexahedra: tet10p0 does not lock, linear tetrahedra on as many nodes, and on more, do."""
    fine = cook("hex8", 48, 0.499)
    assert cook("tet10p0", 8, 0.499) == pytest.approx(fine, rel=0.02)
    assert cook("tet10p0", 16, 0.499) == pytest.approx(fine, rel=0.01)
    assert cook("tet4", 16, 0.499) < 0.4 * fine
    assert cook("tet4", 32, 0.499) < 0.5 * fine


@pytest.mark.slow
def test_cooks_membrane_compressible():
    fine = cook("hex8", 48, 0.3)
    for element, n in {"tet4": 48, "tet10": 16, "tet10p0": 16, "hex8": 24}.items():
        assert cook(element, n, 0.3) == pytest.approx(fine, rel=0.03)
