"""The consistent mass matrix: against scikit-fem, closed forms of a rigid body, and of a rod's section."""

import numpy as np
import pytest
import skfem
from scipy.spatial import cKDTree
from skfem.models.poisson import mass
from support.blocks import box, box_body
from support.rods import LENGTH, SHAPE, rod_body

from cfem.mechanics.element import ELEMENTS
from cfem.mechanics.mass import gravity, mass_matrix

KINDS = {
    "tet4": (skfem.MeshTet, skfem.ElementTetP1),
    "tet10": (skfem.MeshTet, skfem.ElementTetP2),
    "hex8": (skfem.MeshHex, skfem.ElementHex1),
}
CORNERS = {"tet4": 4, "tet10": 4, "hex8": 8}
# scikit-fem's order of a hexahedron's corners from VTK's
HEX_ORDER = [0, 4, 3, 1, 7, 5, 2, 6]


@pytest.mark.parametrize("element", KINDS)
def test_it_is_that_of_scikit_fem(element):
    mesh = box((2.0, 1.0, 1.5), (2, 2, 2), element, distort=0.15)
    corners = mesh.cells[:, : CORNERS[element]]
    used, index = np.unique(corners, return_inverse=True)
    t = index.reshape(corners.shape).T
    kind, basis_of = KINDS[element]
    if element == "hex8":
        t = t[HEX_ORDER]
    theirs = skfem.Basis(kind(mesh.X[used].T, t), basis_of(), intorder=6)
    M = mass.assemble(theirs).toarray()
    _, place = cKDTree(mesh.X).query(theirs.doflocs.T)
    body = box_body((2.0, 1.0, 1.5), (2, 2, 2), element, distort=0.15)
    ours = mass_matrix(body, 3.0).toarray()
    np.testing.assert_allclose(ours[np.ix_(place, place)], 3.0 * M, atol=1e-14)


@pytest.mark.parametrize("element", ["tet4", "tet10p0", "hex8"])
def test_a_rigid_motion_has_the_kinetic_energy_of_a_rigid_box(element):
    a, b, c = size = np.array([2.0, 1.0, 1.5])
    body = box_body(size, (2, 2, 1), element)
    density = np.full(len(body.mesh.cells), 2.0)
    M = mass_matrix(body, density)
    total = 2.0 * size.prod()
    r = body.mesh.X - size / 2
    assert M.sum() == pytest.approx(total, rel=1e-13)
    np.testing.assert_allclose(r.T @ (M @ r), total / 12 * np.diag(size**2), atol=1e-13)
    omega = np.array([0.3, -0.2, 0.5])
    v = np.cross(omega, r)
    inertia = total / 12 * np.array([b**2 + c**2, a**2 + c**2, a**2 + b**2])
    assert np.einsum("ni,ni->", v, M @ v) == pytest.approx(float(omega**2 @ inertia), rel=1e-12)


def test_regions_have_their_own_density():
    body = box_body((2.0, 1.0, 1.0), (2, 1, 1), "tet10")
    left = body.mesh.X[body.mesh.cells].mean(axis=1)[:, 0] < 1.0
    M = mass_matrix(body, np.where(left, 1.0, 5.0))
    assert M.sum() == pytest.approx(6.0)
    assert float(body.mesh.X[:, 0] @ (M @ np.ones(len(body.mesh.X)))) == pytest.approx(1.0 * 0.5 + 5.0 * 1.5)


def test_a_turning_rod_has_the_rotary_inertia_of_its_sections():
    body = rod_body(5)
    M, X = mass_matrix(body, 3.0), body.mesh.X
    line = 3.0 * SHAPE.area
    assert M.sum() == pytest.approx(line * LENGTH, rel=1e-13)
    for omega, moment in (
        ([1.0, 0.0, 0.0], 3.0 * 2 * SHAPE.bending * LENGTH),
        ([0.0, 1.0, 0.0], line * LENGTH**3 / 3 + 3.0 * SHAPE.bending * LENGTH),
        ([0.0, 0.0, 1.0], line * LENGTH**3 / 3 + 3.0 * SHAPE.bending * LENGTH),
    ):
        v = np.cross(omega, X)
        assert np.einsum("ni,ni->", v, M @ v) == pytest.approx(moment, rel=1e-12)


@pytest.mark.parametrize("element", ELEMENTS)
def test_weight_and_its_moment_are_those_of_the_body(element):
    body = box_body((3, 2, 1), (3, 2, 1), element, distort=0.2)
    force = gravity(body, 2e-9, np.array([0.0, 0.0, -9810.0]))
    weight = 6.0 * 2e-9 * 9810.0
    np.testing.assert_allclose(force.sum(axis=0), [0, 0, -weight], rtol=1e-13, atol=1e-20)
    moment = np.cross(body.mesh.X, force).sum(axis=0)
    np.testing.assert_allclose(moment, np.cross([1.5, 1.0, 0.5], [0, 0, -weight]), rtol=1e-12, atol=1e-18)


def test_density_may_differ_from_cell_to_cell():
    body = box_body((2, 1, 1), (2, 1, 1))
    heavy = body.mesh.X[body.mesh.cells[:, :4]].mean(axis=1)[:, 0] > 1
    force = gravity(body, np.where(heavy, 3.0, 1.0), np.array([1.0, 0, 0]))
    assert force[:, 0].sum() == pytest.approx(4.0)
