"""A scene and the mesh that was made of it."""

from pathlib import Path
from typing import Any

from cfem.core.artefact.chain import demand_current
from cfem.core.artefact.content import artefact_content, artefact_file
from cfem.core.spec import load_spec
from cfem.mechanics.mesh import Mesh
from cfem.robot.mesh.mesh_file import read_mesh
from cfem.robot.same_robot import demand_mesh_of
from cfem.robot.spec import SceneSpec, scene_meaning
from cfem.robot.stage import MESH


def load_scene_and_mesh(scene_path: Path, mesh_folder: Path | None = None) -> tuple[SceneSpec, Mesh]:
    """The mesh is that of the scene's own `out` unless `mesh_folder` is given. InputError where one is missing, or the
    mesh is stale or of another robot."""
    scene = load_spec(scene_path, SceneSpec)
    folder = mesh_folder or scene_path.parent / scene.out
    demand_current(folder)
    demand_mesh_of(scene, scene_path, folder)
    return scene, read_mesh(artefact_file(folder, MESH))


def made_from(scene: Path, mesh_folder: Path) -> dict[str, Any]:
    """Scene and mesh of a robot as plain data, by which artefacts tell whether it has changed."""
    return {"scene": scene_meaning(scene), "mesh": artefact_content(mesh_folder)}
