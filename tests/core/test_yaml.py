from pathlib import Path

import pytest

from cfem.core.errors import CfemError, InputError, SpecError
from cfem.core.yaml import parse_value, parse_yaml, read_yaml


def test_scientific_notation_is_a_number_and_yes_is_text():
    data, _ = parse_yaml("a: 1e-3\nb: yes\nc: 0x10\nd: [1, 2.5]\ne: true\nf: null\n", "spec")
    assert data == {"a": 1e-3, "b": "yes", "c": 16, "d": [1, 2.5], "e": True, "f": None}
    assert type(data["a"]) is float and type(data["d"][0]) is int


def test_every_key_knows_its_line():
    _, lines = parse_yaml("a:\n  b: 1\n  c:\n    - x\n    - y: 2\n", "spec")
    assert (lines[("a", "b")], lines[("a", "c", 0)], lines[("a", "c", 1, "y")]) == (2, 4, 5)


@pytest.mark.parametrize(
    "text, where",
    [("a: 1\na: 2\n", "spec:2"), ("a: [1, 2\n", "spec"), ("- 1\n", "spec"), ("a: \tb: c\n", "spec"), ("", "spec")],
)
def test_damaged_yaml_names_its_place(text, where):
    with pytest.raises(SpecError, match=where):
        parse_yaml(text, "spec")


def test_aliases_that_grow_without_end_are_refused():
    bomb = "a: &a [1,1,1,1,1,1,1,1,1]\n" + "".join(
        f"{name}: &{name} [{','.join(['*' + before] * 9)}]\n"
        for before, name in zip("abcdefgh", "bcdefghi", strict=True)
    )
    with pytest.raises(SpecError, match="aliases that expand"):
        parse_yaml(bomb, "spec")


@pytest.mark.parametrize(
    "text, what",
    [
        ("a: " + "[" * 60 + "]" * 60, "more than 50 levels"),
        ("a: " + "[" * 100_000, "more than 50 levels"),
        ("b: 1\na: " + "x" * 10_001, "10000 characters"),
        ('a: {b: "x\\0y"}', "cannot be printed"),
        ('"a\\x07": 1', "cannot be printed"),
        ("a: 1" + "0" * 5000, "not valid YAML"),
        ("b: 1\na: !!python/tuple [1]", "the tag '!!python/tuple'"),
        ("a: !!python/object:os.system {b: 1}", "the tag '!!python/object:os.system'"),
        ("a: !mine 3", "the tag '!mine'"),
        ("b: 1\na: {mm: 1" + "0" * 400 + "}", "integer of more than 64 bits"),
    ],
)
def test_what_no_spec_has_is_refused_in_one_line(text, what):
    with pytest.raises(SpecError, match=what) as refused:
        parse_yaml(text, "spec")
    assert str(refused.value).startswith("spec") and len(str(refused.value).splitlines()) == 1


def test_no_more_of_a_file_is_read_than_a_spec_may_have(tmp_path):
    with pytest.raises(SpecError, match="larger than"):
        read_yaml(Path("/dev/zero"))
    with pytest.raises(InputError, match="is a folder"):
        read_yaml(tmp_path)


def test_missing_and_unreadable_files(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        read_yaml(tmp_path / "none.yaml")
    (tmp_path / "bytes.yaml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="is not text"):
        read_yaml(tmp_path / "bytes.yaml")


@pytest.mark.parametrize("content", [b"ISO-10303-21;\nHEADER;\n", b"\xff\xfe\x00", b"solid robot\n"])
def test_a_shape_in_place_of_a_spec_is_told_from_one(tmp_path, content):
    shape = tmp_path / "robot.STEP"
    shape.write_bytes(content)
    with pytest.raises(CfemError, match=r"robot\.STEP: is not a spec.*cfem init NAME --from FILE"):
        read_yaml(shape)


@pytest.mark.parametrize("text, value", [("1e-3", 1e-3), ("3 mm", "3 mm"), ("[1, 2]", [1, 2]), ("true", True)])
def test_override_values_are_yaml(text, value):
    assert parse_value(text) == value
