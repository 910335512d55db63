"""A spec that is read by the wrong command is called what it is."""

from pathlib import Path

import pytest

from cfem.core.artefact.judgement import sentences
from cfem.core.artefact.manifest import read_manifest, write_manifest
from cfem.core.errors import SpecError
from cfem.core.kinds import KINDS, model_of, other_kind
from cfem.core.spec import Spec, load_spec
from cfem.core.stage import Options, Stage, run_stage
from cfem.core.yaml import read_yaml

PIPELINES = Path(__file__).parents[2] / "pipelines"
HASHED = "fd66caa4db7709384e466fc1ca7b12ac907122d456c0d5252adba5cecb20f206"


@pytest.mark.parametrize("path", sorted(PIPELINES.glob("soft-finger/*.yaml")), ids=lambda path: path.stem)
def test_a_spec_of_another_kind_is_recognised(path):
    kind = path.stem.split("-")[0]
    keys = read_yaml(path)[0]
    assert other_kind(keys, model_of(kind)) is None
    for wanted in set(KINDS) - {kind}:
        said = other_kind(keys, model_of(wanted))
        assert said is None or f"is a {kind} spec" in said
    assert sum(other_kind(keys, model_of(wanted)) is not None for wanted in KINDS) >= 4


def test_the_sentence_names_the_right_command():
    said = "scene.yaml: is a scene spec, which `cfem mesh` reads; `cfem train` reads a train spec"
    with pytest.raises(SpecError, match=said):
        load_spec(PIPELINES / "bar" / "scene.yaml", model_of("train"))


def test_a_mistyped_key_is_no_other_kind():
    assert other_kind(["scene", "mesh", "out", "split"], model_of("sample")) is None


def test_results_of_a_command_that_has_another_name_now_stay_up_to_date(tmp_path):
    """The hash is the one that cfem wrote when the command was called `simulate-sample`."""

    class Numbers(Spec):
        value: int = 1
        out: str = "somewhere"

    def refuse(folder):
        raise AssertionError("must not run")

    stage = Stage("sample", 1, Numbers(), {}, tmp_path / "out", ("out",))
    run_stage(stage, lambda folder: {}, Options())
    old = {**read_manifest(stage.out), "stage": "simulate-sample", "made_from": HASHED}
    write_manifest(stage.out, old)
    assert run_stage(stage, refuse, Options())["status"] == "up to date"
    assert read_manifest(stage.out)["stage"] == "sample"
    assert sentences({"judgement": [{"what": "few", "from": "simulate-sample"}]}) == ["POOR input, by cfem sample: few"]
