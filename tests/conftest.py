"""What all tests share. One thread per process: pytest-xdist fills the cores, and threads that wait only waste
them. C is compiled unoptimised, which takes a third of the time, where a test does not say how."""

import os

os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"))
os.environ["CFLAGS"] = "-O0"

import gc
import shutil
import signal
import sys
from pathlib import Path
from unittest.mock import patch

import pytest
from support.compiled_once import compiled_once
from support.meshed_once import GMSH, meshed_once
from support.one_thread import solving_beside, solving_here

import cfem
from cfem.export.compiled import build
from cfem.robot.mesh import ask_gmsh

sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's job in the background ignores it, and its children

BAR = Path(__file__).parents[1] / "pipelines" / "bar"
SIZES, UNCOUNTED = build.sizes, {"here": None, "cortex-m7": None}
TOGETHER = ("tests/gym/", "tests/faults/")  # folders whose tests share kernels, or a process, that take long to make
LONG = (*TOGETHER, "tests/export/", "tests/design/", "tests/control/", "tests/robot/mesh/", "tests/init/")  # go first


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """By `--dist loadfile`, a folder of `TOGETHER` goes to one process, as each file does; files in the order below."""
    if config.getvalue("dist") != "loadfile":
        return None
    from xdist.scheduler import LoadFileScheduling

    config.option.loadscopereorder = False

    class LoadFolders(LoadFileScheduling):
        def _split_scope(self, nodeid):
            return next(filter(nodeid.startswith, TOGETHER), super()._split_scope(nodeid))

    return LoadFolders(config, log)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_collection():
    """Python seeks no garbage while modules and tests are read, nor later among what they made: 620 000 objects, which
    stay, and which take half a second to go through."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.collect()
        gc.freeze()
        gc.enable()


def pytest_collection_modifyitems(items):
    """What takes long begins first, so that no process is left alone with it in the end."""
    items.sort(key=lambda item: not item.nodeid.startswith(LONG))


@pytest.fixture(scope="session", autouse=True)
def here(tmp_path_factory):
    """Kernels and C are compiled once, and gmsh makes each mesh once, but for tests with `anew`. Sampling starts no
    processes but for tests with `processes`. Exports do not count the bytes of their code, which takes two more
    compilations, but for tests with `counted`."""
    base = tmp_path_factory.getbasetemp()
    shared = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base
    uncounted = patch.object(build, "sizes", lambda folder: UNCOUNTED)
    with solving_here(), compiled_once(shared), meshed_once(shared), uncounted:
        yield


@pytest.fixture
def anew():
    with patch.object(ask_gmsh, "_run", GMSH):
        yield


@pytest.fixture
def processes():
    with solving_beside():
        yield


@pytest.fixture
def counted():
    with patch.object(build, "sizes", SIZES):
        yield


@pytest.fixture(scope="session")
def bar(tmp_path_factory):
    """A project with the bar's mesh (hexahedra: no gmsh), its samples and its spectral model."""
    project = tmp_path_factory.mktemp("project")
    specs = shutil.copytree(BAR, project / "pipelines" / "bar")
    scene = specs / "scene.yaml"
    scene.write_text(
        scene.read_text().replace("size: 8 mm", "{size: 5 mm, element: hex8}").replace("mesh:\n  ", "mesh: ")
    )
    cfem.run_stage("mesh", scene)
    cfem.run_stage("sample", specs / "sample.yaml", workers=1)
    cfem.run_stage("train", specs / "train.yaml")
    return project


@pytest.fixture(scope="session")
def moving_bar(tmp_path_factory):
    """A project with the bar of linear tetrahedra, whose model has learned to move, its skin too."""
    project = tmp_path_factory.mktemp("moving")
    specs = shutil.copytree(BAR, project / "pipelines" / "bar")
    scene = specs / "scene.yaml"
    heavy = "material: {young: 1 MPa, poisson: 0.45, density: 1070 kg/m^3, viscosity: {relaxation: 3 ms}}"
    text = scene.read_text().replace("material: {young: 1 MPa, poisson: 0.45}", heavy)
    scene.write_text(text.replace("size: 8 mm", "size: 12 mm\n  element: tet4"))
    asked = ["splits.train.rows=10", "splits.test.rows=2", "skeleton=3", "dynamics=true", "frequencies=true"]
    cfem.run_stage("mesh", scene)
    cfem.run_stage("sample", specs / "sample.yaml", overrides=asked, workers=1)
    cfem.run_stage("train", specs / "train.yaml", overrides=["samples=null"])
    return project


@pytest.fixture(scope="session")
def bar_of_any_material(bar, tmp_path_factory):
    """Folder of the bar's spectral model with Poisson's ratio, sampled, and Young's modulus, exact, as parameters."""
    folder, specs = tmp_path_factory.mktemp("material"), bar / "pipelines" / "bar"
    asked = (
        "parameters={poisson: {key: material.poisson, range: [0.30, 0.45]}, "
        "young: {key: material.young, range: {MPa: [0.5, 4]}}}"
    )
    sample = [asked, "splits={train: {rows: 24, method: random, seed: 1}, test: {rows: 4, method: random, seed: 2}}"]
    cfem.run_stage("sample", specs / "sample.yaml", out=folder / "samples", overrides=sample, workers=1)
    cfem.run_stage("train", specs / "train.yaml", out=folder / "model", overrides=[f"dataset={folder / 'samples'}"])
    return folder / "model"


@pytest.fixture(scope="session")
def patched_bar(bar):
    """The bar's spectral model that may be touched at patches 8 mm from each other."""
    from cfem.equilibrium.contact.patch_compliance import patch_response
    from cfem.predict.contact.surface.patched_model import PatchedModel, patches_of
    from cfem.predict.series.few_states import patch_states

    known = cfem.load_model(bar / "models" / "bar" / "spectral")
    built = cfem.load_robot(bar / "pipelines" / "bar" / "scene.yaml", bar / "data" / "bar" / "mesh")
    patches, states = patches_of(known, 8.0), patch_states(known.domain, 1)
    return PatchedModel(known, patches, patch_response(built, known.skin.watched, patches, states))


@pytest.fixture(scope="module")
def model(bar):
    """The bar's spectral model."""
    return cfem.load_model(bar / "models" / "bar" / "spectral")


@pytest.fixture(scope="module")
def robot(bar):
    """The bar of finite elements."""
    return cfem.load_robot(bar / "pipelines" / "bar" / "scene.yaml", bar / "data" / "bar" / "mesh")
