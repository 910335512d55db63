"""The surface of a mesh in STEP and STL files, read back by the CAD kernel."""

from dataclasses import replace

import numpy as np
import pytest
from support.blocks import block, hexahedra

from cfem.core.errors import SpecError
from cfem.mechanics.mesh import Mesh
from cfem.robot.cad import File, SurfaceSolid
from cfem.robot.mesh.faceted import triangles, write_faceted
from cfem.robot.mesh.meshing import measure


def bulged(order: int) -> Mesh:
    mesh = block((20, 10, 10), (4, 2, 2), order=1)
    X = mesh.X + np.outer(np.sin(np.pi * mesh.X[:, 0] / 20), [0, 0, 1.5]) * (mesh.X[:, 2:] > 5)
    made = replace(mesh, X=X)
    if order == 1:
        return made
    from cfem.mechanics.mesh import quadratic

    return Mesh(*quadratic(made.X, made.cells, made.facets))


@pytest.mark.parametrize("order", [1, 2])
def test_both_files_hold_the_volume_of_the_mesh(tmp_path, order):
    mesh = bulged(order)
    for suffix, error in ((".step", 1e-9), (".stl", 1e-5)):
        file = tmp_path / f"part{suffix}"
        write_faceted(mesh, "part", file)
        kind = SurfaceSolid if file.suffix == ".stl" else File
        assert measure(kind(str(file)))[0] == pytest.approx(mesh.volumes.sum(), rel=error)


def test_quadrilaterals_are_cut_in_two():
    mesh = hexahedra((20, 10, 10), (2, 1, 1))
    X, corners = triangles(mesh)
    a, b, c = (X[corners[:, i]] for i in range(3))
    assert np.einsum("ij,ij->", np.cross(a, b), c) / 6 == pytest.approx(2000.0)


def beside(other: Mesh, inward: bool) -> Mesh:
    """A block with the surface of another one, 4 mm along each axis."""
    block_ = block((20, 10, 10), (2, 1, 1))
    facets = other.facets[:, ::-1] if inward else other.facets
    return Mesh(np.vstack([block_.X, other.X + 4]), block_.cells, np.vstack([block_.facets, facets + len(block_.X)]))


def test_closed_cavities_are_voids(tmp_path):
    hollow = beside(block((2, 2, 2), (1, 1, 1)), inward=True)
    for suffix in (".step", ".stl"):
        write_faceted(hollow, "part", tmp_path / f"part{suffix}")
    assert measure(File(str(tmp_path / "part.step")))[0] == pytest.approx(2000 - 8, rel=1e-9)
    assert (tmp_path / "part.stl").stat().st_size == 84 + 50 * len(hollow.facets)


def test_two_bodies_are_refused_in_step(tmp_path):
    both = beside(block((2, 2, 2), (1, 1, 1)), inward=False)
    with pytest.raises(SpecError, match="2 separate bodies"):
        write_faceted(both, "part", tmp_path / "part.step")
