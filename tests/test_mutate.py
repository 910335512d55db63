"""The changes that a mutation run makes, and whose compiled code they are part of."""

import ast
from pathlib import Path

import pytest
from support.script import script

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def mutate():
    return script("mutate")


def changed(mutate, source):
    """Every changed form of a source."""
    found = set()
    for index in range(len(mutate.changes(ast.parse(source)))):
        tree = ast.parse(source)
        found.add(ast.unparse(ast.fix_missing_locations(mutate.Change(*mutate.changes(tree)[index]).visit(tree))))
    return found


@pytest.mark.parametrize(
    "source, forms",
    [
        ("a < b", {"a >= b"}),
        ("x = a + b * c", {"x = a - b * c", "x = a + b / c"}),
        ("x = -a", {"x = a"}),
        ("x = a[-1]", {"x = a[1]", "x = a[-0]"}),
        ("x = a or not b", {"x = a and (not b)", "x = a or b"}),
        ("x = a if b else c", {"x = a if not b else c"}),
        ("x = 0.5", {"x = 1.5"}),
        ("x += f", {"pass"}),
    ],
)
def test_each_kind_of_change(mutate, source, forms):
    found = {form.strip() for form in changed(mutate, source)} - {"pass"}
    assert found == forms - {"pass"} and ("pass" in forms) <= ("pass" in changed(mutate, source))


def test_docstrings_and_type_hints_stay(mutate):
    assert changed(mutate, '"""Text."""\ndef f(x: int | None): ...') == set()


def test_a_kernel_is_part_of_what_is_compiled_with_it(mutate):
    stems = {one.stem for one in mutate.compiled_with(Path("mechanics/material/tensor.py"))}
    assert {"tensor", "neo_hookean", "ogden"} <= stems and "rod" not in stems
    assert mutate.compiled_with(Path("control/search/qp.py")) == set()


def test_changes_that_alter_nothing_are_known_and_gone_ones_named(mutate, monkeypatch, tmp_path, capsys):
    listed = tmp_path / "equivalent.toml"
    listed.write_text('[[equivalent]]\nchange = "a"\nwhy = "-"\n[[equivalent]]\nchange = "b"\nwhy = "-"\n')
    monkeypatch.setattr(mutate, "EQUIVALENT", listed)
    assert mutate.equivalent({"a", "c"}) == {"a"}
    assert capsys.readouterr().err == "equivalent.toml: is no more: b\n"
