"""What a coarse answer takes from the specs, and where it goes."""

from pathlib import Path

import pytest

from cfem.core.errors import SpecError
from cfem.pipeline.plan import own_specs, plan
from cfem.pipeline.quick import quick_steps

PIPELINES = Path(__file__).parents[2] / "pipelines"


def steps_of(robot):
    steps = plan(own_specs(PIPELINES / robot), {})
    return steps, quick_steps(steps)


@pytest.mark.parametrize("robot", ["bar", "trunk", "stiff-flop"])
def test_all_that_samples_make_goes_to_other_folders_and_the_mesh_stays(robot):
    steps, quick = steps_of(robot)
    assert [step.kind for step in quick] == [step.kind for step in steps] and any(step.quick for step in quick)
    full_outs = {step.stage.out.resolve() for step in steps if step.kind != "scene"}
    for step, coarse in zip(steps, quick, strict=True):
        assert coarse.quick == (step.kind != "scene")
        assert coarse.stage.out.name == step.stage.out.name + "-quick" * coarse.quick
        for name, path in step.stage.inputs.items():
            moved = coarse.stage.inputs[name]
            assert moved.name == path.name + "-quick" * (path.resolve() in full_outs)
        assert coarse.stage.inputs.keys() == step.stage.inputs.keys()


def test_samples_and_control_take_a_fraction_of_the_time():
    by_kind = {step.kind: step.stage.spec for step in steps_of("trunk")[1]}
    assert {name: split.rows for name, split in by_kind["sample"].splits.items()} == {"train": 60, "test": 20}
    control = by_kind["control"]
    assert not control.fe_based and control.mesh_error is None
    assert [trajectory.goals for trajectory in control.trajectories.values()] == [12, 12]


def test_a_few_rows_stay_as_they_are_and_a_grid_too():
    steps = plan([PIPELINES / "bar" / "sample.yaml"], {PIPELINES / "bar" / "sample.yaml": GRID}, follow=False)
    (coarse,) = quick_steps(steps)
    assert {name: split.rows for name, split in coarse.stage.spec.splits.items()} == {"train": 27, "test": 5}


GRID = ["splits.train.method=grid", "splits.train.rows=27", "splits.test.rows=5"]


def test_without_samples_nothing_can_be_coarse():
    with pytest.raises(SpecError, match="no stage here solves any"):
        quick_steps(plan([PIPELINES / "bar" / "scene.yaml"], {}))
