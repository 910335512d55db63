"""What scripts, benchmarks and examples import from cfem is there."""

import ast
import importlib
import importlib.util
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FILES = sorted(
    path
    for folder in ("scripts", "benchmarks", "examples")
    for path in (ROOT / folder).rglob("*.py")
    if not {"build", "node_modules"} & set(path.parts)
)


def imported(path):
    """Pairs of module and name that a file imports from cfem, name None for the module alone."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and not node.level and (node.module or "").split(".")[0] == "cfem":
            yield from ((node.module, alias.name) for alias in node.names)
        elif isinstance(node, ast.Import):
            yield from ((alias.name, None) for alias in node.names if alias.name.split(".")[0] == "cfem")


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_what_it_imports_is_there(path):
    for module, name in imported(path):
        found = importlib.import_module(module)
        assert name is None or hasattr(found, name) or importlib.util.find_spec(f"{module}.{name}"), f"{module}.{name}"


def test_there_are_files_that_import():
    assert sum(len(list(imported(path))) > 0 for path in FILES) > 20
