"""A spec that is read by the wrong command is called what it is."""

from pathlib import Path

import pytest

from cfem.core.errors import SpecError
from cfem.core.kinds import KINDS, model_of, other_kind
from cfem.core.spec import load_spec
from cfem.core.yaml import read_yaml

PIPELINES = Path(__file__).parents[2] / "pipelines"


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
