"""Changes lines of the core one at a time and counts the changes that no test notices.

python scripts/mutate.py [--count 60] [--seed 0] [--only control/search/qp.py] [--jobs 2] [--least 0.9]

A change flips a comparison, an arithmetic operator, a sign, `and` and `or`, a condition or a number, or leaves a
statement out. It is made in a copy of the package, the tests beside the changed file run against it, and what they let
pass is printed, with the share that was caught of each package and of all. Changes that alter no answer are listed,
each with its reason, in equivalent_changes.toml, and are not tried."""

import argparse
import ast
import contextlib
import importlib
import os
import random
import re
import resource
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from covering_tests import CoveringTests, distance

ROOT = Path(__file__).parents[1]
# Files of the core, and the tests that answer for them beside those of the same name; none named: those of the
# nearest folder. The first that fits counts.
CORE = {
    "condensed/": ["tests/condensed"],
    "constraint/": ["tests/constraint"],
    "contact/": ["tests/contact"],
    "mechanics/": ["tests/mechanics"],
    "equilibrium/": ["tests/equilibrium"],
    "plant/": ["tests/plant"],
    "predict/estimation/": ["tests/predict/estimation"],
    "motion/estimation/": ["tests/motion/estimation"],
    "control/adaptation/": ["tests/control/adaptation"],
    "control/motion/observer.py": ["tests/control/motion/test_observer.py"],
    "control/search/active_set.py": ["tests/control/search"],
    "control/search/qp.py": ["tests/control/search"],
    "control/search/qp_program.py": ["tests/control/search"],
    "control/search/inverse.py": ["tests/control/search"],
    "control/search/goal_search.py": ["tests/control"],
    "control/closed_loop/tick.py": ["tests/control"],
    "control/closed_loop/controller.py": ["tests/control"],
    "control/": [],
    "motion/": [],
    "predict/": [],
    "core/artefact/files.py": ["tests/core/artefact/test_files.py"],
    "robot/checks/soundness.py": ["tests/robot/checks/test_soundness.py"],
    "identify/fit/uncertainty.py": ["tests/identify/fit/test_uncertainty.py"],
    "surrogate/semidefinite.py": ["tests/surrogate/test_semidefinite.py"],
}
FEW = 5  # tests that have to pass without a change
NOT_RUN = (pytest.ExitCode.USAGE_ERROR, pytest.ExitCode.NO_TESTS_COLLECTED)
EQUIVALENT = ROOT / "scripts/equivalent_changes.toml"
COMPARISONS = {ast.Lt: ast.GtE, ast.LtE: ast.Gt, ast.Gt: ast.LtE, ast.GtE: ast.Lt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq}
OPERATORS = {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.MatMult: ast.Mult}


def changes(tree: ast.Module) -> list[tuple[ast.AST, str]]:
    """Places that can be changed, and how."""
    found: list[tuple[ast.AST, str]] = []
    negative = {node.operand for node in ast.walk(tree) if _negative(node)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Compare) and type(node.ops[0]) in COMPARISONS:
            found.append((node, "comparison"))
        elif isinstance(node, ast.BinOp) and type(node.op) in OPERATORS and not _type_hint(node):
            found.append((node, "operator"))
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.Not):
            found.append((node, "sign"))
        elif isinstance(node, ast.BoolOp):
            found.append((node, "and or"))
        elif isinstance(node, ast.If | ast.While | ast.IfExp):
            found.append((node, "condition"))
        elif isinstance(node, ast.Expr | ast.AugAssign) and not _docstring(node):
            found.append((node, "left out"))
        elif isinstance(node, ast.Constant) and type(node.value) in (int, float):
            found.append((node, "negative number" if node in negative else "number"))
    return found


def _docstring(node: ast.stmt) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant | ast.Yield)


def _type_hint(node: ast.BinOp) -> bool:
    return isinstance(node.op, ast.BitOr)


class Change(ast.NodeTransformer):
    def __init__(self, target: ast.AST, kind: str) -> None:
        self.target, self.kind = target, kind

    def visit(self, node: ast.AST) -> ast.AST:
        if node is not self.target:
            return self.generic_visit(node)
        if self.kind == "comparison":
            node.ops[0] = COMPARISONS[type(node.ops[0])]()
        elif self.kind == "operator":
            node.op = OPERATORS[type(node.op)]()
        elif self.kind == "sign":
            return node.operand
        elif self.kind == "and or":
            node.op = ast.Or() if isinstance(node.op, ast.And) else ast.And()
        elif self.kind == "condition":
            node.test = ast.UnaryOp(ast.Not(), node.test)
        elif self.kind == "left out":
            return ast.copy_location(ast.Pass(), node)
        elif self.kind == "negative number":
            node.value -= 1  # -1 as an index, an axis or a size becomes 0: -2 may mean the same
        else:
            node.value = node.value + 1 if node.value else 1
        return node


def _negative(node: ast.AST) -> bool:
    return isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub) and isinstance(node.operand, ast.Constant)


def named(file: Path) -> list[str]:
    """Every change of a file below src/cfem: the function, the kind, the line, and the part of it that changes."""
    source = (ROOT / "src/cfem" / file).read_text()
    tree, lines, found = ast.parse(source), source.splitlines(), []
    functions = [one for one in ast.walk(tree) if isinstance(one, ast.FunctionDef)]  # inner ones last
    for node, kind in changes(tree):
        within = [one.name for one in functions if one.lineno <= node.lineno <= one.end_lineno]
        part = " ".join((ast.get_source_segment(source, node) or "").split())
        place = f"{file}: {within[-1]}" if within else str(file)
        found.append(f"{place}: {kind}: {lines[node.lineno - 1].strip()}" + (f" [{part}]" if len(part) < 60 else ""))
    return found


def equivalent(every: set[str]) -> set[str]:
    """The changes that alter no answer; a line on stderr for each that the list names and that is no more."""
    known = {one["change"] for one in tomllib.loads(EQUIVALENT.read_text())["equivalent"]}
    for gone in sorted(known - every):
        print(f"{EQUIVALENT.name}: is no more: {gone}", file=sys.stderr)
    return known & every


def compiled_with(file: Path) -> set[Path]:
    """The files whose compiled code a change of this one can be part of: those that compile, it among them, and import
    it, one through the other."""
    texts = {one: one.read_text() for one in (ROOT / "src/cfem").rglob("*.py")}
    compile_some = {one: text for one, text in texts.items() if "@njit" in text}
    found = {ROOT / "src/cfem" / file} & set(compile_some)
    while True:
        names = {".".join(one.relative_to(ROOT / "src").with_suffix("").parts) for one in found}
        more = {one for one, text in compile_some.items() if any(f"{name} import" in text for name in names)}
        if more <= found:
            return found
        found |= more


def tests_of(file: Path, first: int, last: int, covering: CoveringTests) -> list[str]:
    """The tests that answer for these lines of a file below src/cfem: those of the record that run them, the nearest
    first, and the files that the record does not know: that of the same name and those that import the module. Where
    there are none of these, those that CORE names."""
    recorded = covering.of(file, first, last)
    known = {test.partition("::")[0] for test in covering.seconds}
    found = recorded + [one for one in importing(file) if one not in known]
    if found:
        return found
    named = next(paths for prefix, paths in CORE.items() if file.as_posix().startswith(prefix))
    folders = (sorted(folder.glob("test_*.py")) for folder in (ROOT / "tests" / file).parents)
    return named or [str(one.relative_to(ROOT)) for one in next(filter(None, folders))]


def importing(file: Path) -> list[str]:
    """The test file of the same name, and those that import the module, the nearest first."""
    folder, _, name = ".".join(("cfem", *file.with_suffix("").parts)).rpartition(".")
    wanted = re.compile(
        rf"^(from {re.escape(folder)}\.{name} import|import {re.escape(folder)}\.{name}\b)", re.MULTILINE
    )
    beside = Path("tests", file.parent, f"test_{file.name}")
    tests = [one.relative_to(ROOT) for one in sorted((ROOT / "tests").rglob("test_*.py"))]
    found = [one for one in tests if one == beside or wanted.search((ROOT / one).read_text())]
    return sorted(map(str, found), key=lambda test: (distance(file, test), test))


def changed_package(file: Path, index: int | None, place: Path) -> None:
    """A copy of the package in `place`, with one file changed, or none. Its kernels are compiled again."""
    tree = ast.parse((ROOT / "src/cfem" / file).read_text())
    changed = ast.unparse(
        tree if index is None else ast.fix_missing_locations(Change(*changes(tree)[index]).visit(tree))
    )
    stale = [f"{file.stem}.*.pyc", *(f"{one.stem}.*.nb?" for one in compiled_with(file))]
    shutil.copytree(ROOT / "src/cfem", place / "cfem", ignore=shutil.ignore_patterns(*stale))
    (place / "cfem" / file).write_text(changed)


def run_tests(package: Path, tests: list[str], seconds: float) -> int:
    """Exit status of pytest with the package below this folder, in a process of its own that has what it imports
    already; -1 where it took more than these seconds of the processor."""
    child = os.fork()
    if not child:
        status = 1
        try:
            resource.setrlimit(resource.RLIMIT_CPU, (int(seconds) + 1, int(seconds) + 5))
            os.chdir(ROOT)
            silent = os.open(os.devnull, os.O_WRONLY)
            os.dup2(silent, 1), os.dup2(silent, 2)
            sys.path[:0] = paths = [str(package), str(ROOT / "tests")]
            os.environ["PYTHONPATH"] = os.pathsep.join(paths)
            base = ["--basetemp", str(package / "temporary"), "-p", "no:cacheprovider"]
            imported = ["-W", "ignore::pytest.PytestAssertRewriteWarning"]  # before pytest could rewrite it
            status = int(pytest.main(["-x", "-q", "-n", "0", *imported, *base, *tests]))
        finally:
            os._exit(status)
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    return -1 if code < 0 else code


def attempt(file: Path, index: int, covering: CoveringTests, most: float) -> tuple[bool, list[str]]:
    """Whether a test noticed one change of a file below src/cfem, and the tests that were asked: the nearest that take
    `most` seconds together. A run of ten times their seconds, and a minute more, counts as noticed."""
    tree = ast.parse((ROOT / "src/cfem" / file).read_text())
    node = changes(tree)[index][0]
    asked, seconds = [], 0.0
    for test in tests_of(file, node.lineno, node.end_lineno, covering):
        seconds += covering.seconds.get(test, 0.0)
        if asked and seconds > most:
            break
        asked.append(test)
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as place:
        changed_package(file, index, Path(place))
        status = run_tests(Path(place), asked, 10 * min(seconds, most) + 60)
        if status in NOT_RUN:  # the change has renamed a case of theirs: all of their files then
            status = run_tests(Path(place), sorted({test.partition("::")[0] for test in asked}), 10 * most + 60)
    return status != 0, asked


def demand_green(file: Path, covering: CoveringTests) -> None:
    """Ends the program where tests that answer for a file fail though nothing was changed: all changes would count as
    caught."""
    tests = tests_of(file, 1, 10**6, covering)[:FEW]
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as place:
        changed_package(file, None, Path(place))
        status = run_tests(Path(place), tests, 600.0)
    if status:
        sys.exit(f"pytest ends with {status} though nothing was changed: {' '.join(tests)}")


def measured(folder: Path) -> None:
    """Records in a folder which tests run which lines, of all tests that `make test` runs."""
    shutil.rmtree(folder, ignore_errors=True)
    paths = [str(ROOT / "src"), str(ROOT / "scripts"), str(ROOT / "tests")]
    environment = os.environ | {"COVERING_TESTS": str(folder), "PYTHONPATH": os.pathsep.join(paths)}
    command = [sys.executable, "-m", "pytest", "-n", "auto", "--dist", "loadfile", "-p", "covering_tests"]
    subprocess.run(command, cwd=ROOT, env=environment)


def import_what_tests_import() -> None:
    """Imports what the package and its tests take from elsewhere, once for all changes."""
    names = "import sys, cfem.cli.app, cfem.control.stage, hypothesis; print(*sys.modules)"
    environment = os.environ | {"PYTHONPATH": str(ROOT / "src")}
    done = subprocess.run([sys.executable, "-c", names], env=environment, capture_output=True, text=True, check=True)
    for name in done.stdout.split():
        if name.partition(".")[0] not in ("cfem", "__main__"):
            with contextlib.suppress(Exception):
                importlib.import_module(name)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=60, help="changes to try")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", nargs="*", default=[""], help="files whose path begins so")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--least", type=float, default=0.9, help="share that has to be caught, else it exits with 1")
    parser.add_argument("--record", type=Path, default=ROOT / "build/covering-tests", help="which test runs which line")
    parser.add_argument("--most", type=float, default=120.0, help="seconds of tests that are asked about one change")
    arguments = parser.parse_args()
    os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"))
    if not arguments.record.exists():
        measured(arguments.record)
    covering = CoveringTests.read(arguments.record)
    import_what_tests_import()
    files = [each.relative_to(ROOT / "src/cfem") for each in sorted((ROOT / "src/cfem").rglob("*.py"))]
    files = [each for each in files if each.as_posix().startswith(tuple(CORE))]
    what = {(file, i): change for file in files for i, change in enumerate(named(file))}
    known = equivalent(set(what.values()))
    every = [one for one in what if what[one] not in known and one[0].as_posix().startswith(tuple(arguments.only))]
    chosen = random.Random(arguments.seed).sample(every, min(arguments.count, len(every)))

    for package in {file.parts[0]: file for file, _ in chosen}.values():
        demand_green(package, covering)

    def tried(one: tuple[Path, int]) -> bool:
        caught, asked = attempt(*one, covering, arguments.most)
        verdict = "caught" if caught else "MISSED"
        print(verdict, what[one], f"({len(asked)} tests)", file=sys.stderr, flush=True)
        return caught

    with ThreadPoolExecutor(arguments.jobs) as pool:
        caught = dict(zip(chosen, pool.map(tried, chosen), strict=True))
    print(f"{sum(caught.values())} of {len(caught)} changes caught, of {len(every)} possible ones")
    tries, finds = Counter(one[0].parts[0] for one in chosen), Counter(one[0].parts[0] for one in chosen if caught[one])
    print(*(f"{package}: {finds[package]} of {tries[package]}" for package in sorted(tries)), sep="\n")
    print(*(f"  missed: {what[one]}" for one in chosen if not caught[one]), sep="\n")
    if sum(caught.values()) < arguments.least * len(caught):
        sys.exit(f"fewer than {arguments.least:.0%} were caught")


if __name__ == "__main__":
    main()
