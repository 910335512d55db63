"""The centre of mass of a body: gravity is a force on its rows."""

import numpy as np
import pytest
import yaml

import cfem
from cfem.control.open_loop.planners import weights_of
from cfem.core.errors import SpecError
from cfem.plant.fem_plant import FemPlant, pushed
from cfem.predict.loads.spec import LoadSpec, loads_of
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh

G = np.array([0.0, 0.0, -9810.0])  # mm/s^2


def with_centre(bar, name, **more):
    """The bar's scene with its centre of mass watched."""
    path = bar / "pipelines" / "bar" / f"{name}.yaml"
    scene = yaml.safe_load((bar / "pipelines" / "bar" / "scene.yaml").read_text())
    scene["material"]["density"] = "1070 kg/m^3"
    scene["effectors"].append({"name": "body", "at": "centre-of-mass", **more})
    path.write_text(yaml.safe_dump(scene))
    return path


@pytest.fixture(scope="module")
def robot(bar):
    return build_robot(*load_scene_and_mesh(with_centre(bar, "centre")))


def test_it_is_where_the_mass_of_a_uniform_bar_is(robot):
    centre = robot.effectors[1]
    assert centre.rest == pytest.approx([30.0, 0.0, 0.0], abs=1e-9)
    assert centre.mass == pytest.approx(60 * 10 * 10 * 1.07e-9) and robot.masses == {"body": centre.mass}
    assert robot.rows.effectors[3:] == ("body.x", "body.y", "body.z")
    assert robot.aims.tolist() == [True] * 3 + [False] * 3


def test_it_moves_with_the_body_and_its_gradient_is_its_shares(robot):
    centre, rng = robot.effectors[1], np.random.default_rng(0)
    x, step = robot.X + rng.normal(size=robot.X.shape), rng.normal(size=robot.X.shape)
    slope = np.einsum("rki,ki->r", centre.gradient(x), step[centre.nodes])
    assert centre.value(x + step) - centre.value(x) == pytest.approx(slope, rel=1e-9)
    assert centre.value(robot.X + [1.0, 2, 3]) == pytest.approx([31.0, 2, 3])


def test_a_force_on_it_is_the_weight_of_the_scene(bar, robot):
    scene = yaml.safe_load(with_centre(bar, "weight").read_text())
    scene["gravity"] = {"acceleration": {"m/s^2": [0, 0, -9.81]}}
    path = bar / "pipelines" / "bar" / "weight.yaml"
    path.write_text(yaml.safe_dump(scene))
    heavy = build_robot(*load_scene_and_mesh(path))
    push = np.concatenate([np.zeros(3), robot.effectors[1].mass * G])
    assert pushed(robot, push).loads == pytest.approx(heavy.loads, abs=1e-15)


@pytest.mark.slow
def test_the_model_takes_gravity_that_its_samples_did_not_have(bar):
    """0.5 % of the sag with D; `benchmarks/loads.py gravity` has every direction."""
    scene, specs = with_centre(bar, "sags"), bar / "pipelines" / "bar"
    for name, change in (
        ("sample", {"scene": "sags.yaml", "third_order": True, "loads": True, "out": "../../data/bar/sags"}),
        ("train", {"dataset": "../../data/bar/sags", "out": "../../models/bar/sags"}),
    ):
        spec = yaml.safe_load((specs / f"{name}.yaml").read_text()) | change
        (specs / f"{name}-sags.yaml").write_text(yaml.safe_dump(spec))
        cfem.run_stage(name, specs / f"{name}-sags.yaml", **({"workers": 1} if name == "sample" else {}))
    spec = yaml.safe_load((specs / "control.yaml").read_text()) | {
        "scene": "sags.yaml",
        "models": {"spectral": "../../models/bar/sags"},
        "out": "../../data/bar/control-sags",
        "loads": {"body": {"gravity": {"m/s^2": [0, -9.81, 0]}}},
        "trajectories": {"there": {"kind": "goals", "points": {"mm": [[58.7, -2.5, 2.5]]}}},
        "search": {"weights": [0, 0, 1]},
        "fe_based": False,
        "mesh_error": None,
        "pictures": 1,
    }
    (specs / "control-sags.yaml").write_text(yaml.safe_dump(spec))
    found = cfem.run_stage("control", specs / "control-sags.yaml")["results"]
    free, heavy = build_robot(*load_scene_and_mesh(scene)), None
    push = np.concatenate([np.zeros(3), free.effectors[1].mass * np.array([0.0, -9810.0, 0.0])])
    heavy = FemPlant(pushed(free, push)).at_displacement(np.array([0.7])).delta_e[:3]
    sag = np.linalg.norm(heavy - FemPlant(free).at_displacement(np.array([0.7])).delta_e[:3])
    assert sag > 1.5
    error = found["trajectories"]["there"]["spectral"]["distance_to_reachable_goals"]["max"]
    assert error < 0.005 * sag and found["load_error"] < 0.005 * sag


def test_weights_and_goals_are_of_the_other_effectors(robot):
    class Spec:
        object = None

        class search:
            weights = None

    assert weights_of(Spec, robot).tolist() == [1, 1, 1, 0, 0, 0]
    Spec.search.weights = [0.0, 2.0, 0.0]
    assert weights_of(Spec, robot).tolist() == [0, 2, 0, 0, 0, 0]


def test_what_is_missing_is_said(bar):
    path = with_centre(bar, "light")
    scene = yaml.safe_load(path.read_text())
    del scene["material"]["density"]
    path.write_text(yaml.safe_dump(scene))
    with pytest.raises(SpecError, match="needs the density"):
        build_robot(*load_scene_and_mesh(path))
    with pytest.raises(SpecError, match="has no orientation"):
        load_scene_and_mesh(with_centre(bar, "turned", orientation=True))
    gravity = LoadSpec(gravity={"m/s^2": [0, 0, -9.81]})
    with pytest.raises(SpecError, match="no mass that gravity could act on"):
        loads_of({"tip": gravity}, {})
    assert loads_of({"tip": gravity}, {"tip": 2e-6})[0]["tip"] == pytest.approx([0, 0, -0.01962])
