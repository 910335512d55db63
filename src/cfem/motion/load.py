"""Reading of a model that moves from its folder."""

from pathlib import Path

from cfem.core.errors import InputError
from cfem.motion.model import MotionModel
from cfem.predict.load import build, read_arrays, read_model

FILE = "motion.npz"


def load_motion(folder: Path) -> MotionModel:
    """Learned motion of a folder of `cfem train` or of an export as arrays. InputError where the model has not learned
    to move, or a file is damaged."""
    meta, arrays = read_model(folder)
    if not (folder / FILE).exists():
        raise InputError(
            "the model has not learned to move",
            where=str(folder),
            do="sample with dynamics: true and train again; of exports, `arrays` without loads hold it",
        )
    try:
        return MotionModel(build(meta, arrays), read_arrays(folder, FILE), meta["motion"]["viscosity"])
    except (InputError, KeyError, TypeError) as error:
        what = error.what if isinstance(error, InputError) else f"model.json says nothing of its motion ({error})"
        raise InputError(what, where=str(folder / FILE), do="train it again with --force") from None
