"""Writes the page of a trained model: its own skin, or that of another model of the same robot."""

from pathlib import Path
from typing import Any

import numpy as np

from cfem import viewer
from cfem.core.artefact.files import file_sha256, write_whole
from cfem.core.artefact.judgement import sentences, with_inherited
from cfem.core.artefact.manifest import read_manifest
from cfem.core.errors import InputError
from cfem.export.firmware.embedding import Embedding
from cfem.export.page.chambers import walls
from cfem.export.page.page import ASSETS, page
from cfem.export.spec import ExportSpec
from cfem.motion.load import FILE as MOTION
from cfem.predict.array_predictor import build
from cfem.predict.load import has_file, read_arrays, read_meta, skin_of
from cfem.predict.loads.loaded_skin import skin_under_loads_of
from cfem.predict.protocol import Predictor
from cfem.predict.series.skin import FILE


def write_page(
    path: Path,
    spec: ExportSpec,
    meta: dict,
    arrays: dict[str, np.ndarray],
    model_folder: Path,
    skin_folder: Path,
    robot: Embedding,
) -> int:
    """Bytes of the page. meta, arrays: of the model, under the loads of the spec; skin_folder: of the model whose
    skin it draws."""
    moved = [
        parameter["name"] for parameter in meta["parameters"] if parameter["key"].startswith(("geometry", "shape"))
    ]
    if spec.c.parameters and moved:
        what = f"the surface of other designs is not known: '{moved[0]}' changes where it rests"
        raise InputError(what, where="c.parameters", do="leave the parameters out, for the scene's own design")
    predictor = build(meta, arrays)
    skin = read_skin(skin_folder, predictor)
    if spec.loads:
        skin = skin_under_loads_of(predictor, skin)
    concerns = sentences(with_inherited({}, {"model": model_folder}))
    moves = has_file(model_folder, MOTION) and not spec.loads and not spec.c.parameters and meta["kind"] == "spectral"
    moving = read_arrays(model_folder, MOTION) if moves else None
    chambers = walls(skin_folder, meta["robot"], skin)
    text = page(meta, arrays, skin, spec.c, robot, concerns, moving, chambers).encode()
    write_whole(path, text)
    return len(text)


def read_skin(folder: Path, predictor: Predictor) -> dict[str, np.ndarray]:
    """The arrays of a model folder's skin, for a model of the same inputs. InputError where it has none."""
    if FILE not in read_manifest(folder)["files"]:
        do = "train a model of samples with `skin: {}` in sample.yaml, or name one that has a skin under `skin`"
        raise InputError("the model has no skin, so there is nothing to draw", where=str(folder), do=do)
    arrays, of_skin = read_arrays(folder, FILE), read_meta(folder)
    of_model = predictor.meta
    for what, expected, present in (
        ("actuators", of_model["rows"]["actuators"], of_skin["rows"]["actuators"]),
        ("form", of_model["form"], of_skin["form"]),
        ("robot", of_model.get("robot"), of_skin.get("robot")),
        ("parameters", of_model["parameters"], of_skin["parameters"]),
    ):
        if expected != present:
            raise InputError(
                f"the skin is of a model with another {what}", where=str(folder), do="name one of this robot"
            )
    try:
        skin_of(predictor, arrays)
    except InputError as error:
        raise InputError(error.what, where=str(folder / FILE), do="train it again") from None
    return arrays


def sources() -> dict[str, Any]:
    """Content hashes of what every page holds, and of what puts it together."""
    folders = [Path(str(ASSETS)), Path(viewer.__file__).parent]
    held = [
        path for folder in folders for path in folder.iterdir() if path.is_file() and path.suffix not in (".c", ".h")
    ]
    return {path.name: file_sha256(path) for path in sorted([*held, *Path(__file__).parent.glob("*.py")])}
