"""Which tests run which line of the package: measured once, for scripts/mutate.py.

As a plugin of pytest (`-p covering_tests`, this folder on PYTHONPATH) it records, of every test that passes, the lines
that it runs, the fixtures that it asks for and its seconds; lines that a fixture runs count for every test that asks
for that fixture. The record lies in the folder that COVERING_TESTS names. Lines that subprocesses run are not
recorded."""

import json
import os
from collections import defaultdict
from dataclasses import dataclass, field
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FIXTURE = "fixture "
FOLDER = "COVERING_TESTS"
_coverage = None
_tests: dict[str, dict] = {}


def pytest_configure(config):
    global _coverage
    if FOLDER not in os.environ:
        return
    import coverage

    folder = Path(os.environ[FOLDER])
    folder.mkdir(parents=True, exist_ok=True)
    _coverage = coverage.Coverage(str(folder / "lines"), data_suffix=True, config_file=False, source_pkgs=["cfem"])
    _coverage.start()


def pytest_unconfigure(config):
    if _coverage is None:
        return
    _coverage.stop()
    _coverage.save()
    (Path(os.environ[FOLDER]) / f"tests.{os.getpid()}.json").write_text(json.dumps(_tests))


@pytest.hookimpl(wrapper=True)
def pytest_fixture_setup(fixturedef, request):
    if _coverage is None:
        return (yield)
    _coverage.switch_context(f"{FIXTURE}{fixturedef.baseid}::{fixturedef.argname}")
    try:
        return (yield)
    finally:
        _coverage.switch_context(request.node.nodeid if isinstance(request.node, pytest.Item) else "")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item):
    if _coverage is None:
        return (yield)
    _coverage.switch_context(item.nodeid)
    try:
        return (yield)
    finally:
        _coverage.switch_context("")


def pytest_runtest_makereport(item, call):
    known = _tests.setdefault(item.nodeid, {"seconds": 0.0, "failed": False, "fixtures": []})
    known["seconds"] += call.duration
    known["failed"] |= call.excinfo is not None
    infos = item._fixtureinfo.name2fixturedefs if hasattr(item, "_fixtureinfo") else {}
    known["fixtures"] = sorted({f"{one.baseid}::{name}" for name, defs in infos.items() for one in defs})


@dataclass(frozen=True)
class CoveringTests:
    """lines: by file, as its path below src/cfem, and by line: the tests that run it. seconds: by test."""

    lines: dict[str, dict[int, frozenset[str]]]
    seconds: dict[str, float] = field(default_factory=dict)

    @classmethod
    def read(cls, folder: Path) -> "CoveringTests":
        """What the plugin has recorded in this folder, of all its processes; nothing where it recorded nothing."""
        import coverage

        tests: dict[str, dict] = {}
        for path in sorted(folder.glob("tests.*.json")):
            tests |= json.loads(path.read_text())
        passed = {test for test, known in tests.items() if not known["failed"]}
        asking = defaultdict(set)
        for test in passed:
            for fixture in tests[test]["fixtures"]:
                asking[FIXTURE + fixture].add(test)
        lines: dict[str, dict[int, set[str]]] = defaultdict(lambda: defaultdict(set))
        for path in sorted(folder.glob("lines.*")):
            data = coverage.CoverageData(str(path))
            data.read()
            for file in data.measured_files():
                of_file = lines[file.rpartition("/cfem/")[2]]
                for line, contexts in data.contexts_by_lineno(file).items():
                    for context in contexts:
                        of_file[line] |= (
                            asking.get(context, set()) if context.startswith(FIXTURE) else {context} & passed
                        )
        frozen = {file: {n: frozenset(some) for n, some in each.items()} for file, each in lines.items()}
        return cls(frozen, {test: tests[test]["seconds"] for test in passed})

    def of(self, file: Path, first: int, last: int) -> list[str]:
        """The tests that run one of these lines of a file, or where none is known to, those that run any of its lines
        and those of the file that mirrors it: lines of a module are run as it is imported, and compiled ones by no
        interpreter. The nearest test comes first, of equally near ones the quickest."""
        known = self.lines.get(file.as_posix(), {})
        found = set().union(*(known.get(n, ()) for n in range(first, last + 1)))
        if not found:
            mirroring = (test for test in self.seconds if distance(file, test) < 0)
            found = set().union(*known.values(), mirroring)
        return sorted(found, key=lambda test: (distance(file, test), self.seconds[test], test))


def distance(file: Path, test: str) -> int:
    """Folders between a file below src/cfem and a test; fewer than none for the file that mirrors it."""
    path = Path(test.partition("::")[0])
    beside = Path("tests", file.parent, f"test_{file.name}")
    common = len(os.path.commonpath([path.parent, beside.parent]).split(os.sep))
    return -1 if path == beside else len(path.parent.parts) + len(beside.parent.parts) - 2 * common
