"""Plans of pressures, of the pneumatic trunk as a rod."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from cfem.core.errors import SpecError
from cfem.core.stage import Options
from cfem.dataset.reader import read_dataset
from cfem.dataset.schema import parameters_of
from cfem.equilibrium.system.actuation import displacement
from cfem.robot.load import load_scene_and_mesh
from cfem.robot.stage import run as make_mesh
from cfem.sample.plan import actuation
from cfem.sample.solver import FiniteElements
from cfem.sample.spec import SampleSpec
from cfem.sample.stage import run

SCENE = Path(__file__).parents[2] / "pipelines" / "stiff-flop" / "scene.yaml"
QUIET = Options(quiet=True)
SPEC = {"scene": "scene.yaml", "mesh": "mesh", "out": "samples", "splits": {"test": {"rows": 2, "method": "random"}}}


@pytest.fixture(scope="module")
def trunk(tmp_path_factory):
    """A scene and mesh of 3 elements a module, and rows drawn from its pressures."""
    folder = tmp_path_factory.mktemp("trunk")
    shutil.copy(SCENE, folder / "scene.yaml")
    text = (folder / "scene.yaml").read_text().replace("../../data/stiff-flop/mesh", "mesh")
    (folder / "scene.yaml").write_text(text.replace("size: 2.75 mm", "size: 19 mm"))
    make_mesh(folder / "scene.yaml", [], None, QUIET)
    (folder / "sample.yaml").write_text(
        "scene: scene.yaml\nmesh: mesh\nout: samples\nspace: force\nthird_order: true\nskeleton: 4\n"
        "splits: {test: {rows: 12, method: random, seed: 3}}\n"
    )
    run(folder / "sample.yaml", [], None, QUIET, workers=1)
    return folder


def test_rows_are_shares_of_the_range_of_each_pressure():
    forces = np.array([[0.0, 0.2], [0.1, 0.3]])
    asked = actuation("force", np.array([0.5, 0.25]), np.zeros((2, 2)), np.eye(2), forces)
    np.testing.assert_allclose(asked.offset, [0.1, 0.15])
    assert len(asked.C) == 0


def test_rows_fill_the_box_of_pressures_and_take_an_iteration_each(trunk):
    rows = read_dataset(trunk / "samples" / "test.parquet")
    assert len(rows) == 12
    np.testing.assert_allclose(rows.lambda_a, 0.2 * rows.u, atol=1e-12)
    assert rows.meta["units"]["lambda_a"] == "MPa" and rows.meta["units"]["delta_a"] == "mm^3"
    np.testing.assert_allclose(rows.dW[:, :, 3:, 3:], 0.0, atol=1e-5 * np.abs(rows.W).max())  # growth is linear


def test_robots_that_differ_start_from_rest_and_know_their_slopes(trunk):
    """dPsi/dp by differences of whole solves at the same growths."""
    changes = [
        "out=varied",
        "parameters={nu: {key: material.poisson, range: [0.1, 0.3]}}",
        "splits={test: {rows: 5, method: random, seed: 3}}",
    ]
    run(trunk / "sample.yaml", changes, trunk / "varied", QUIET, workers=1)
    rows = read_dataset(trunk / "varied" / "test.parquet")
    assert rows.cost["iterations"].max() <= 3
    solver = FiniteElements(
        *load_scene_and_mesh(trunk / "scene.yaml", trunk / "mesh"), 1e-11, parameters_of(rows.meta)
    )()
    ahead, behind = (solver.solve(displacement(rows.delta_a[0]), None, rows.p[0] + h) for h in (1e-4, -1e-4))
    np.testing.assert_allclose(rows.dpsi_dp[0, 0], (ahead.energy - behind.energy) / 2e-4, rtol=1e-5)
    np.testing.assert_allclose(rows.ddelta_e_dp, 0.0, atol=1e-6)  # and nowhere else does a chamber's growth lead


def test_the_modules_do_not_know_of_each_other(trunk):
    """Without external load: W_aa is of two blocks, and the energy a sum of two."""
    rows = read_dataset(trunk / "samples" / "test.parquet")
    np.testing.assert_allclose(rows.W[:, 3:6, 6:], 0.0, atol=1e-9 * np.abs(rows.W[:, 3:, 3:]).max())
    np.testing.assert_allclose(rows.energy, (rows.lambda_a * rows.delta_a).sum(axis=1) / 2, rtol=1e-9)


def test_a_scene_that_states_no_pressures_is_named(trunk):
    scene = trunk / "without.yaml"
    scene.write_text((trunk / "scene.yaml").read_text().replace(", pressure: {kPa: [0, 200]}", ""))
    text = (trunk / "sample.yaml").read_text().replace("scene.yaml", "without.yaml").replace("samples", "none")
    (trunk / "other.yaml").write_text(text)
    with pytest.raises(SpecError, match="space: force needs the smallest and largest multiplier"):
        run(trunk / "other.yaml", [], None, QUIET, workers=1)


def test_sections_in_a_row_start_from_the_nearest_state(trunk):
    assert FiniteElements(*load_scene_and_mesh(trunk / "scene.yaml", trunk / "mesh"), 1e-10)().facts.in_a_row


def test_forces_do_not_go_with_sampling_until():
    with pytest.raises(ValidationError, match="space: force"):
        SampleSpec.model_validate(SPEC | {"space": "force", "until": {"error": "1 mm"}})
