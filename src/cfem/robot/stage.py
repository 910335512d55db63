"""`cfem mesh`: scene.yaml to a mesh folder."""

from collections.abc import Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from cfem.core.artefact.judgement import poor
from cfem.core.errors import InputError
from cfem.core.stage import Command
from cfem.robot.geometry import Assembly, MeshFile, StepFile, files, singles
from cfem.robot.spec import SceneSpec

MESH = "mesh.vtu"


def _reads(scene: SceneSpec, folder: Path) -> dict[str, Path]:
    """The files of the geometry. InputError where one is missing."""
    parts = isinstance(scene.geometry, Assembly)
    for index, geometry in enumerate(singles(scene.geometry).values()):
        if isinstance(geometry, MeshFile | StepFile) and not (folder / geometry.path).is_file():
            where = scene.place("geometry", *(["parts", index, "geometry"] if parts else []), "path")
            what = f"no such file: {folder / geometry.path}"
            raise InputError(what, where=where, do="paths are relative to the scene's folder")
    return {name: folder / path for name, path in files(scene.geometry).items()}


def _work(target: Path, scene: SceneSpec, folder: Path) -> Mapping[str, Any]:
    """Meshes the robot, builds it once to find what cannot be attached, and writes the mesh. Returns its quality."""
    from cfem.robot.build import build_robot
    from cfem.robot.checks.cable_passage import demand_inside
    from cfem.robot.checks.plausible import doubts
    from cfem.robot.checks.soundness import demand_held, demand_independent, demand_unfolded
    from cfem.robot.mesh.accuracy import scene_mesh
    from cfem.robot.mesh.mesh_file import write_mesh
    from cfem.robot.mesh.quality import quality
    from cfem.robot.mesh.surface_file import mends_of

    mesh, volume, error = scene_mesh(scene, folder)
    figures = quality(mesh, volume)
    demand_unfolded(mesh, scene.name)
    robot = build_robot(scene, mesh)  # an attachment that cannot be made is an error now, not after an hour of sampling
    demand_held(robot)
    demand_independent(robot)
    demand_inside(scene, mesh.base)
    write_mesh(target / MESH, replace(mesh, node_sets={**mesh.node_sets, "fixed": robot.fixed}))
    judgement = [poor(doubt) for doubt in [*doubts(scene, robot), *figures.doubts(reads_cells(scene))]]
    mends = [f"{path}: {phrase}" for path, phrase in mends_of(scene.geometry, folder)]
    graded = "" if scene.mesh.cells is None else f"; sizes were graded for {scene.mesh.cells} cells"
    if error is not None:
        graded = (
            f"; its error is at most {100 * error['tip_mm'] / error['tip']['largest']:.2g} % of the effectors' travel"
        )
    estimated = {} if error is None else {"mesh_error": error}
    return {"headline": [figures.sentence() + graded, *mends], "judgement": judgement, **asdict(figures), **estimated}


def reads_cells(scene: SceneSpec) -> bool:
    """True if a part of the body keeps the cells of its mesh file."""
    return any(isinstance(single, MeshFile) and not single.meshed_here for single in singles(scene.geometry).values())


COMMAND = Command("mesh", 1, SceneSpec, _work, reads=_reads)
run, stage = COMMAND.run, COMMAND.stage
