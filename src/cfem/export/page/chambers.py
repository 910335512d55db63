"""The walls of a robot's chambers, for a page to draw: from the mesh that the model's samples were solved on."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cfem.constraint.cavity import enclosed
from cfem.constraint.surface import triangulated
from cfem.core.artefact.content import artefact_file
from cfem.core.artefact.manifest import read_manifest
from cfem.core.errors import InputError, SpecError
from cfem.mechanics.mesh import Mesh
from cfem.robot.mesh.mesh_file import read_mesh
from cfem.robot.selection import facets_of
from cfem.robot.stage import MESH

ON_THE_WAY = ("dataset", "base", "mesh")  # inputs that lead from a model to its mesh


@dataclass(frozen=True)
class ChamberWall:
    """The wall of the chamber of actuator number `actuator`. nodes (p,): numbers in the mesh; rest (p, 3) mm; triangles
    (t, 3) indices into nodes, normals into the chamber."""

    actuator: int
    nodes: np.ndarray
    rest: np.ndarray
    triangles: np.ndarray


def walls(model_folder: Path, robot: dict[str, Any] | None, skin: dict[str, np.ndarray]) -> list[ChamberWall]:
    """Those of the cavities that the model says its robot has; none where its mesh is gone, or is no longer the one
    that the skin was made on."""
    cavities = [
        (i, actuator) for i, actuator in enumerate(robot["actuators"] if robot else []) if actuator["kind"] == "cavity"
    ]
    mesh = mesh_of(model_folder) if cavities else None
    nodes = skin.get("nodes", np.zeros(0, int))
    if mesh is None or not len(nodes) or nodes.max() >= len(mesh.X) or not np.allclose(mesh.X[nodes], skin["rest"]):
        return []
    return [_wall(number, mesh, facets_around(mesh, cavity)) for number, cavity in cavities]


def mesh_of(artefact: Path) -> Mesh | None:
    """The mesh that an artefact was made on, by the manifests on the way to it; None where one of them is gone."""
    try:
        inputs = read_manifest(artefact)["inputs"]
        if "mesh" in inputs:
            return read_mesh(artefact_file(artefact / inputs["mesh"], MESH))
    except InputError:
        return None
    return next((mesh_of(artefact / inputs[name]) for name in ON_THE_WAY if name in inputs), None)


def facets_around(mesh: Mesh, cavity: dict[str, Any]) -> np.ndarray:
    """Facets (g, 3 | 6 | 4) of a cavity's wall, as its scene describes it; none where the mesh has no such void."""
    try:
        if cavity.get("inside") is None:
            return facets_of(mesh, cavity["surface"], cavity["name"])
        return mesh.facets[enclosed(mesh, cavity["inside"], cavity["name"])]
    except SpecError:
        return mesh.facets[:0]


def _wall(number: int, mesh: Mesh, facets: np.ndarray) -> ChamberWall:
    triangles = triangulated(facets)
    nodes, place = np.unique(triangles, return_inverse=True)
    return ChamberWall(number, nodes, mesh.X[nodes], place.reshape(triangles.shape))
