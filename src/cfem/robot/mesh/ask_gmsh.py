"""What gmsh's process answers to a job, and how a body is meshed that it fails at first."""

import json
import signal
import subprocess  # nosec B404
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from cfem.core.errors import InputError, NumericalError
from cfem.core.optional import demand
from cfem.robot.cad import File, Solid, SurfaceSolid
from cfem.robot.mesh.surface_file import read_surface

# What gmsh's wheel needs of a bare Debian (readelf -d on its library).
DEBIAN_PACKAGES = "libglu1-mesa libgl1 libgomp1 libxcursor1 libxft2 libxinerama1 libxfixes3 libxrender1 libfontconfig1"

_NO_GMSH, _SEPARATE = 10, 13  # exit codes after which no other settings help
# factor: of all sizes. anew: whether a surface gets new triangles. around: least number of edges round a full turn.
# gmsh may fail, crash or never end at one size, and succeed at a size close to it. The last attempt for a surface keeps
# its own triangles. Faces of CAD whose radius is small beside the cells (a curved channel) need edges around them.
_USUAL = {"factor": 1.0, "anew": True, "around": 0}
_ATTEMPTS: dict[type, tuple[dict[str, Any], ...]] = {
    SurfaceSolid: (_USUAL, _USUAL | {"factor": 0.95}, _USUAL | {"factor": 1.05}, _USUAL | {"anew": False}),
    File: (_USUAL, _USUAL | {"around": 6}, _USUAL | {"around": 10}),
}
_TOO_LONG = "gmsh does not come to an end"
_PATIENCE = 20  # times the processor's time of the other attempts: of the last one


def ask_gmsh(job: dict[str, Any], solid: Solid) -> dict[str, np.ndarray]:
    """The answer to a job (gmsh_process.py) about a body. InputError where a file cannot be meshed or gmsh not be
    loaded, NumericalError where another geometry cannot be meshed."""
    demand("gmsh", where="a mesh of this geometry")
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        if isinstance(solid, SurfaceSolid):
            X, triangles, _ = read_surface(Path(solid.path), solid.body)
            np.savez(folder / "surface.npz", X=solid.unit * X, triangles=triangles)
            job = {**job, "surface": str(folder / "surface.npz")}
        attempts = _ATTEMPTS.get(type(solid), (_USUAL,))
        for settings in attempts:
            patience = _PATIENCE if settings is attempts[-1] else 1
            code, stderr = _run({**job, **settings, "patience": patience}, folder)
            if code in (0, _NO_GMSH, _SEPARATE):
                break
        if code == 0:
            with np.load(folder / "mesh.npz") as answer:
                return dict(answer)
    where = solid.path if isinstance(solid, File | SurfaceSolid) else "geometry"
    cause = stderr.strip().splitlines()[-1] if stderr.strip() else f"exit {code}"
    if code == _NO_GMSH:
        raise InputError(f"gmsh cannot be loaded: {cause}", do=f"on Debian: apt-get install {DEBIAN_PACKAGES}")
    if code == _SEPARATE:
        do = "let solids touch that are one body, or make each a file of its own and a part of `kind: assembly`"
        raise InputError(cause, where=where, do=do)
    kind = InputError if isinstance(solid, File | SurfaceSolid) else NumericalError
    raise kind(f"cannot be meshed: {cause}", where=where, do="repair the geometry or change mesh.size")


def _run(job: dict[str, Any], folder: Path) -> tuple[int, str]:
    """Exit code of gmsh's process, negative where it crashed, and its stderr; its answer is in mesh.npz."""
    (folder / "job.json").write_text(json.dumps(job), encoding="utf-8")
    files = [str(folder / "job.json"), str(folder / "mesh.npz")]
    # -P: no module is taken from the working folder
    command = [sys.executable, "-P", "-m", "cfem.robot.mesh.gmsh_process", *files]
    with (
        open(folder / "stderr", "wb") as log,
        # this interpreter on a module of ours, which ends when its stdin does: it never outlives this process
        subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=log) as process,  # nosec B603
    ):
        code = process.wait()
    stderr = (folder / "stderr").read_text(errors="replace")
    return code, _TOO_LONG if code == -getattr(signal, "SIGXCPU", 0) else stderr
