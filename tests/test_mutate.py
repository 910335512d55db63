"""The changes that a mutation run makes, and whose compiled code they are part of."""

import ast
import os
import subprocess
import sys
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


@pytest.mark.parametrize("status", [0, 1])
def test_tests_that_fail_without_a_change_end_the_run(mutate, monkeypatch, status):
    """Every change would count as caught."""
    asked = []
    monkeypatch.setattr(mutate, "run_tests", lambda package, tests, seconds: asked.append(tests) or status)
    monkeypatch.setattr(mutate, "changed_package", lambda file, index, place: asked.append(index))
    covering = mutate.CoveringTests({}, {})
    if status:
        with pytest.raises(SystemExit, match="nothing was changed"):
            mutate.demand_green(Path("contact/law/path.py"), covering)
    else:
        mutate.demand_green(Path("contact/law/path.py"), covering)
    assert asked[0] is None and "tests/contact/law/test_path.py" in asked[1]


@pytest.fixture
def record(mutate):
    """Which tests run which lines of two files."""
    near, beside, far = "tests/contact/test_a.py::one", "tests/contact/test_b.py::two", "tests/gym/test_c.py::three"
    lines = {
        "contact/a.py": {3: frozenset({far, beside}), 4: frozenset({near, far}), 9: frozenset({far})},
        "contact/b.py": {},
    }
    return mutate.CoveringTests(lines, {near: 2.0, beside: 3.0, far: 0.1}), near, beside, far


def test_a_change_is_answered_for_by_the_tests_that_run_its_lines_the_nearest_first(record):
    covering, near, beside, far = record
    assert covering.of(Path("contact/a.py"), 3, 4) == [near, beside, far]
    assert covering.of(Path("contact/a.py"), 9, 9) == [far]


def test_a_line_that_runs_on_import_is_answered_for_by_the_tests_of_its_file(record):
    covering, near, beside, far = record
    assert covering.of(Path("contact/a.py"), 1, 2) == [near, beside, far]


def test_a_line_that_is_compiled_is_answered_for_by_the_tests_of_the_file_that_mirrors_it(record):
    covering, _, beside, _ = record
    assert covering.of(Path("contact/b.py"), 1, 9) == [beside]


def test_without_a_record_the_tests_that_import_a_file_answer_for_it(mutate, record):
    covering = record[0]
    assert covering.of(Path("contact/c.py"), 1, 9) == []
    gains = mutate.tests_of(Path("plant/gains.py"), 1, 2, covering)
    assert gains[0] == "tests/plant/test_gains.py" and "tests/control/closed_loop/test_feedback.py" in gains
    assert mutate.tests_of(Path("plant/fem_robot.py"), 1, 2, covering) == ["tests/plant"]  # which none imports


def test_the_record_has_the_lines_of_tests_and_of_their_fixtures_and_no_test_that_failed(mutate, tmp_path):
    (tmp_path / "test_it.py").write_text(
        "import pytest\n"
        "from cfem.plant.gains import late_samples\n"
        "@pytest.fixture(scope='module')\n"
        "def gains():\n    return late_samples(3, 1.0)\n"
        "def test_made(gains):\n    assert gains\n"
        "def test_asks_too(gains):\n    assert gains\n"
        "def test_asks_nothing():\n    pass\n"
        "def test_fails(gains):\n    assert not gains\n"
    )
    folder = tmp_path / "record"
    paths = os.pathsep.join([str(ROOT / "src"), str(ROOT / "scripts")])
    command = [sys.executable, "-m", "pytest", "-q", "-n", "0", "-p", "no:cacheprovider", "-p", "covering_tests", "."]
    done = subprocess.run(
        command,
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": paths, "COVERING_TESTS": str(folder)},
        capture_output=True,
    )
    assert done.returncode == 1, done.stdout  # one failed
    covering = mutate.CoveringTests.read(folder)
    assert set(covering.seconds) == {f"test_it.py::test_{name}" for name in ("made", "asks_too", "asks_nothing")}
    asking = set().union(*covering.lines["plant/gains.py"].values())
    assert asking == {"test_it.py::test_made", "test_it.py::test_asks_too"}
