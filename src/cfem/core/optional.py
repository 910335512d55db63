"""Packages that not every installation holds: which extra of cfem brings each, and what to say where one is missing."""

import platform
import sys
from collections.abc import Callable
from functools import wraps
from importlib.util import find_spec
from typing import ParamSpec, TypeVar

from cfem.core.errors import SpecError

P = ParamSpec("P")
R = TypeVar("R")

# import name -> extra of pyproject.toml
EXTRAS = {
    "llvmlite": "fe",
    "meshio": "fe",
    "numba": "fe",
    "pyarrow": "fe",
    "rslab": "fe",
    "gmsh": "mesh",
    "gymnasium": "gym",
    "stable_baselines3": "policies",
    "onnx": "train",
    "onnxruntime": "train",
    "onnxscript": "train",
    "torch": "train",
    "matplotlib": "report",
    "PIL": "report",
    "mpl_toolkits": "report",
    "c3d": "lab",
    "pymklpardiso": "fast",
    "dask": "cluster",
    "distributed": "cluster",
    "mujoco": "mujoco",
    "serial": "serial",
    "dynamixel_sdk": "dynamixel",
}


class MissingPackageError(SpecError, ImportError):
    """An optional package is not installed (exit 2)."""


def demand(*names: str, where: str) -> None:
    """Raises MissingPackageError for the first of the import names that is not installed. It imports none.

    where: the command, option or key that needs them."""
    for name in names:
        if not installed(name):
            raise MissingPackageError(f"needs {name}, which is not installed", where=where, do=remedy(name))


def installed(name: str) -> bool:
    """True if a package can be imported, by its import name. It is not imported."""
    return sys.modules[name] is not None if name in sys.modules else find_spec(name) is not None


def explained(error: ImportError) -> MissingPackageError | None:
    """The sentence for a failed import of an optional package; None for any other import."""
    if isinstance(error, MissingPackageError):
        return error
    name = (error.name or "").split(".")[0]
    if not isinstance(error, ModuleNotFoundError) or name not in EXTRAS or installed(name):
        return None
    return MissingPackageError(f"this needs {name}, which is not installed", do=remedy(name))


def remedy(name: str) -> str:
    """Remedy where the package `name` is missing."""
    if name == "gmsh" and sys.platform == "linux" and platform.machine() not in ("x86_64", "AMD64"):
        return f"PyPI has no gmsh for {platform.machine()}: make the mesh on another machine and copy its folder here"
    return f"pip install 'cfem[{EXTRAS[name]}]'"


def says_what_is_missing(function: Callable[P, R]) -> Callable[P, R]:
    """The function, which raises MissingPackageError instead of ModuleNotFoundError."""

    @wraps(function)
    def called(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            return function(*args, **kwargs)
        except ModuleNotFoundError as error:
            raise explained(error) or error from None

    return called
