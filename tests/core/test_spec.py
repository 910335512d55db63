import json

import jsonschema
import numpy as np
import pytest
from pydantic import Field, model_validator

from cfem.core.errors import SpecError
from cfem.core.origin import Origin
from cfem.core.spec import Spec, json_schema, load_spec, meaning
from cfem.core.units import Angle, Length, LengthMatrix, Points


class Inner(Spec):
    stiffness: Length
    corners: LengthMatrix | None = None


class Outer(Spec):
    name: str
    """What the outer one
    is called."""
    inner: Inner
    gap: Length = Field(2.5, gt=0)
    """Free space."""
    slope: Angle = np.pi / 4
    parts: list[Inner] = []
    count: int = Field(default=1, gt=0)
    least: list[int] = Field([1], min_length=1)

    @model_validator(mode="after")
    def _rising(self):
        for index, (one, other) in enumerate(zip(self.least, self.least[1:], strict=False)):
            if not one < other:
                raise ValueError(f"least.{index + 1}: must be larger than {one}")
        return self


TEXT = "name: a\ninner:\n  stiffness: 3 cm\nparts:\n  - {stiffness: 1 mm}\n"


def load(tmp_path, text, *overrides):
    path = tmp_path / "spec.yaml"
    path.write_text(text)
    return load_spec(path, Outer, overrides)


def test_values_arrive_in_the_system_of_units(tmp_path):
    spec = load(tmp_path, TEXT)
    assert spec.inner.stiffness == 30.0 and spec.parts[0].stiffness == 1.0


def test_overrides_reach_nested_keys_and_lists(tmp_path):
    spec = load(tmp_path, TEXT, "inner.stiffness=2 m", "parts.0.stiffness=7 mm", "count=1e1")
    assert (spec.inner.stiffness, spec.parts[0].stiffness, spec.count) == (2000.0, 7.0, 10)


@pytest.mark.parametrize(
    "text, overrides, parts",
    [
        (TEXT + "cuont: 3\n", (), ["spec.yaml:6", "unknown key 'cuont'", "did you mean 'count'?"]),
        (
            TEXT.replace("stiffness: 3", "stifness: 3"),
            (),
            ["spec.yaml:3", "inner.stifness", "did you mean 'stiffness'?"],
        ),
        (TEXT, ("gap=-3 cm",), ["--set: gap: must be greater than 0, got '-3 cm'"]),
        (TEXT.replace("3 cm", "3 kPa"), (), ["spec.yaml:3", "inner.stiffness", "not a unit of length"]),
        (TEXT.replace("3 cm", "3"), (), ["spec.yaml:3", "length with its unit, such as '1 mm'; got the bare number 3"]),
        (TEXT.replace("{stiffness: 1 mm}", "{}"), (), ["spec.yaml:5", "missing key 'stiffness'"]),
        (TEXT, ("count=0",), ["--set", "count", "greater than 0"]),
        (TEXT, ("count=1.5",), ["--set", "count: expected a whole number, got 1.5"]),
        (TEXT + "least: []\n", (), ["spec.yaml:6: least: needs 1 or more, got 0"]),
        (TEXT + "least: [3, 2]\n", (), ["spec.yaml:6: least.1: must be larger"]),
        (TEXT, ("nonsense",), ["--set", "not of the form key.sub=value"]),
        (TEXT, ("name.sub.x=1",), ["--set", "the spec has no key"]),
        (TEXT, ("parts.7.stiffness=1 mm",), ["--set", "the spec has no key"]),
    ],
)
def test_each_mistake_gets_a_sentence_that_names_its_place(tmp_path, text, overrides, parts):
    with pytest.raises(SpecError) as error:
        load(tmp_path, text, *overrides)
    for part in parts:
        assert part in str(error.value)


def test_a_key_of_another_part_is_not_suggested(tmp_path):
    with pytest.raises(SpecError, match=r"spec\.yaml:3: inner\.coutn: unknown key 'coutn'$"):
        load(tmp_path, TEXT.replace("stiffness: 3 cm", "coutn: 3"))


PLACES = {
    "no place of its own": ((), None, "spec.yaml: wrong"),
    "a key": ((), "inner.stiffness", "spec.yaml:3: inner.stiffness: wrong"),
    "a key that is not written": ((), "inner.corners", "spec.yaml:2: inner.corners: wrong"),
    "an item": (("parts", 0), None, "spec.yaml:5: parts.0: wrong"),
    "a row under its unit": (("parts", 0), "corners.1", "spec.yaml:8: parts.0.corners.1: wrong"),
    "an override": ((), "count", "--set: count: wrong"),
    "an option": ((), "--out", "^--out: wrong"),
    "a file": ((), "data/name.yaml", "^data/name.yaml: wrong"),
    "another file": (("parts", 0), "name.step", "^name.step: wrong"),
    "placed already": (("parts", 0), "other.yaml:3: name", "^other.yaml:3: name: wrong"),
}


@pytest.mark.parametrize("key, where, said", PLACES.values(), ids=PLACES.keys())
def test_a_later_mistake_is_named_with_file_and_line(tmp_path, key, where, said):
    text = TEXT.replace("{stiffness: 1 mm}", "stiffness: 1 mm\n    corners: {mm: [\n      [1, 2],\n      [3, 4]]}")
    spec = load(tmp_path, text, "count=3")
    with pytest.raises(SpecError, match=said), spec.locating(*key):
        raise SpecError("wrong", where=where)


def test_a_mistake_below_a_key_that_an_override_made_is_the_overrides():
    origin = Origin("spec.yaml", {(): 1, ("name",): 1, ("extra", "sub", "here"): 0})
    assert origin.place(("extra", "sub", "here", "deeper")) == "--set: extra.sub.here.deeper"
    assert origin.place(("extra", "sub", "other")) == "--set: extra.sub.other"
    assert origin.place(("extra",)) == "--set: extra"
    assert origin.place(("another",)) == "spec.yaml:1: another"


def test_a_spec_without_a_file_names_the_key():
    with pytest.raises(SpecError, match="inner: wrong"), Outer(name="a", inner=Inner(stiffness="1 mm")).locating():
        raise SpecError("wrong", where="inner")


def test_schema_is_draft_07_and_agrees_with_the_model():
    schema = json_schema(Outer)
    jsonschema.Draft7Validator.check_schema(schema)
    assert "prefixItems" not in json.dumps(schema)
    validator = jsonschema.Draft7Validator(schema)
    good = {"name": "a", "inner": {"stiffness": "3 mm", "corners": {"mm": [[1, 2, 3]]}}}
    assert validator.is_valid(good)
    assert not validator.is_valid({**good, "other": 1})
    assert not validator.is_valid({**good, "inner": {"stiffness": 3}})


def test_schema_has_the_string_below_a_field_for_its_description_and_defaults_with_units():
    fields = json_schema(Outer)["properties"]
    assert fields["name"]["description"] == "What the outer one is called."
    assert fields["gap"]["description"].startswith("Free space. (length with its unit")
    assert (fields["gap"]["default"], fields["slope"]["default"]) == ("2.5 mm", "45 deg")


class Heir(Outer):
    """Inherits fields."""

    name: str
    """What the heir is called."""


def test_inherited_fields_keep_their_description():
    fields = json_schema(Heir)["properties"]
    assert fields["name"]["description"] == "What the heir is called."
    assert fields["gap"]["description"] == json_schema(Outer)["properties"]["gap"]["description"]


def test_meaning_leaves_out_what_is_default_and_what_is_named():
    class Part(Spec):
        size: float
        note: str | None = None
        corners: Points | None = None

    class Whole(Spec):
        out: str
        parts: list[Part]
        kind: str = "plain"

    corners = np.zeros((2, 3))
    whole = Whole.model_construct(
        out="x", parts=[Part(size=1.0), Part.model_construct(size=2.0, note=None, corners=corners)], kind="plain"
    )
    found = meaning(whole, {"out"})
    assert found["parts"][0] == {"size": 1.0} and set(found) == {"parts"}
    np.testing.assert_array_equal(found["parts"][1]["corners"], corners)
    assert meaning(Whole(out="x", parts=[], kind="other")) == {"out": "x", "parts": [], "kind": "other"}


def test_meaning_compares_parts_that_hold_arrays_with_their_defaults():
    class Part(Spec):
        corners: LengthMatrix | None = None

    class Whole(Spec):
        part: Part = Part()
        parts: tuple[Part, ...] = (Part(corners={"mm": [[1, 2]]}),)

    given = {"corners": {"mm": [[1, 2]]}}
    assert meaning(Whole(parts=[given])) == {}
    found = meaning(Whole(part=given, parts=[given | {"corners": {"mm": [[1, 3]]}}]))
    np.testing.assert_array_equal(found["part"]["corners"], [[1, 2]])
    np.testing.assert_array_equal(found["parts"][0]["corners"], [[1, 3]])
