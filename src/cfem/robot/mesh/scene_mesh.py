"""The mesh of a scene, as fine as the scene asks for."""

from pathlib import Path
from typing import Any

from cfem.mechanics.mesh import Mesh
from cfem.robot.mesh.accuracy import accurate_mesh
from cfem.robot.mesh.grading import graded_mesh
from cfem.robot.spec import SceneSpec


def scene_mesh(scene: SceneSpec, folder: Path) -> tuple[Mesh, float | None, dict[str, Any] | None]:
    """The scene's mesh, its CAD volume mm^3 (meshing.make_mesh) and its `mesh_error`, graded where the scene states a
    number of cells or the error that it may have; an error that was not asked for is None."""
    return accurate_mesh(scene, folder) if scene.mesh.accuracy is not None else (*graded_mesh(scene, folder), None)
