"""The model of an export under the loads of its spec."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from cfem.constraint.patch import PatchLoad
from cfem.core.errors import InputError
from cfem.equilibrium.contact.patch_effectors import PatchYield
from cfem.export.spec import ExportSpec
from cfem.predict.contact.surface.kept_patches import yield_of
from cfem.predict.load import build, read_arrays, with_skin
from cfem.predict.loads.loaded import loaded, wrench_of
from cfem.predict.loads.spec import loads_of
from cfem.predict.protocol import Predictor
from cfem.predict.rows import serial_skin
from cfem.predict.rows.serial import SerialPredictor
from cfem.predict.rows.serial_patches import with_skins
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh, made_from


def solves_patches(spec: ExportSpec) -> bool:
    """Tells whether finite elements say how patches under loads yield."""
    return spec.scene is not None and any(load.at is not None for load in spec.loads.values())


def under_loads(
    spec: ExportSpec,
    meta: dict,
    arrays: dict[str, np.ndarray],
    vectors: dict[str, np.ndarray],
    folder: Path,
    scene: Path | None,
) -> tuple[dict, dict, dict]:
    """The model of `folder` under the loads of the spec, and what it gives at the test inputs. InputError where it has
    loads already, or cannot take these."""
    where = str(spec.model)
    if meta.get("wrench") is not None:
        raise InputError("carries loads already", where=where, do="export the trained model")
    trained = with_skin(build(meta, arrays), folder)
    forces, patches = loads_of(spec.loads, meta.get("masses", {}))
    row = isinstance(trained, SerialPredictor)
    try:
        by_fe = _by_fe(trained, folder, scene, patches) if solves_patches(spec) and not row else None
        model = loaded(trained, wrench_of(trained.rows, forces), patches, by_fe)
    except InputError as error:
        raise InputError(error.what, where=where, do=error.do) from None
    kept = [i for i, parameter in enumerate(trained.parameters) if not parameter.exact]
    p = vectors["p"][:, kept]
    W, delta_free = model.evaluate(vectors["s"], p if kept else None)
    carried = with_skins(model.arrays, read_arrays(folder, serial_skin.FILE)) if row and patches else model.arrays
    return model.meta, carried, {"s": vectors["s"], "p": p, "W": W, "delta_free": delta_free}


def _by_fe(model: Predictor, folder: Path, scene: Path, patches: Sequence[PatchLoad]) -> PatchYield | None:
    described, mesh = load_scene_and_mesh(scene)
    made_of = made_from(scene, scene.parent / described.out)
    return yield_of(model, folder, build_robot(described, mesh), made_of, patches)
