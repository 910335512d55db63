import numpy as np
import pytest
from support.blocks import block

from cfem.core.errors import SpecError
from cfem.core.spec import load_spec
from cfem.mechanics.mesh import Mesh, boundary_facets, tet_volumes
from cfem.robot.mesh.finer import carried_over, cut_in_eight, finer_mesh
from cfem.robot.mesh.meshing import make_mesh
from cfem.robot.spec import SceneSpec

SIZE = (20.0, 10.0, 10.0)


@pytest.fixture(scope="module", params=[1, 2])
def coarse(request) -> Mesh:
    mesh = block(SIZE, (4, 2, 2), request.param, distort=0.2)
    held = np.flatnonzero(mesh.X[:, 0] == 0)
    ends = np.flatnonzero((mesh.X[mesh.facets][:, :, 0] == 0).all(axis=1))
    half = np.flatnonzero(mesh.X[mesh.cells[:, :4]].mean(axis=1)[:, 0] < 10)
    return Mesh(mesh.X, mesh.cells, mesh.facets, {"held": held}, {"end": ends}, {"half": half})


def test_eight_cells_fill_the_place_of_one(coarse):
    finer = cut_in_eight(coarse)
    parts = tet_volumes(finer.X, finer.cells).reshape(-1, 8)
    assert (parts > 0).all()
    np.testing.assert_allclose(parts.sum(axis=1), coarse.volumes, rtol=1e-12)
    np.testing.assert_allclose(parts, np.repeat(coarse.volumes[:, None] / 8, 8, axis=1), rtol=1e-9)


def test_facets_stay_the_boundary(coarse):
    finer = cut_in_eight(coarse)
    surface = {tuple(sorted(facet)) for facet in boundary_facets(finer.cells).tolist()}
    assert {tuple(sorted(facet)) for facet in finer.facets.tolist()} == surface
    corners = finer.X[finer.facets]
    outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    volume = np.einsum("ki,ki->", corners.mean(axis=1), outward) / 6  # divergence theorem
    np.testing.assert_allclose(volume, np.prod(SIZE), rtol=1e-12)


def test_named_sets_hold_the_same_places(coarse):
    finer = cut_in_eight(coarse)
    assert set(finer.node_sets["held"]) == set(np.flatnonzero(finer.X[:, 0] == 0))
    assert (finer.X[finer.facets[finer.facet_sets["end"]]][:, :, 0] == 0).all()
    assert len(finer.facet_sets["end"]) == 4 * len(coarse.facet_sets["end"])
    volume = tet_volumes(finer.X, finer.cells)[finer.cell_sets["half"]].sum()
    np.testing.assert_allclose(volume, coarse.volumes[coarse.cell_sets["half"]].sum(), rtol=1e-12)


def test_a_field_that_the_element_represents_is_carried_over_exactly(coarse):
    def moved(X):
        bend = 0.01 * X[:, :1] ** 2 if coarse.order == 2 else 0.2 * X[:, :1]
        return X + bend * [0.0, 1.0, 0.5] + 0.1 * X[:, [1, 2, 0]]

    finer = block(np.array(SIZE), (7, 3, 5))
    np.testing.assert_allclose(carried_over(coarse, moved(coarse.X), finer), moved(finer.X), atol=1e-10)


def scene(tmp_path, geometry, mesh):
    (tmp_path / "scene.yaml").write_text(
        f"name: bar\nout: out\nlength: 60 mm\ngeometry: {geometry}\nmesh: {mesh}\n"
        "material: {young: 1 MPa, poisson: 0.45}\nfixed: [{kind: plane, point: {mm: [0, 0, 0]}, normal: [-1, 0, 0]}]\n"
        "actuators: [{kind: cable, name: c, pull_point: {mm: [0, 0, 4]}, points: {mm: [[55, 0, 4]]}, "
        "reach: {mm: [0, 8]}}]\neffectors: [{name: tip, point: {mm: [59, 0, 0]}}]\n"
    )
    return load_spec(tmp_path / "scene.yaml", SceneSpec)


@pytest.mark.parametrize("mesh", ["{size: 5 mm, element: hex8}", "{size: 8 mm}", "{size: 8 mm, cells: 200}"])
def test_scenes_are_meshed_more_finely(tmp_path, mesh):
    spec = scene(tmp_path, "{kind: bar}", mesh)
    coarse = make_mesh(spec, tmp_path)[0]
    finer = finer_mesh(spec, coarse, tmp_path)
    assert len(finer.cells) == 8 * len(coarse.cells) and finer.cells.shape[1] == coarse.cells.shape[1]
    np.testing.assert_allclose(finer.volumes.sum(), 6000, rtol=1e-9)


def test_hexahedra_of_a_file_are_refused(tmp_path):
    spec = scene(tmp_path, "{kind: mesh-file, path: any.vtu}", "{size: 5 mm, element: hex8}")
    coarse = make_mesh(scene(tmp_path, "{kind: bar}", "{size: 5 mm, element: hex8}"), tmp_path)[0]
    with pytest.raises(SpecError, match="hexahedra of a mesh file are not cut"):
        finer_mesh(spec, coarse, tmp_path)
