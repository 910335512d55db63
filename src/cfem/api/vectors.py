"""Numbers from a program: the right number of them, all finite."""

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from cfem.core.errors import SpecError

PathLike = str | Path


def vector(name: str, values: ArrayLike, n: int) -> np.ndarray:
    """Array (n,) of values. SpecError, naming what it is, where there are not n finite numbers."""
    try:
        vector = np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise SpecError(f"expected {n} numbers, got {values!r}", where=name) from None
    if vector.shape != (n,) or not np.isfinite(vector).all():
        raise SpecError(f"expected {n} finite numbers, got {values!r}", where=name)
    return vector
