"""What is run, in which order, for a folder or a spec."""

import shutil
from pathlib import Path

import pytest

from cfem.core.errors import InputError, SpecError
from cfem.core.stage import Options
from cfem.pipeline.plan import kind_named, own_specs, plan
from cfem.pipeline.run import run

PIPELINES = Path(__file__).parents[2] / "pipelines"


def order(*goals):
    return [f"{step.spec.parent.name}/{step.spec.stem}" for step in plan([PIPELINES / one for one in goals], {})]


def of_folder(name):
    return [f"{step.spec.parent.name}/{step.spec.stem}" for step in plan(own_specs(PIPELINES / name), {})]


def test_a_folder_is_its_specs_without_a_suffix_in_the_order_of_the_pipeline():
    assert of_folder("bar") == [f"bar/{kind}" for kind in ("scene", "sample", "train", "export", "control", "report")]


def test_a_variant_brings_what_it_needs():
    assert order("soft-finger/export-c.yaml") == [
        f"soft-finger/{stem}" for stem in ("scene-large", "sample-large", "train-large", "export-c")
    ]


def test_what_specs_of_other_folders_make_is_found_there():
    assert of_folder("soft-gripper")[0] == "finger-button/scene"
    found = of_folder("stiff-flop")
    assert (
        found.index("stiff-flop-module/train")
        < found.index("stiff-flop/train-serial")
        < found.index("stiff-flop/report")
    )


def test_every_step_comes_after_what_it_needs_and_once():
    goals = [
        spec for name in ("parametric-finger", "stiff-flop", "soft-gripper") for spec in own_specs(PIPELINES / name)
    ]
    done = []
    for step in plan(goals, {}):
        assert set(step.needs) <= set(done) and step.spec not in done
        done.append(step.spec)
    assert len(done) == 28


def write(folder, **texts):
    for name, text in texts.items():
        (folder / f"{name.replace('_', '-')}.yaml").write_text(text)


def test_an_input_that_nothing_makes_is_named_before_anything_runs(tmp_path):
    write(tmp_path, export="model: models/none\nout: there\n")
    with pytest.raises(InputError, match=r"models/none: .*export.yaml needs it, and no spec .* makes it"):
        plan([tmp_path / "export.yaml"], {})
    with pytest.raises(InputError, match=r"holds none of scene.yaml, sample.yaml"):
        own_specs(tmp_path / "..")


def test_specs_that_need_each_other_and_names_of_no_kind_are_refused(tmp_path):
    write(tmp_path, export="model: a\nout: b\n", export_other="model: b\nout: a\n", other="model: b\n")
    with pytest.raises(SpecError, match="needs its own result"):
        plan([tmp_path / "export.yaml"], {})
    with pytest.raises(SpecError, match="begins with none of scene, sample"):
        plan([tmp_path / "other.yaml"], {})
    with pytest.raises(InputError, match="nowhere: no such folder or spec"):
        plan([tmp_path / "nowhere"], {})


def test_stages_go_by_the_names_of_commands_and_of_specs():
    assert (
        kind_named("simulate-sample") == kind_named("sample") == "sample" and kind_named("optimize-design") == "design"
    )
    with pytest.raises(SpecError, match="'sampel' is no stage"):
        kind_named("sampel")


@pytest.mark.parametrize(
    "override, said",
    [
        ("scene.mesh.size=2 mm", "would change the mesh alone"),
        ("samples.rows=3", "names none of the specs scene, sample"),
        ("train", "names none of"),
    ],
)
def test_overrides_go_to_a_spec_by_its_name_and_never_to_the_scene(override, said):
    with pytest.raises(SpecError, match=said):
        run([PIPELINES / "bar"], [override], Options(check=True, quiet=True))


def test_overrides_reach_their_spec():
    steps = plan(own_specs(PIPELINES / "bar"), {PIPELINES / "bar" / "train.yaml": ["samples=9"]})
    assert next(step.stage.spec.samples for step in steps if step.kind == "train") == 9


def test_as_many_processes_solve_samples_as_asked(tmp_path, monkeypatch):
    shutil.copytree(PIPELINES / "bar", tmp_path / "pipelines" / "bar")
    asked = []
    monkeypatch.setattr("cfem.sample.stage.run", lambda *_, workers, **more: asked.append(workers) or {})
    monkeypatch.setattr("cfem.pipeline.run._figures", lambda steps: {})
    run([tmp_path / "pipelines" / "bar"], [], Options(quiet=True), only="sample", workers=3)
    assert asked == [3]


def test_a_missing_scene_names_the_calibration_that_makes_it(tmp_path):
    folder = tmp_path / "pipelines" / "measured-tentacle"
    shutil.copytree(PIPELINES / "measured-tentacle", folder)
    with pytest.raises(
        InputError, match=r"no such file \(run cfem calibrate-cases .*measured-tentacle/cases.yaml first\)"
    ):
        plan([folder / "control-calibrated.yaml"], {})
