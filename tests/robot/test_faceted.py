"""The surface of a mesh in STEP and STL files, read back by the CAD kernel."""

from dataclasses import replace

import numpy as np
import pytest
from support.blocks import block, hexahedra

from cfem.core.errors import SpecError
from cfem.mechanics.mesh import Mesh
from cfem.robot.cad import File
from cfem.robot.faceted import triangles, write_faceted
from cfem.robot.meshing import measure


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
        assert measure(File(str(file)))[0] == pytest.approx(mesh.volumes.sum(), rel=error)


def test_quadrilaterals_are_cut_in_two():
    mesh = hexahedra((20, 10, 10), (2, 1, 1))
    X, corners = triangles(mesh)
    a, b, c = (X[corners[:, i]] for i in range(3))
    assert np.einsum("ij,ij->", np.cross(a, b), c) / 6 == pytest.approx(2000.0)


def test_closed_cavities_are_refused_in_step(tmp_path):
    outer, inner = block((20, 10, 10), (2, 1, 1)), block((2, 2, 2), (1, 1, 1))
    facets = np.vstack([outer.facets, inner.facets[:, ::-1] + len(outer.X)])
    hollow = Mesh(np.vstack([outer.X, inner.X + 4]), outer.cells, facets)
    with pytest.raises(SpecError, match="closed cavities"):
        write_faceted(hollow, "part", tmp_path / "part.step")
    write_faceted(hollow, "part", tmp_path / "part.stl")
    assert (tmp_path / "part.stl").stat().st_size == 84 + 50 * len(facets)
