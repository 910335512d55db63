"""What is no Python comes with the wheel too."""

import tomllib
from fnmatch import fnmatch
from pathlib import Path

ROOT = Path(__file__).parents[2]
DATA = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["package-data"]
LEFT_OUT = {".py"}


def test_every_file_that_is_no_python_is_in_the_wheel():
    patterns = [f"{package.replace('.', '/')}/{one}" for package, given in DATA.items() for one in given]
    found = (path for path in (ROOT / "src" / "cfem").rglob("*") if path.is_file() and "__pycache__" not in path.parts)
    files = [path for path in found if path.suffix not in LEFT_OUT]
    names = [path.relative_to(ROOT / "src").as_posix() for path in files]
    assert len(names) > 60
    assert [name for name in names if not any(fnmatch(name, one) for one in patterns)] == []
