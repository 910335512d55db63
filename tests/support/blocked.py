"""A Python process in which some packages are not installed."""

import os
import subprocess
import sys
from pathlib import Path

BLOCK = """
import sys
from importlib.machinery import PathFinder
names, find = {names!r}, PathFinder.find_spec
PathFinder.find_spec = classmethod(lambda cls, name, *rest: None if name.split(".")[0] in names else find(name, *rest))
{also}
"""


def python_without(
    names: set[str], code: str, folder: Path, also: str = "", **environment: str
) -> subprocess.CompletedProcess:
    """Runs `code` in `folder` where no package of `names` can be imported; also: statements that come before it."""
    text = BLOCK.format(names=names, also=also) + code
    return subprocess.run(
        [sys.executable, "-c", text], cwd=folder, capture_output=True, text=True, env={**os.environ, **environment}
    )


def cfem_without(names: set[str], words: list[str], folder: Path, also: str = "") -> subprocess.CompletedProcess:
    """`cfem WORDS` where no package of `names` can be imported."""
    code = f"import sys; sys.argv = ['cfem', *{words!r}]\nfrom cfem.__main__ import main\nmain()"
    return python_without(names, code, folder, also)
