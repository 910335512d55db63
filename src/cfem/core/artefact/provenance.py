"""Provenance of a result: versions of cfem, Python and the packages that numbers depend on, and the machine."""

import platform
from importlib.metadata import PackageNotFoundError, version

from cfem.core.version import VERSION

_SOLVERS = ("rslab", "py-mkl-pardiso", "osqp")
_PACKAGES = ("numpy", "scipy", "numba", *_SOLVERS, "gmsh", "torch", "onnxruntime", "pyarrow")


def versions() -> dict[str, str]:
    """Installed versions by package; absent ones are left out."""
    by_package = {"cfem": VERSION, "python": platform.python_version(), "machine": platform.machine()}
    for name in _PACKAGES:
        try:
            by_package[name] = version(name)
        except PackageNotFoundError:
            continue
    return by_package
