"""The walls of chambers come from the mesh of the model's samples, and hold the volume that the model states."""

import numpy as np
import pytest
from constraint.meshes import MIDDLE, VOID, hollow, icosphere
from export.pages import ROBOTS, browser, opened, skin_of

from cfem.core.artefact.files import content_sha256, file_sha256
from cfem.core.artefact.manifest import write_manifest
from cfem.export.firmware.embedding import Embedding
from cfem.export.page.chambers import ChamberWall, walls
from cfem.export.page.page import page
from cfem.export.spec import CSpec
from cfem.robot.mesh.mesh_file import write_mesh
from cfem.robot.stage import MESH

CAVITY = {"kind": "cavity", "name": "chamber", "inside": MIDDLE.tolist()}
ROBOT = {"geometry": {}, "actuators": [{"kind": "cable"}, CAVITY]}


@pytest.fixture(scope="module", params=["tet4", "tet10", "hex8"])
def made(request, tmp_path_factory):
    """A model folder whose samples lead to the mesh of a block with a void, and its skin."""
    root, mesh = tmp_path_factory.mktemp("made"), hollow(request.param)
    for name in ("mesh", "samples", "model"):
        (root / name).mkdir()
    write_mesh(root / "mesh" / MESH, mesh)
    inputs = {"mesh": {}, "samples": {"mesh": "../mesh"}, "model": {"dataset": "../samples"}}
    for name, above in inputs.items():
        files = {path.name: file_sha256(path) for path in (root / name).iterdir()}
        manifest = {"stage": name, "content": content_sha256(files), "files": files, "inputs": above}
        write_manifest(root / name, manifest)
    nodes = np.unique(mesh.facets)[::3]
    return root / "model", {"nodes": nodes, "rest": mesh.X[nodes]}


def volume(points, triangles):
    return -np.linalg.det(points[triangles]).sum() / 6  # the normals point into the chamber


def test_a_cavity_s_wall_is_the_mesh_s(made):
    model, skin = made
    (wall,) = walls(model, ROBOT, skin)
    assert wall.actuator == 1 and volume(wall.rest, wall.triangles) == pytest.approx(VOID)


def test_without_its_mesh_or_on_another_one_there_is_none(made, tmp_path):
    model, skin = made
    assert walls(tmp_path, ROBOT, skin) == [] and walls(model, None, skin) == []
    assert walls(model, ROBOT, skin | {"rest": skin["rest"] + 0.1}) == []
    outside = {**ROBOT, "actuators": [{**CAVITY, "inside": [-5.0, 0.0, 0.0]}]}
    assert [len(wall.triangles) for wall in walls(model, outside, skin)] == [0]
    unknown = {**ROBOT, "actuators": [{"kind": "cavity", "name": "chamber", "surface": "nowhere"}]}
    assert [len(wall.triangles) for wall in walls(model, unknown, skin)] == [0]


@pytest.mark.slow
def test_a_chamber_is_drawn_with_the_volume_that_the_model_states(tmp_path):
    meta, arrays = ROBOTS["two cables"]()
    X, facets = icosphere(2)
    ball = ChamberWall(1, np.arange(len(X)), 4 * X + [0.0, 0.0, -50.0], facets[:, ::-1])
    text = page(meta, arrays, skin_of(meta, arrays), CSpec(), Embedding(), walls=[ball])
    (tmp_path / "page.html").write_text(text, encoding="utf-8")
    with browser() as chromium:
        tab = opened(chromium, tmp_path / "page.html")
        for told in (0.0, 2.0, 5.0):
            grown, triangles, points = tab.evaluate(
                "told => { const { robot, chambers } = cfem; robot.set([14, told]); robot.delta_a[1] = 10 * told; "
                "robot.shape(); chambers[0].inflate(); "
                "return [robot.delta_a[1], [...chambers[0].sheet.triangles], [...robot.drawn]]; }",
                told,
            )
            found = volume(np.array(points).reshape(-1, 3), np.array(triangles).reshape(-1, 3))
            assert found == pytest.approx(volume(ball.rest, ball.triangles) + grown, rel=2e-3)
        assert tab.faults == []
