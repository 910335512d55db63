"""The surface of a C folder compiled on this machine, as a Python object."""

import ctypes
from pathlib import Path

import numpy as np

from cfem.export.compiled.build import FAST, defines_of, library
from cfem.export.compiled.structures import structures


class CompiledShape:
    """cfem_shape of a folder: inputs (n_a,) -> positions (nodes, 3) mm."""

    def __init__(self, folder: Path, flags: tuple[str, ...] = FAST):
        nodes = int(defines_of(folder / "cfem_skin.h")["CFEM_SKIN_NODES"])
        self._out = np.zeros((nodes, 3), dtype=structures(folder, "cfem_data.h")["cfem_real"])
        self._call = library(folder, flags).cfem_shape
        self._call.restype = None

    def __call__(self, s: np.ndarray) -> np.ndarray:
        s = np.ascontiguousarray(s, dtype=float)
        self._call(s.ctypes.data_as(ctypes.c_void_p), self._out.ctypes.data_as(ctypes.c_void_p))
        return self._out.astype(float)
