"""Where an optional package is missing, one sentence names the extra that brings it, before any work begins."""

import ast
import re
import sys
import tomllib
from inspect import signature
from pathlib import Path

import pytest
from support.blocked import cfem_without, python_without

from cfem.core import optional
from cfem.core.errors import SpecError
from cfem.core.optional import EXTRAS, demand, explained

PROJECT = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())["project"]
BROUGHT_BY = {"llvmlite": "numba", "dask": "distributed", "pymklpardiso": "py-mkl-pardiso", "PIL": "pillow"}
BROUGHT_BY |= {"mpl_toolkits": "matplotlib", "serial": "pyserial"}
BROUGHT_BY |= {"stable_baselines3": "stable-baselines3", "dynamixel_sdk": "dynamixel-sdk"}


def absent(monkeypatch, *names):
    find = optional.find_spec
    for name in names:
        monkeypatch.delitem(sys.modules, name, raising=False)
    monkeypatch.setattr(optional, "find_spec", lambda name: None if name in names else find(name))


@pytest.mark.parametrize("name", sorted(EXTRAS))
def test_the_extra_that_a_message_names_brings_the_package(name):
    listed = PROJECT["optional-dependencies"][EXTRAS[name]]
    assert BROUGHT_BY.get(name, name) in {re.match(r"[\w-]+", one)[0] for one in listed}


def test_a_demand_names_the_first_missing_package(monkeypatch):
    absent(monkeypatch, "onnx", "torch")
    demand("numpy", where="anything")
    with pytest.raises(SpecError) as error:
        demand("numpy", "onnx", "torch", where="formats: onnx")
    assert str(error.value) == "formats: onnx: needs onnx, which is not installed (pip install 'cfem[train]')"


def test_only_a_missing_optional_package_is_explained(monkeypatch):
    absent(monkeypatch, "numba")
    assert "cfem[fe]" in str(explained(ModuleNotFoundError("", name="numba.core")))
    assert explained(ModuleNotFoundError("", name="cfem.nothing")) is None
    assert explained(ImportError("libGL.so.1: cannot open shared object file", name="numba")) is None


def test_gmsh_is_no_remedy_where_it_has_no_wheel(monkeypatch):
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr(optional.platform, "machine", lambda: "aarch64")
    assert "another machine" in optional.remedy("gmsh") and "pip" not in optional.remedy("gmsh")


def test_stages_demand_their_packages_before_they_work(monkeypatch, tmp_path):
    from cfem.export import stage as export
    from cfem.export.spec import ExportSpec
    from cfem.report import stage as report
    from cfem.surrogate import stage as train
    from cfem.surrogate.spec import TrainSpec

    absent(monkeypatch, "onnxruntime", "matplotlib", "torch")
    with pytest.raises(SpecError, match=r"formats: onnx.*cfem\[train\]"):
        export.work(tmp_path, ExportSpec(model=".", out="out", formats=["arrays", "onnx"]), tmp_path)
    with pytest.raises(SpecError, match=r"cfem report.*cfem\[report\]"):
        report._work(*[None] * len(signature(report._work).parameters))
    spec = TrainSpec(dataset=".", out="out", model={"kind": "mlp"})
    with pytest.raises(SpecError, match=r"kind: mlp: needs torch.*cfem\[train\]"):
        train.work(tmp_path, spec, tmp_path)
    assert not list(tmp_path.iterdir())


SCENE = """
name: block
out: mesh
length: 60 mm
geometry: {kind: bar, length: 60 mm, width: 10 mm, height: 10 mm}
mesh: {size: 10 mm, element: ELEMENT}
material: {law: neo-hookean, young: 300 kPa, poisson: 0.45}
fixed: [{kind: plane, point: {mm: [0, 0, 0]}, normal: [-1, 0, 0]}]
actuators:
  - {kind: cable, name: one, pull_point: {mm: [0, 0, 3]}, points: {mm: [[20, 0, 3], [60, 0, 3]]}, reach: {mm: [0, 5]}}
effectors: [{name: tip, point: {mm: [60, 0, 0]}}]
"""


def write_scene(folder, element):
    (folder / "scene.yaml").write_text(SCENE.replace("ELEMENT", element))


def test_a_mesh_without_gmsh_says_what_to_install_and_hexahedra_do_without(tmp_path):
    write_scene(tmp_path, "tet4")
    done = cfem_without({"gmsh"}, ["mesh", "scene.yaml"], tmp_path)
    sentence = "cfem: a mesh of this geometry: needs gmsh, which is not installed (pip install 'cfem[mesh]')"
    assert (done.returncode, said(done)) == (2, sentence)
    write_scene(tmp_path, "hex8")
    assert cfem_without({"gmsh"}, ["mesh", "scene.yaml"], tmp_path).returncode == 0


def test_the_base_alone_explains_what_finite_elements_need(tmp_path):
    write_scene(tmp_path, "hex8")
    done = cfem_without(set(EXTRAS), ["mesh", "scene.yaml"], tmp_path)
    assert done.returncode == 2
    assert said(done) == "cfem: this needs numba, which is not installed (pip install 'cfem[fe]')"


def said(done):
    """The last line, after any on progress."""
    return done.stderr.splitlines()[-1]


def test_the_base_alone_asks_models_and_steps_controllers(tmp_path):
    modules = ["predict.load", "control.search.inverse", "control.closed_loop.tick", "control.search.qp"]
    modules += ["plant.device.device_plant", "cli.app", "export.firmware.folder", "cli.inspect", "cli.verify"]
    code = "\n".join(f"import cfem.{name}" for name in modules)
    assert python_without(set(EXTRAS), code, tmp_path).stderr == ""


def test_every_package_that_the_source_imports_is_declared():
    """The test environment holds more than an installation does."""
    declared = {"cfem", *sys.stdlib_module_names, *EXTRAS, *map(import_name, PROJECT["dependencies"])}
    for path in (Path(__file__).parents[2] / "src").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [one.name for one in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom) and not node.level:
                names = [node.module]
            undeclared = {name.split(".")[0] for name in names} - declared
            assert not undeclared, f"{path}: {undeclared}"


def import_name(requirement: str) -> str:
    return re.match(r"[\w-]+", requirement)[0]
