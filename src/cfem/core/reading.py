"""Checks of what was read from a file, before it is used: by a schema, or array by array.

A manifest shows that a file is as somebody wrote it. It does not show that cfem wrote it."""

import json
import math
import zipfile
import zlib
from collections.abc import Collection
from pathlib import Path
from typing import Any, Self, TypeVar

import numpy as np
from pydantic import BaseModel, ConfigDict, ValidationError, model_validator

from cfem.core.errors import InputError

# What damaged archives and headers of arrays raise.
_DAMAGE = (
    *(OSError, ValueError, KeyError, EOFError, SyntaxError, NotImplementedError, RuntimeError, MemoryError),
    *(zipfile.BadZipFile, zlib.error),
)
LARGEST = 2**30  # bytes of all arrays of one .npz file


def demand_file(path: Path, do: str = "check the path") -> None:
    """InputError where there is no such file, or a folder in its place; do: what would help."""
    if not path.is_file():
        raise InputError("is a folder, not a file" if path.is_dir() else "no such file", where=str(path), do=do)


class Checked(BaseModel):
    """Base of all that is read: first each field is checked, then whether they go together."""

    @model_validator(mode="after")
    def _go_together(self) -> Self:
        self.check()
        return self

    def check(self) -> None:
        """Raises ValueError, with a sentence, where fields do not go together."""


class Data(Checked):
    """Base of what a file holds: exact types, finite numbers; keys that nobody asks for are left alone."""

    model_config = ConfigDict(strict=True, extra="ignore", allow_inf_nan=False)


D = TypeVar("D", bound=Data)


def checked(model: type[D], data: Any, where: str, do: str) -> D:
    """Plain JSON data as the model. InputError naming the first field that is wrong."""
    try:
        return model.model_validate_json(json.dumps(data))
    except ValidationError as error:
        first, *further = error.errors(include_url=False, include_input=False)
        place = ".".join(map(str, first["loc"]))
        what = first["msg"].removeprefix("Value error, ").replace("Input should be", "expected")
        more = f"; and {len(further)} more" if further else ""
        raise InputError(f"is damaged: {f'{place}: ' if place else ''}{what}{more}", where=where, do=do) from None
    except RecursionError:
        raise InputError("is damaged: its parts are nested too deeply", where=where, do=do) from None


def read_npz(path: Path, unbounded: Collection[str] = ()) -> dict[str, np.ndarray]:
    """The arrays of a .npz file: finite real numbers, or True and False; those in `unbounded` may be infinite.
    InputError where there is anything else, or where the file claims more than it holds."""
    do = "regenerate it with --force"
    try:
        with zipfile.ZipFile(path) as archive:
            sizes = {info.filename: info.file_size for info in archive.infolist()}
            if sum(sizes.values()) > LARGEST:
                raise ValueError(f"its arrays take more than {LARGEST} bytes")
            for name, size in sizes.items():
                with archive.open(name) as member:
                    _demand_size(member, size, name)
        with np.load(path, allow_pickle=False) as file:
            arrays = dict(file)
    except _DAMAGE as error:
        reason = next(iter(str(error).splitlines()), type(error).__name__)
        raise InputError(f"is damaged: {reason[:300]}", where=str(path), do=do) from None
    for name, values in arrays.items():
        if values.dtype.kind not in "fiub":
            raise InputError(f"'{name}': is of type {values.dtype}, not of real numbers", where=str(path), do=do)
        if np.isnan(values).any() or (name not in unbounded and np.isinf(values).any()):
            raise InputError(f"'{name}': holds numbers that are not finite", where=str(path), do=do)
    return arrays


def _demand_size(member: Any, size: int, name: str) -> None:
    """Raises ValueError where the header of an array promises other than the archive holds."""
    version = np.lib.format.read_magic(member)
    if version not in ((1, 0), (2, 0)):
        raise ValueError(f"'{name}': unknown version {version} of the array format")
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, _, dtype = read(member)
    if member.tell() + math.prod(shape) * dtype.itemsize != size:
        raise ValueError(f"'{name}': has not the numbers that its shape {shape} needs")


def take(arrays: dict[str, np.ndarray], name: str, shape: tuple[int | None, ...], kinds: str = "f") -> np.ndarray:
    """Array of this name, of the dtype kinds and the shape (None: any length from 1 on). InputError naming it."""
    values = arrays.get(name)
    if values is None:
        raise InputError(f"array '{name}' is missing")
    fits = values.ndim == len(shape) and all(
        size == wanted if wanted is not None else size > 0 for size, wanted in zip(values.shape, shape, strict=True)
    )
    if not fits:
        expected = " x ".join("any" if size is None else str(size) for size in shape)
        raise InputError(f"array '{name}' has shape {values.shape}, expected {expected}")
    if values.dtype.kind not in kinds:
        raise InputError(f"array '{name}' is of type {values.dtype}, not of the numbers expected")
    return values
