"""Modules in a row from the model of one, against finite elements of the whole trunk."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cfem.core.errors import InputError, NumericalError
from cfem.core.stage import Options
from cfem.equilibrium.actuation import displacement, force
from cfem.equilibrium.problem import Problem
from cfem.equilibrium.solve import solve
from cfem.plant.fem_plant import pushed
from cfem.predict.load import load_model
from cfem.predict.loaded import loaded
from cfem.predict.serial import cross, left_jacobian
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh
from cfem.robot.stage import run as make_mesh
from cfem.sample.stage import run as sample
from cfem.surrogate import stage
from cfem.surrogate.stage import run as train

PIPELINES = Path(__file__).parents[2] / "pipelines"
QUIET = Options(quiet=True)
WHOLE, MODULE = "stiff-flop", "stiff-flop-module"


def coarser(path, size="19 mm", **rows):
    text = path.read_text().replace("2.75 mm", size)
    for split, (before, after) in rows.items():
        text = text.replace(f"{split}: {{rows: {before}", f"{split}: {{rows: {after}")
    path.write_text(text)


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    """Both robots on coarse meshes: nothing here is about how fine they are."""
    root = tmp_path_factory.mktemp("project")
    for name in (WHOLE, MODULE):
        shutil.copytree(PIPELINES / name, root / "pipelines" / name)
        coarser(root / "pipelines" / name / "scene.yaml")
    coarser(root / "pipelines" / WHOLE / "sample.yaml", train=(200, 10), test=(100, 8))
    coarser(root / "pipelines" / MODULE / "sample.yaml", train=(50, 40), test=(50, 5))
    for name in (MODULE, WHOLE):
        folder = root / "pipelines" / name
        make_mesh(folder / "scene.yaml", [], None, QUIET)
        sample(folder / "sample.yaml", [], None, QUIET, workers=1)
    monkeypatch = pytest.MonkeyPatch()
    monkeypatch.setattr(stage, "QUERIES", 500)
    train(root / "pipelines" / MODULE / "train.yaml", [], None, QUIET)
    train(root / "pipelines" / WHOLE / "train-serial.yaml", [], None, QUIET)
    yield root
    monkeypatch.undo()


class FiniteElementModule:
    """What the row asks of a module's model, answered by finite elements."""

    def __init__(self, problem: Problem):
        self._problem = problem
        self.rows, self.rest_e = problem.robot.rows, problem.robot.rest_e

    def evaluate(self, delta):
        found = [solve(self._problem, displacement(one), slack=False).condensed for one in delta.reshape(-1, 3)]
        W, free = np.array([one.W for one in found]), np.array([one.delta_free for one in found])
        return W.reshape(*delta.shape[:-1], 9, 9), free.reshape(*delta.shape[:-1], 9)


def problem_of(project, name):
    return Problem(build_robot(*load_scene_and_mesh(project / "pipelines" / name / "scene.yaml")))


def test_two_modules_in_a_row_are_the_whole_trunk(project):
    model = load_model(project / "models" / WHOLE / "serial")
    model.module = FiniteElementModule(problem_of(project, MODULE))
    problem = problem_of(project, WHOLE)
    for pressures in 0.2 * np.random.default_rng(0).random((3, 6)):
        solved = solve(problem, force(pressures))
        found = model.at(solved.delta)
        np.testing.assert_allclose(found.lam, pressures, atol=1e-9)
        np.testing.assert_allclose(found.delta[:3], solved.delta_e, atol=1e-7)
        size = np.sqrt(np.diag(solved.condensed.W))
        scale = np.outer(size, size)
        np.testing.assert_allclose(found.W / scale, solved.condensed.W / scale, atol=1e-8)


def test_two_modules_under_a_force_at_the_tip_are_the_whole_trunk(project):
    """2 mN move the tip by about a millimetre. The row of modules knows them from unloaded samples of one module."""
    model = load_model(project / "models" / WHOLE / "serial")
    problem = problem_of(project, WHOLE)
    rng = np.random.default_rng(3)
    for pressures in 0.2 * rng.random((2, 6)):
        direction = rng.normal(size=3)
        push = 2e-3 * direction / np.linalg.norm(direction)
        at = solve(problem, force(pressures)).delta_a
        solved = solve(Problem(pushed(problem.robot, push)), displacement(at), slack=False)
        found = loaded(model, push).at(at)
        moved = np.linalg.norm(found.delta_e - model.at(at).delta_e)
        assert moved > 0.3
        assert np.linalg.norm(found.delta_e - solved.delta_e) < 1e-3  # mm; 0.005 to 0.02 without D
        np.testing.assert_allclose(found.lam, solved.lambda_a, atol=1e-6 * np.abs(solved.lambda_a).max())
        size = np.sqrt(np.diag(solved.condensed.W))
        np.testing.assert_allclose(found.W / np.outer(size, size), solved.condensed.W / np.outer(size, size), atol=2e-3)
        assert found.rows == model.rows


def test_the_estimated_error_bounds_that_of_loads(project):
    model = load_model(project / "models" / WHOLE / "serial")
    assert loaded(model, np.array([0, 2e-3, 0])).meta["wrench_error"] < 0.005
    with pytest.raises((InputError, NumericalError), match=r"take (at most|smaller)"):
        loaded(model, np.array([0, 0.06, 0]))


def test_it_is_judged_by_the_states_of_the_whole(project):
    folder = project / "models" / WHOLE / "serial"
    manifest = json.loads((folder / "manifest.json").read_text())["results"]
    assert manifest["errors"]["states"] == 8 and manifest["samples"] == 40
    assert manifest["errors"]["loss"] < 1e-9
    assert manifest["positive_definite"]["share"] > 0.99


def test_the_torch_module_is_the_same_function(project):
    torch = pytest.importorskip("torch")
    from cfem.predict.load import read_arrays, read_meta
    from cfem.surrogate.modules import module_of

    folder = project / "models" / WHOLE / "serial"
    model, module = load_model(folder), module_of(read_meta(folder), read_arrays(folder))
    delta = np.concatenate([np.zeros((1, 6)), 20 * np.random.default_rng(1).random((5, 6))])
    W, free = module(torch.as_tensor(delta))
    expected_W, expected_free = model.evaluate(delta)
    np.testing.assert_allclose(W.detach(), expected_W, atol=1e-12 * np.abs(expected_W).max())
    np.testing.assert_allclose(free.detach(), expected_free, atol=1e-10)


def test_a_model_of_something_else_is_refused(project):
    spec = project / "pipelines" / WHOLE / "train-serial.yaml"
    with pytest.raises(InputError, match="one end with its orientation"):
        train(spec, ["model.module=../../models/stiff-flop/serial"], project / "other", QUIET)
    with pytest.raises(InputError, match="3 modules of 3 actuators do not make a robot of 6"):
        train(spec, ["model.softer=[1, 1, 1]"], project / "other", QUIET)


def test_the_left_jacobian_takes_rotation_vectors_to_spins():
    rng = np.random.default_rng(2)
    phi = np.concatenate([np.zeros((1, 3)), 1e-3 * rng.standard_normal((2, 3)), rng.standard_normal((3, 3))])
    d, h = rng.standard_normal((6, 3)), 1e-6
    J = left_jacobian(phi)
    ahead, behind = (Rotation.from_rotvec(phi + sign * h * d) for sign in (1, -1))
    spin = (ahead * behind.inv()).as_rotvec() / (2 * h)
    np.testing.assert_allclose((J @ d[:, :, None])[:, :, 0], spin, atol=1e-8)
    turned = Rotation.from_rotvec(phi).as_matrix()
    np.testing.assert_allclose(np.eye(3) + cross(phi) @ J, turned, atol=1e-13)
