"""What gmsh has meshed for the suite, once for all its processes: the same job gives the same mesh."""

import json
import os
import shutil
from collections.abc import Callable, Iterator
from hashlib import sha256
from pathlib import Path
from typing import Any
from unittest.mock import patch

from cfem.robot.mesh import ask_gmsh

GMSH = ask_gmsh._run


def meshed_once(shared: Path):
    """A context in which processes with the same folder `shared` do not mesh what one of them has."""
    meshes = shared / "meshes"
    meshes.mkdir(exist_ok=True)
    return patch.object(ask_gmsh, "_run", kept(GMSH, meshes))


def kept(run: Callable, kept_in: Path) -> Callable:
    """`ask_gmsh._run` that takes the answer to a job from a folder where it has been answered."""

    def answered(job, folder):
        answer = kept_in / f"{key_of(job)}.npz"
        if answer.exists():
            shutil.copyfile(answer, folder / "mesh.npz")
            return 0, ""
        code, said = run(job, folder)
        if code == 0:
            partial = kept_in / f"{answer.stem}.{os.getpid()}"
            shutil.copyfile(folder / "mesh.npz", partial)
            partial.replace(answer)
        return code, said

    return answered


def key_of(job: dict[str, Any]) -> str:
    """Hash of a job and of the files that it names, wherever they are."""
    digest, names = sha256(), []
    for text in texts(job):
        if Path(text).is_file():
            digest.update(Path(text).read_bytes())
            names.append(text)
    plain = json.dumps(job)
    for number, name in enumerate(names):
        plain = plain.replace(json.dumps(name), f"file {number}{Path(name).suffix}")
    digest.update(plain.encode())
    return digest.hexdigest()


def texts(data: Any) -> Iterator[str]:
    if isinstance(data, str):
        yield data
    elif isinstance(data, dict | list):
        for item in data.values() if isinstance(data, dict) else data:
            yield from texts(item)
