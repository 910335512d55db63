"""Whether what was made from a scene is of the robot that another scene describes."""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from cfem.core.artefact.changes import MOST, differences, in_words
from cfem.core.artefact.files import file_sha256, plain
from cfem.core.artefact.manifest import read_manifest
from cfem.core.errors import InputError
from cfem.core.spec import meaning
from cfem.robot.geometry import files
from cfem.robot.spec import SceneSpec

NAMES = ("name", "out")
FINENESS = ("size", "cells", "refine", "mirror")  # keys of `mesh` that make another mesh of the same robot


def robot_of(scene: SceneSpec) -> dict[str, Any]:
    """Plain data of a scene without names and mesh: all that determines the robot."""
    return plain(meaning(scene, {*NAMES, "mesh"}))


def recorded_robot(manifest: dict[str, Any]) -> dict[str, Any] | None:
    """Plain data of the robot that an artefact was made of, None where its manifest does not record a scene."""
    scene = manifest["origin"] and manifest["origin"].get("extra", {}).get("scene")
    return (
        None
        if not isinstance(scene, dict)
        else {key: value for key, value in scene.items() if key not in (*NAMES, "mesh")}
    )


def demand_robot(scene: SceneSpec, recorded: Any, where: Path, do: str) -> None:
    """Raises InputError where an artefact was made of a robot that differs from the scene's; None is of an unknown
    robot."""
    if recorded is not None:
        _demand_none(list(differences(recorded, robot_of(scene))), scene, where, do)


def demand_mesh_of(scene: SceneSpec, scene_path: Path, folder: Path) -> None:
    """Raises InputError where a mesh is not one of this scene: of the same element, and of the same robot where it was
    made from the same file; of the same shape where it was made from another file. It may be finer or coarser."""
    manifest = read_manifest(folder)
    recorded, source = manifest["origin"], manifest["source"]
    if recorded is None:
        return
    spec = folder.resolve() / source["spec"] if source else scene_path
    same_file = spec.exists() and spec.samefile(scene_path)
    changes = [
        change for change in differences(recorded["spec"], plain(meaning(scene))) if _matters(change[0], same_file)
    ]
    do = f"mesh this scene: cfem mesh {scene_path}"
    if same_file and source and source["set"]:
        do = f"it was made with --set {' '.join(source['set'])}, which nothing after it sees: edit {scene_path} instead"
    _demand_none(changes, scene, folder, do)
    for name, path in files(scene.geometry).items():
        if recorded["inputs"].get(name) != file_sha256(scene_path.parent / path):
            raise InputError(f"was made from another file than {path}", where=os.path.normpath(folder), do=do)


def _matters(key: tuple, same_file: bool) -> bool:
    """True if a change of this key makes another robot; of a mesh from another file only the shape counts."""
    if key[0] in NAMES or key[-1] == "path" or (key[0] == "mesh" and key[1] in FINENESS):
        return False
    return same_file or key[0] in ("geometry", "mesh")


def _demand_none(changes: list[tuple[tuple, Any, Any]], scene: SceneSpec, where: Path, do: str) -> None:
    """Raises InputError with the first few changes (key, old, new), if there are any."""
    if not changes:
        return
    sentences = list(_sentences(changes[:MOST], scene))
    if len(changes) > MOST:
        sentences.append(f"and {len(changes) - MOST} more")
    raise InputError(f"is not of this robot: {'; '.join(sentences)}", where=os.path.normpath(where), do=do)


def _sentences(changes: list[tuple[tuple, Any, Any]], scene: SceneSpec) -> Iterator[str]:
    for key, old, new in changes:
        name = ".".join(map(str, key))
        yield f"{name} was {in_words(scene, key, old)}, the scene has {in_words(scene, key, new)}"
