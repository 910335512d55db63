"""What the demo costs, by counts that do not depend on the machine, and what it ends with."""

from pathlib import Path

import pytest

from cfem.control.spec import ControlSpec
from cfem.core.spec import load_spec
from cfem.core.stage import Options
from cfem.pipeline.demo import demo, numbers
from cfem.pipeline.plan import own_specs, plan
from cfem.pipeline.robots import ROBOTS
from cfem.report.spec import ReportSpec
from cfem.robot.spec import SceneSpec
from cfem.sample.spec import SampleSpec

ROOT = Path(__file__).parents[2]
FINGER = ROBOTS / "soft-finger"


def test_the_demo_solves_few_equilibria():
    sample, control = (
        load_spec(FINGER / f"{name}.yaml", spec) for name, spec in (("sample", SampleSpec), ("control", ControlSpec))
    )
    (curve,) = control.trajectories.values()
    assert not control.fe_based and not control.fewer_iterations
    solves = sum(split.rows for split in sample.splits.values()) + 2 * curve.goals + control.mesh_error.states
    assert solves <= 100
    assert load_spec(FINGER / "scene.yaml", SceneSpec).mesh.cells <= 1500
    assert load_spec(FINGER / "report.yaml", ReportSpec).discretisation is None


def test_no_two_lines_of_the_demo_have_the_same_number(monkeypatch, tmp_path):
    steps, said = plan(own_specs(FINGER), {}), []

    def run(places, overrides, options, line):
        said.extend(line(number, steps, ()) for number in range(len(steps)))
        return {"results": {"stages": [], "pages": [], "moved": []}}

    monkeypatch.setattr("cfem.pipeline.demo.run", run)
    demo("soft-finger", tmp_path, Options())
    assert [line.split(":")[0] for line in said] == [f"step {i + 1}/{len(steps)}" for i in range(len(steps))]
    assert "step " not in (ROOT / "scripts" / "setup.sh").read_text()


def test_scenes_of_the_finger_differ_in_their_mesh_alone():
    demo_scene, large = (
        load_spec(FINGER / f"{name}.yaml", SceneSpec).model_dump() for name in ("scene", "scene-large")
    )
    assert {key for key in large if str(demo_scene[key]) != str(large[key])} == {"mesh", "out"}


RESULTS = {
    "trajectories": {
        "curve": {
            "fe-based": {},
            "spectral": {
                "goals": 24,
                "reached": 23,
                "distance_to_reachable_goals": {"mean": 2e-6, "max": 1e-5},
                "step_us": {"median": 500.0},
            },
        }
    },
    "discretisation": {"tip_mm": 1.44, "tip_percent": 1.2},
    "fe_cost": {"solves": 10, "seconds": 3.0},
}


def test_three_numbers_are_said_once():
    goals, error, time = numbers(RESULTS)
    assert "23 of 24 of the curve 'curve'" in goals
    assert error == (
        "tracking error:     up to 1.4 mm (1.2 % of the robot's length) in a robot of a much finer mesh, as estimated; "
        "2 nm on average on the mesh that the model has learned"
    )
    assert "500 µs with the learned model; one FE solve takes 300 ms, 600 times as long" in time


def test_what_is_not_known_is_said_to_be_so():
    changed = RESULTS | {"discretisation": {"left_out": "mesh_error is null"}, "fe_cost": None}
    _, error, time = numbers(changed)
    assert error.endswith(
        "2 nm on average on the mesh that the model has learned; on a finer mesh it is not known: mesh_error is null"
    )
    assert time.endswith("500 µs with the learned model")


def test_a_robot_without_a_curve_is_refused(tmp_path):
    from cfem.core.errors import SpecError

    with pytest.raises(SpecError, match=r"soft-finger-tet4 comes without a curve .* soft-finger"):
        demo("soft-finger-tet4", tmp_path, Options(quiet=True))
