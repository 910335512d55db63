"""Datasets with mass and viscosity: what they hold, their units, and that they cost no factorisation."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from cfem.core.artefact.manifest import read_manifest
from cfem.core.errors import InputError, SpecError
from cfem.core.spec import load_spec
from cfem.core.stage import Options
from cfem.dataset.inspect import describe
from cfem.dataset.reader import read_dataset
from cfem.dataset.schema import schema
from cfem.equilibrium.motion.inertia import mass_of
from cfem.equilibrium.newton import NewtonSettings
from cfem.equilibrium.solve import Wanted, solve
from cfem.equilibrium.system.actuation import displacement
from cfem.equilibrium.system.problem import Problem
from cfem.robot import stage as mesh_stage
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh
from cfem.sample.spec import SampleSpec
from cfem.sample.stage import run

PIPELINE = Path(__file__).parents[2] / "pipelines" / "bar"
QUIET = Options(quiet=True)
SMALL = ["splits.train.rows=5", "splits.test.rows=2", "skeleton=3", "skin.modes=2"]
HEAVY = "material: {young: 1 MPa, poisson: 0.45, density: 1070 kg/m^3, viscosity: {relaxation: 3 ms}}"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    root = tmp_path_factory.mktemp("bar")
    pipeline = shutil.copytree(PIPELINE, root / "pipelines" / "bar")
    scene = pipeline / "scene.yaml"
    scene.write_text(scene.read_text().replace("material: {young: 1 MPa, poisson: 0.45}", HEAVY))
    mesh_stage.run(scene, [], None, QUIET)
    for name, more in (("samples", ["dynamics=true", "third_order=true"]), ("still", ["third_order=true"])):
        run(pipeline / "sample.yaml", [*SMALL, *more], root / "data" / "bar" / name, QUIET, workers=1)
    return root


def test_the_rows_of_all_have_their_mass_and_viscosity(folder):
    data = read_dataset(folder / "data" / "bar" / "samples" / "test.parquet")
    moving, n = data.moving, 3 + 2 + 1
    assert len(moving.rows.skin) == 2
    assert moving.V.shape == (2, n, n) and moving.loss.shape == (2, 1, 2 * n, 2 * n)
    assert moving.dV.shape == (2, 1, n, n)
    assert moving.viscosity == [{"relaxation": 0.003, "prony": []}]
    scene, mesh = folder / "pipelines" / "bar" / "scene.yaml", folder / "data" / "bar" / "mesh"
    robot = build_robot(*load_scene_and_mesh(scene, mesh))
    found = solve(
        Problem(robot),
        displacement(data.delta_a[0]),
        settings=NewtonSettings(tolerance=1e-10),
        wanted=Wanted(mass=mass_of(robot)),
    )
    own = np.r_[0:3, 5:6]
    for name in ("V", "V2", "V3"):
        wanted = getattr(found.inertia, name)
        stored = getattr(moving, name)[0][np.ix_(own, own)]
        np.testing.assert_allclose(stored, wanted, atol=1e-6 * np.abs(wanted).max())
    both = np.r_[own, own + n]
    wanted = found.inertia.loss[0]
    np.testing.assert_allclose(moving.loss[0, 0][np.ix_(both, both)], wanted, atol=1e-6 * np.abs(wanted).max())
    assert (np.linalg.eigvalsh(moving.V) > -1e-9 * np.abs(moving.V).max()).all()


def test_they_cost_no_factorisation(folder):
    factorizations = [
        read_manifest(folder / "data" / "bar" / name)["results"]["factorizations_per_sample"]
        for name in ("samples", "still")
    ]
    assert factorizations[0] == factorizations[1]
    assert read_dataset(folder / "data" / "bar" / "still" / "test.parquet").moving is None


def test_inspect_names_them_with_their_units(folder):
    text = describe(folder / "data" / "bar" / "samples" / "train.parquet")
    assert "mm/N s^2" in text and "mm/N s^6" in text and "loss" in text


def test_each_entry_of_a_chamber_robot_has_its_unit():
    from cfem.condensed import Rows

    rows = Rows(("tip.x",), ("pair",))
    units = [("mm", "N"), ("mm^3", "MPa")]
    meta = {"viscosity": [{"relaxation": 0.0, "prony": [[0.1, 0.2]]}]}
    columns = json.loads(schema(rows, meta, (), True, units).metadata[b"cfem"])["units"]
    assert columns["V"] == ["mm/N s^2", "mm/MPa s^2", "mm^3/MPa s^2"]
    assert len(columns["loss"]) == 10
    assert columns["loss"][0] == "mm/N" and columns["loss"][-1] == "mm^3/MPa s^4"


def test_without_density_it_says_so(folder):
    pipeline = shutil.copytree(PIPELINE, folder / "pipelines" / "light", dirs_exist_ok=True)
    scene = pipeline / "scene.yaml"
    scene.write_text(scene.read_text().replace("out: ../../data/bar/mesh", "out: ../../data/light/mesh"))
    mesh_stage.run(scene, [], None, QUIET)
    with pytest.raises(InputError, match="density"):
        light = ["dynamics=true", "mesh=../../data/light/mesh", *SMALL]
        run(pipeline / "sample.yaml", light, folder / "data" / "light" / "samples", QUIET, workers=1)


def test_it_does_not_go_with_contact():
    with pytest.raises(SpecError, match="dynamics"):
        load_spec(
            Path(__file__).parents[2] / "pipelines" / "finger-button" / "sample.yaml", SampleSpec, ["dynamics=true"]
        )


def test_a_robot_of_sections_in_a_row_has_inner_motions_instead(tmp_path):
    pipeline = shutil.copytree(PIPELINE.parent / "stiff-flop", tmp_path / "pipelines" / "stiff-flop")
    scene = pipeline / "scene.yaml"
    heavy = "poisson: 0.15, density: 1070 kg/m^3, viscosity: {relaxation: 3 ms}}"
    scene.write_text(scene.read_text().replace("poisson: 0.15}", heavy).replace("size: 2.75 mm", "size: 11 mm"))
    mesh_stage.run(scene, [], None, QUIET)
    small = ["splits.train.rows=4", "splits.test.rows=2", "skeleton=3", "skin=null", "third_order=false"]
    run(pipeline / "sample.yaml", [*small, "dynamics=true"], None, QUIET, workers=1)
    path = tmp_path / "data" / "stiff-flop" / "samples" / "test.parquet"
    moving = read_dataset(path).moving
    k = moving.inner_K.shape[1]
    assert moving.V2 is None and k >= 4
    assert moving.inner_M.shape == (2, 6 + k, 6 + k) and moving.inner_loss.shape == (2, 2, 6 + k, 6 + k)
    assert moving.inner_e.shape == (2, 3, k)
    assert (np.linalg.eigvalsh(moving.inner_M) > 0).all()
    text = describe(path)
    assert "N mm s^2/mm^3/mm^3" in text and "inner_loss" in text
