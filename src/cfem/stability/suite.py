"""Runs cases and says which misbehave."""

import time
import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path

from cfem.core.console.progress import progress
from cfem.core.errors import NumericalError, SpecError
from cfem.stability.case import Case
from cfem.stability.evidence import Evidence, Examinable, error_misbehaviours, misbehaviours
from cfem.stability.families import built_in


@dataclass(frozen=True)
class Result:
    """Result of one case.

    evidence: None where an error was raised, which `raised` names
    wrong: one sentence each, none where the case is right
    seconds: of making the body and solving, checks left out"""

    case: Case
    evidence: Evidence | None
    raised: str | None
    wrong: tuple[str, ...]
    seconds: float

    @property
    def status(self) -> str:
        return self.raised if self.evidence is None else self.evidence.status


def chosen(cases: Iterable[Case], only: str | None = None, heavy: bool = False) -> list[Case]:
    """Cases whose name fits the pattern; heavy ones only where asked for."""
    return [case for case in cases if (heavy or not case.heavy) and (only is None or fnmatchcase(case.name, only))]


def run(case: Case) -> Result:
    """Never raises, whatever the case does."""
    begin = time.perf_counter()
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        try:
            trial = case.attempt()
        except (KeyboardInterrupt, SystemExit):
            raise
        except BaseException as error:  # compiled libraries raise panics that are no Exception
            seconds = time.perf_counter() - begin
            return Result(case, None, type(error).__name__, tuple(error_misbehaviours(case, error)), seconds)
        seconds = time.perf_counter() - begin
    if not isinstance(trial, Examinable):
        wrong = (f"{case.expect} was due, and it made {type(trial).__name__}",)
        return Result(case, None, "nothing", wrong, seconds)
    try:
        evidence = trial.evidence()
        wrong = misbehaviours(case, evidence)
    except Exception as error:
        wrong = [f"the answer cannot be examined: {type(error).__name__}: {error}"]
        return Result(case, None, "unexamined", tuple(wrong), seconds)
    wrong += [f"warns: {text}" for text in sorted({str(warning.message) for warning in warned})]
    if case.expect.also is not None and (sentence := case.expect.also(trial)) is not None:
        wrong.append(sentence)
    return Result(case, evidence, None, tuple(wrong), seconds)


def run_all(cases: Sequence[Case]) -> list[Result]:
    results = []
    with progress("cases", len(cases)) as advance:
        for case in cases:
            results.append(run(case))
            advance(1)
    return results


def misbehaving(results: Iterable[Result]) -> list[Result]:
    return [result for result in results if result.wrong]


def demand_right(results: Sequence[Result]) -> None:
    """Raises NumericalError, naming the cases that misbehave."""
    bad = [result.case.name for result in misbehaving(results)]
    if bad:
        shown = "; ".join(bad[:5]) + ("; ..." if len(bad) > 5 else "")
        raise NumericalError(f"{len(bad)} of {len(results)} cases misbehave: {shown}", do="the table says how")


def select(scene: Path | None = None, only: str | None = None, heavy: bool = False) -> list[Case]:
    """Cases on built-in bodies, and on the scene's own mesh where one is given, whose names fit the pattern.

    Raises InputError where the scene or its mesh is missing, SpecError where no case is left."""
    cases = built_in()
    if scene is not None:
        from cfem.robot.load import load_scene_and_mesh
        from cfem.stability.families import scene as family

        cases += family.cases(*load_scene_and_mesh(scene))
    left = chosen(cases, only, heavy)
    if not left:
        raise SpecError(f"no case matches '{only}'", do="cfem stability --list names them")
    return left
