"""The kind `serial` of model: modules in a row, with loads or without."""

import numpy as np

from cfem.predict.array_predictor import KINDS
from cfem.predict.rows.serial import SerialPredictor


def row(meta: dict, arrays: dict[str, np.ndarray]) -> SerialPredictor:
    """Predictor of a row of modules. A row without loads needs no SciPy."""
    if meta.get("wrench") is None:
        return SerialPredictor(meta, arrays)
    from cfem.predict.rows.loaded_serial import LoadedSerialPredictor

    return LoadedSerialPredictor(meta, arrays)


KINDS["serial"] = row
