import re
from itertools import product

import numpy as np
import pytest
from constraint.meshes import bricks
from scipy.spatial.transform import Rotation
from support.blocks import block
from support.fast_cases import fast_are

from cfem.constraint.attachment import attach, locate
from cfem.core.errors import SpecError
from cfem.mechanics.element import shape
from cfem.mechanics.mesh import Mesh

SIZE, DIVISIONS = (20, 10, 10), (4, 2, 2)
MESHES = {
    "tet4": block(SIZE, DIVISIONS, distort=0.2),
    "tet10": block(SIZE, DIVISIONS, order=2),
    "hex8": bricks(SIZE, DIVISIONS, distort=0.3),
}
every_mesh = pytest.mark.parametrize("mesh", MESHES.values(), ids=MESHES.keys())


@every_mesh
@pytest.mark.parametrize("point", [[5.0, 5, 5], [5.0, 0, 5], [20.0, 10, 10], [0.3, 0.2, 9.9]])
@pytest.mark.parametrize("radius", [0.0, 1.5, 3.0])
def test_follows_every_affine_motion(mesh, point, radius):
    """Inside, on a face, in a corner: weights sum to one and have their first moment at the point."""
    where = attach(mesh, np.array(point), radius, "point")
    F = np.random.default_rng(0).standard_normal((3, 3))
    np.testing.assert_allclose(where.position(mesh.X @ F.T + 1.0), F @ point + 1.0, atol=1e-11)
    assert where.weights.sum() == pytest.approx(1.0, abs=1e-12)


@every_mesh
@pytest.mark.parametrize("point", [[5.0, 5, 5], [5.0, 0, 5], [20.0, 10, 10], [0.3, 0.2, 9.9]])
@pytest.mark.parametrize("radius", [0.0, 1.5, 3.0])
def test_weights_turn_and_shift_with_the_body(mesh, point, radius):
    turn = Rotation.from_rotvec([0.3, -0.5, 0.2]).as_matrix()
    elsewhere = Mesh(mesh.X @ turn.T + [30.0, -20.0, 10.0], mesh.cells, mesh.facets)
    here = attach(mesh, np.array(point), radius, "point")
    there = attach(elsewhere, turn @ point + [30.0, -20.0, 10.0], radius, "point")
    np.testing.assert_allclose(weights(there, mesh), weights(here, mesh), rtol=0, atol=1e-12)


INSIDE, ON_A_FACE, IN_A_CORNER = (5.2, 4.9, 4.7), (5.0, 0, 5), (20.0, 10, 10)  # (the lattice fits the faces)


@pytest.mark.parametrize(
    "name, point",
    fast_are(
        [("tet10", INSIDE), ("tet4", ON_A_FACE), ("hex8", IN_A_CORNER)],
        product(MESHES, [INSIDE, ON_A_FACE, IN_A_CORNER]),
    ),
)
def test_weights_are_those_that_the_sums_over_finer_and_finer_lattices_approach(name, point):
    """The error of a lattice falls as its spacing squared, so two lattices extrapolate to the limit (Richardson)."""
    mesh = MESHES[name]
    coarse, fine = (by_lattice(mesh, np.array(point), 3.0, count) for count in (20, 40))
    found = weights(attach(mesh, np.array(point), 3.0, "point"), mesh)
    np.testing.assert_allclose(found, (4 * fine - coarse) / 3, rtol=0, atol=4e-4)


def by_lattice(mesh, point, radius, count):
    """(n,) the bump times an affine function, summed over the points of a cubic lattice that lie in ball and body."""
    axis = (np.arange(count) + 0.5) / (count / 2) - 1
    offset = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    offset = offset[(offset**2).sum(axis=1) < 1]
    cell, coordinates = locate(mesh, point + radius * offset, within=1e-9)
    offset, cell, coordinates = offset[cell >= 0], cell[cell >= 0], coordinates[cell >= 0]
    bump, basis = (1 - (offset**2).sum(axis=1)) ** 2, np.hstack([np.ones((len(offset), 1)), offset])
    affine = np.linalg.solve(basis.T @ (bump[:, None] * basis), [1.0, 0, 0, 0])
    shares = (bump * (basis @ affine))[:, None] * shape(mesh.cells.shape[1], coordinates)
    return np.bincount(mesh.cells[cell].ravel(), shares.ravel(), len(mesh.X))


def weights(where, mesh):
    """(n,) of all nodes."""
    return np.bincount(where.nodes, where.weights, len(mesh.X))


@every_mesh
def test_locate_finds_the_cell_that_holds_a_point(mesh):
    points = np.random.default_rng(0).uniform([0, 0, 0], SIZE, (200, 3))
    cells, coordinates = locate(mesh, points, within=1e-9)
    assert (cells >= 0).all()
    back = np.einsum("ka,kad->kd", shape(mesh.cells.shape[1], coordinates), mesh.X[mesh.cells[cells]])
    np.testing.assert_allclose(back, points, atol=1e-11)


@every_mesh
def test_locate_outside(mesh):
    """No cell, or the nearest; far, close by, and among points that lie inside."""
    points = np.array([[500.0, 5, 5], [20.01, 5, 5], [10.0, 5, 5]])
    assert (locate(mesh, points, within=1e-9)[0] >= 0).tolist() == [False, False, True]
    nearest = locate(mesh, points)[0]
    assert (mesh.X[mesh.cells[nearest[:2]]][..., 0].max(axis=1) == 20).all()


def test_locate_in_a_graded_mesh_of_hexahedra():
    """Cells from 0.02 to 9 mm: the cell that holds a point need not have the nearest centre."""
    mesh = bricks((1, 1, 1), (12, 1, 12))
    mesh.X[:] = 20 * mesh.X**4 * [1, 0, 1] + mesh.X * [0, 10, 0]
    points = np.random.default_rng(0).uniform(0, 1, (200, 3)) ** 4 * [20, 10, 20]
    cells, xi = locate(mesh, points, within=1e-9)
    assert (cells >= 0).all() and (np.abs(xi) <= 1 + 2e-9).all()


@pytest.mark.parametrize("mesh", [block(SIZE, DIVISIONS), bricks(SIZE, DIVISIONS)], ids=["tet4", "hex8"])
@pytest.mark.parametrize("radius", [0.0, 2.0])
def test_cells_restrict_to_one_body(mesh, radius):
    """At the seam of two bodies the point follows the one that is named."""
    left = np.flatnonzero(mesh.X[mesh.cells].mean(axis=1)[:, 0] < 10)
    cells, _ = locate(mesh, np.array([[9.9, 5, 5], [10.1, 5, 5]]), within=1e-9, cells=left)
    assert cells[0] in left and cells[1] == -1
    where = attach(mesh, np.array([9.9, 5, 5]), radius, "point", cells=left)
    assert set(where.nodes) <= set(mesh.cells[left].ravel())
    np.testing.assert_allclose(where.position(mesh.X), [9.9, 5, 5], atol=1e-12)
    with pytest.raises(SpecError, match="point at \\(15, 5, 5\\) mm lies outside"):
        attach(mesh, np.array([15.0, 5, 5]), radius, "point", cells=left)


@every_mesh
def test_a_point_just_off_the_surface_is_attached(mesh):
    """As one is on the curved side of a coarse mesh: up to half the radius off, or a thousandth of the body."""
    assert attach(mesh, np.array([20.9, 5, 5]), 2.0, "point").weights.sum() == pytest.approx(1, abs=1e-12)
    for radius, x in ((2.0, 21.1), (0.0, 20.1)):
        with pytest.raises(SpecError, match="lies outside the body"):
            attach(mesh, np.array([x, 5, 5]), radius, "point")


@pytest.mark.parametrize(
    "point, radius, part",
    [
        ([25.0, 5, 5], 2.0, "cable 'left' point 1 at (25, 5, 5) mm lies outside"),
        ([20.01, 5, 5], 1e-3, "has too little of the body within its radius of 0.001 mm (enlarge the radius"),
        ([10, 5, 5], 100, "within its radius of 100 mm (state a smaller radius: the body is 10 mm thin)"),
    ],
)
def test_bad_input_is_named(point, radius, part):
    with pytest.raises(SpecError, match=re.escape(part)):
        attach(MESHES["tet10"], np.array(point), radius, "cable 'left' point 1")
