"""The names that programs may rely on, and what importing them costs."""

import ast
import importlib
import subprocess
import sys
from pathlib import Path

import pytest
from support.blocked import python_without

import cfem

FUNCTIONS = {
    *("load_robot", "solve", "read_dataset", "load_model", "inverse_step", "find_actuation", "make_controller"),
    *("run_stage", "run_folder"),
}
ERRORS = {"CfemError", "SpecError", "InputError", "NumericalError", "GateError", "OutputError", "DiskError"}
BAR = Path(__file__).parents[2] / "pipelines" / "bar" / "scene.yaml"
NAMES = {*FUNCTIONS, *ERRORS, "FemPlant", "ModelPlant", "__version__"}


def test_these_names_are_offered_and_no_others():
    assert sorted(cfem.__all__) == sorted(NAMES) == sorted(dir(cfem))
    assert all(getattr(cfem, name) for name in NAMES)
    with pytest.raises(AttributeError, match="no_such_name"):
        cfem.no_such_name  # noqa: B018


def test_type_checkers_see_the_names_that_python_finds():
    tree = ast.parse(Path(cfem.__file__).read_text())
    branch = next(node for node in tree.body if isinstance(node, ast.If))
    seen = {one.name: node.module for node in branch.body for one in node.names}
    assert set(seen) == NAMES - {"__version__"}
    for name, module in seen.items():
        assert getattr(importlib.import_module(module), name) is getattr(cfem, name)
    assert Path(cfem.__file__).with_name("py.typed").exists()


@pytest.mark.parametrize("name", sorted(NAMES - {"__version__"}))
def test_each_says_what_it_is(name):
    text = getattr(cfem, name).__doc__
    assert text
    if name in FUNCTIONS:
        for part in ("Args:", "Returns:", "Raises:", "Examples:\n        >>>"):
            assert part in text


def loaded_by(code):
    found = subprocess.run(
        [sys.executable, "-c", f"{code}\nimport sys; print(*sys.modules)"], capture_output=True, text=True, check=True
    )
    return set(found.stdout.split())


def test_import_loads_nothing_heavy():
    assert not loaded_by("import cfem") & {"numpy", "scipy", "numba", "pydantic", "pyarrow", "torch", "gmsh", "typer"}


def test_asking_a_model_loads_neither_torch_nor_gmsh_nor_finite_elements():
    loaded = loaded_by("import cfem; cfem.load_model, cfem.find_actuation, cfem.make_controller")
    assert not loaded & {"torch", "gmsh", "cfem.mechanics.solid"}


def test_a_device_that_is_a_model_starts_without_finite_elements():
    assert not loaded_by("import cfem.plant.device.fake") & {"numba", "scipy", "cfem.mechanics.body"}


def test_workers_and_ticks_do_without_scipy_stats():
    """It takes half a second to import, which each worker process of a sampling run would pay."""
    modules = ("cfem.sample.shard", "cfem.equilibrium.motion.inner_motions", "cfem.control.adaptation.tracker")
    assert "scipy.stats" not in loaded_by(f"import {', '.join(modules)}")


@pytest.mark.parametrize("use", ["cfem.FemPlant", f"cfem.load_robot({str(BAR)!r})"])
def test_a_missing_package_is_a_sentence_that_says_how_to_install_it(use, tmp_path):
    code = f"import cfem\ntry:\n    {use}\nexcept cfem.CfemError as error:\n    print(error)"
    said = python_without({"numba"}, code, tmp_path)
    assert "needs numba, which is not installed (pip install 'cfem[fe]')" in said.stdout, said.stderr
