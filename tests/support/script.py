"""A script as a module."""

import sys
from importlib import import_module
from pathlib import Path
from types import ModuleType

FOLDER = str(Path(__file__).parents[2] / "scripts")


def script(name: str) -> ModuleType:
    """It may import others beside it."""
    sys.path.insert(0, FOLDER)
    try:
        return import_module(name)
    finally:
        sys.path.remove(FOLDER)
