"""The file of the states that all others start from."""

import io
import zipfile
import zlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from cfem.core.artefact.files import npz_bytes
from cfem.core.errors import InputError, NumericalError
from cfem.equilibrium.predictor import Knot


def demand_states(knots: Sequence[Knot]) -> None:
    """Raises NumericalError where none of the skeleton's states converged."""
    if not knots:
        do = "check the scene; the usual cause is a reach that is too large"
        raise NumericalError("none of the first states converged", do=do)


def knots_bytes(knots: Sequence[Knot]) -> bytes:
    """An .npz, one array a field, the knots along its first axis."""
    return npz_bytes({name: np.array([getattr(known, name) for known in knots]) for name in Knot.__dataclass_fields__})


def read_knots(file: Path | io.BytesIO) -> list[Knot]:
    """Knots that `knots_bytes` wrote. Raises InputError where it is missing or damaged."""
    try:
        with np.load(file, allow_pickle=False) as stacked:
            arrays = {name: stacked[name] for name in Knot.__dataclass_fields__}
    except (OSError, EOFError, ValueError, KeyError, zipfile.BadZipFile, zlib.error) as error:
        raise InputError(f"is damaged: {error}", where=str(file), do="remove it and run again") from None
    return [Knot(*row) for row in zip(*arrays.values(), strict=True)]
