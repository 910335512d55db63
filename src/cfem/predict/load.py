"""Reading of predictors from model folders, which may be replaced while they are in use."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np

from cfem.core.artefact.content import artefact_file
from cfem.core.artefact.files import read_json
from cfem.core.artefact.manifest import MANIFEST, read_manifest
from cfem.core.errors import InputError
from cfem.core.optional import demand
from cfem.core.reading import checked, read_npz, take
from cfem.predict.array_predictor import build
from cfem.predict.card import ABSENT, FORMAT, ModelCard
from cfem.predict.contact.kept_error import contact_errors
from cfem.predict.kinds import mlp, spectral  # noqa: F401  (each joins KINDS)
from cfem.predict.protocol import Predictor
from cfem.predict.rows import kind as row_kind  # noqa: F401  (joins KINDS)
from cfem.predict.rows import serial, serial_skin
from cfem.predict.series.skin import FILE, LearnedSkin

TRIES = 10  # to read a folder that is replaced meanwhile
ASKED = 16  # states at which a model that is loaded has to give finite numbers
WEIGHTS, VECTORS = "weights.npz", "test_vectors.npz"
UNBOUNDED = ("in_scale", mlp.AT_REST + "in_scale")  # infinite for inputs that did not vary
Runtime = Literal["arrays", "onnx"]


def load_model(folder: Path, runtime: Runtime = "arrays", with_skin: bool = False) -> Predictor:
    """The model of a folder that `cfem train` or `cfem export` made; with_skin: its skin is read now, if it has one.
    InputError where a file is missing or damaged.

    A folder that is replaced meanwhile is read again, so that no model is half of one and half of another."""
    for _ in range(TRIES):
        known = stamp(folder)
        try:
            predictor = _load(folder, runtime)
            if with_skin and (has_skin(folder) or has_file(folder, serial_skin.FILE)):
                predictor.skin  # noqa: B018 - kept there
        except InputError:
            if known == stamp(folder):
                raise
            continue
        if known == stamp(folder):
            return predictor
    raise InputError("is being replaced again and again", where=str(folder), do="wait until the training ends")


def stamp(folder: Path) -> tuple[int, int] | None:
    """Stamp that differs between the folders that a name leads to, one after the other; None without a folder."""
    try:
        status = (folder / MANIFEST).stat()
    except OSError:
        return None
    return status.st_ino, status.st_ctime_ns  # a number is used again, and copies keep their mtime


def _load(folder: Path, runtime: Runtime) -> Predictor:
    """The model that is in the folder now, on NumPy arrays or through ONNX Runtime."""
    if runtime == "arrays":
        return with_skin(build(*read_model(folder)), folder)
    demand("onnx", "onnxruntime", where="runtime: onnx")
    from cfem.predict.kinds.onnx import OnnxPredictor

    path = artefact_file(folder, "model.onnx")
    predictor = OnnxPredictor(read_meta(folder), path)
    with _blaming(path):
        demand_finite(predictor)
    return with_skin(predictor, folder)


def with_skin(predictor: Predictor, folder: Path) -> Predictor:
    """The predictor, which reads the skin of the folder when somebody asks for it."""

    row = isinstance(predictor, serial.SerialPredictor)
    name, known = serial_skin.FILE if row else FILE, stamp(folder)

    def read() -> LearnedSkin | list[LearnedSkin] | None:
        if not has_file(folder, name):
            return None
        with _blaming(folder / name):
            skin = (skins_of if row else skin_of)(predictor, read_arrays(folder, name))
        if known != stamp(folder):
            raise InputError("was replaced since the model was read", where=str(folder), do="read the model again")
        return skin

    predictor.skin_source = read
    predictor.contact_errors_source = partial(contact_errors, folder)
    return predictor


def has_skin(folder: Path) -> bool:
    """True where the model of a folder has a skin."""
    return has_file(folder, FILE)


def has_file(folder: Path, name: str) -> bool:
    """True where the manifest of a model folder names this file."""
    return name in read_manifest(folder)["files"]


def skin_of(predictor: Predictor, arrays: dict[str, np.ndarray]) -> LearnedSkin:
    """InputError naming the array that is missing or does not fit."""
    rows = predictor.rows
    return LearnedSkin(predictor.form, rows.n_e, rows.n_a, predictor.n_inputs, arrays)


def skins_of(predictor: serial.SerialPredictor, arrays: dict[str, np.ndarray]) -> list[LearnedSkin]:
    """Skins of the models of a row's modules."""
    return [skin_of(model, serial.module_arrays(arrays, number)) for number, model in enumerate(predictor.models)]


def read_model(folder: Path) -> tuple[dict, dict[str, np.ndarray]]:
    """Content of model.json and the arrays, of which a predictor can be built. InputError where they are missing or
    damaged, or do not fit each other."""
    meta, arrays = read_meta(folder), read_arrays(folder)
    with _blaming(folder / WEIGHTS):
        demand_finite(build(meta, arrays))
    return meta, arrays


def read_vectors(folder: Path, meta: dict) -> dict[str, np.ndarray]:
    """The test inputs s and p of a model folder, W and delta_free that the model gave there. InputError where they are
    not of a model like `meta`."""
    arrays = read_arrays(folder, VECTORS)
    n_a = len(meta["rows"]["actuators"])
    n = len(meta["rows"]["effectors"]) + n_a
    with _blaming(folder / VECTORS):
        m = len(take(arrays, "s", (None, n_a)))
        sizes = {"s": (m, n_a), "p": (m, len(meta["parameters"])), "W": (m, n, n), "delta_free": (m, n)}
        return {name: take(arrays, name, size) for name, size in sizes.items()}


@contextmanager
def _blaming(path: Path) -> Iterator[None]:
    """Adds the file to what is wrong with its content."""
    try:
        yield
    except InputError as error:
        raise InputError(error.what, where=error.where or str(path), do=error.do or "train it again") from None


def demand_finite(predictor: Predictor) -> None:
    """InputError where a model gives no finite numbers at some of the states that it was trained on."""
    n_a, states = predictor.rows.n_a, predictor.domain.states
    inputs = slice(0, n_a) if predictor.form == "displacement" else slice(n_a, 2 * n_a)
    with np.errstate(all="ignore"):
        try:
            asked = [predictor.at(row[inputs]) for row in states[:: -(-len(states) // ASKED)]]
            finite = all(np.isfinite(state.W).all() and np.isfinite(state.delta).all() for state in asked)
        except np.linalg.LinAlgError:
            finite = False
    if not finite:
        raise InputError("gives numbers that are not finite at a state that it was trained on")


def read_meta(folder: Path) -> dict:
    """Content of model.json. InputError where it is missing, damaged or of a kind or format that this version does not
    know."""
    path = artefact_file(folder, "model.json")
    meta = {**ABSENT, **read_json(path)}
    if meta.get("format") != FORMAT:
        what = f"has format {str(meta.get('format'))[:50]}; this version of cfem reads format {FORMAT}"
        raise InputError(what, where=str(path), do="train it again")
    checked(ModelCard, meta, str(path), "train it again")
    return meta


def read_arrays(folder: Path, name: str = WEIGHTS) -> dict[str, np.ndarray]:
    """The arrays of a .npz file of the folder, no pickles."""
    return read_npz(artefact_file(folder, name), UNBOUNDED)


class LiveModel:
    """Predictor that follows its folder: answers are those of the model that is there now. `refresh` takes up one that
    has replaced it, skin and all, or keeps the one before where that is of another robot or damaged.

    taken: how many have been taken up"""

    def __init__(self, folder: Path, runtime: Runtime = "arrays"):
        self._folder, self._runtime, self.taken = folder, runtime, 0
        self._stamp, self.now = self._read()

    def __getattr__(self, name: str) -> Any:
        return getattr(vars(self)["now"], name)

    def refresh(self) -> bool:
        """Takes up the folder's model if it was replaced; True where another model answers from now on. Looks at one
        file where nothing has changed."""
        if stamp(self._folder) in (self._stamp, None):
            return False
        try:
            self._stamp, model = self._read()
        except InputError:
            return False
        names = [[parameter.name for parameter in version.parameters] for version in (model, self.now)]
        if model.rows != self.now.rows or names[0] != names[1]:
            return False
        self.now, self.taken = model, self.taken + 1
        return True

    def _read(self) -> tuple[Any, Predictor]:
        version = stamp(self._folder)  # one that is replaced while it is read is looked at again next time
        return version, load_model(self._folder, self._runtime, with_skin=True)
