"""`cfem run`: what is stale of a robot's results, and why; each stage that is stale, run in order."""

import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from cfem.core.artefact.chain import NOT_MADE, stage_module, stale
from cfem.core.artefact.judgement import KEY
from cfem.core.artefact.manifest import read_manifest
from cfem.core.console.progress import say
from cfem.core.console.terminal import printable
from cfem.core.errors import GateError, SpecError
from cfem.core.kinds import KINDS
from cfem.core.stage import Options
from cfem.pipeline.plan import Step, kind_named, kind_of, own_specs, plan
from cfem.pipeline.quick import quick_steps

WAITS = "waits for"
FIGURES = ("control", "calibrate", "design")  # kinds whose headlines are what all the others are for


def run(
    places: Sequence[Path],
    overrides: Sequence[str],
    options: Options,
    until: str | None = None,
    only: str | None = None,
    line: Callable[[int, Sequence[Step], Sequence[str]], str] | None = None,
    workers: int | None = None,
    quick: bool = False,
) -> dict[str, Any]:
    """Runs specs, and what they read first, wherever a spec beside them makes it.

    Returns what a stage returns; results: stages (stage, spec, out, status, why, seconds), judgement, headline. Raises
    GateError under `check` where a stage is stale; SpecError before the first stage where specs do not fit each other.

    places: folders, of which the specs without a suffix are run, and specs
    overrides: 'train.samples=20', by the spec's name
    options: `force` runs nothing that is up to date: it lets samples and hardware's runs of other inputs be moved aside
    line: what to print before a step, by its number, all steps and why it is to be run
    workers: processes that solve samples, one per core where None
    quick: a coarse answer, in folders of its own"""
    steps = _steps(places, overrides, until, only)
    steps = quick_steps(steps) if quick else steps
    for step in steps:
        step.stage.demand_agreement()
    begin, line = time.perf_counter(), line or _line
    finished: list[dict[str, Any]] = []
    for number, step in enumerate(steps):
        before = {entry_done["spec"] for entry_done in finished if entry_done["status"] == "stale"}
        why = _why(step, before)
        status = "up to date" if not why else "stale" if options.check else "running"
        if not options.quiet:
            say(printable(line(number, steps, why)))
        manifest = _run(step, options, workers) if status == "running" else {}
        entry = {"stage": step.command, "spec": str(step.spec), "out": str(step.stage.out)}
        finished.append(
            entry | {"status": manifest.get("status", status), "why": why, "seconds": manifest.get("seconds")}
        )
    n_stale = sum(stage_done["status"] == "stale" for stage_done in finished)
    if n_stale:
        what = f"{n_stale} of {len(finished)} stages are stale"
        raise GateError(what, do=f"cfem run {' '.join(map(str, places))}{' --quick' * quick}")
    status = "done" if any(entry_done["status"] == "done" for entry_done in finished) else "up to date"
    results = {**_figures(steps), "stages": finished}
    return {"stage": "run", "status": status, "results": results, "seconds": time.perf_counter() - begin}


def _steps(places: Sequence[Path], overrides: Sequence[str], until: str | None, only: str | None) -> list[Step]:
    """Steps of these places, cut by `until` and `only`."""
    goals = [spec for place in places for spec in (own_specs(place) if place.is_dir() else [place])]
    kinds = list(KINDS)
    if until is not None:
        last = kinds.index(kind_named(until))
        goals = [goal for goal in goals if kind_of(goal) is None or kinds.index(kind_of(goal)) <= last]
    if only is not None:
        goals = [goal for goal in goals if kind_of(goal) == kind_named(only)]
    if not goals:
        raise SpecError(
            "no spec is left to run", where="--only" if only else "--until", do="name a stage that is there"
        )
    return plan(goals, _by_spec(goals, overrides), follow=only is None)


def _by_spec(goals: Sequence[Path], overrides: Sequence[str]) -> dict[Path, list[str]]:
    """Overrides by spec: 'train.samples=20' is 'samples=20' of train.yaml."""
    by_spec: dict[Path, list[str]] = {}
    for text in overrides:
        name, _, rest = text.partition(".")
        named = [goal for goal in goals if goal.stem == name]
        if not named or not rest:
            names = ", ".join(dict.fromkeys(goal.stem for goal in goals))
            raise SpecError(f"'{text}' names none of the specs {names}", where="--set", do="use SPEC.key=value")
        if kind_of(named[0]) == "scene":
            what = f"'{text}' would change the mesh alone: every stage reads the scene again"
            raise SpecError(what, where="--set", do=f"edit {named[0]}")
        for goal in named:
            by_spec.setdefault(goal, []).append(rest)
    return by_spec


def _why(step: Step, stale_specs: set[str]) -> list[str]:
    """Reasons why the step is to be run; nothing where it is not."""
    above = [str(spec) for spec in step.needs if str(spec) in stale_specs]
    if above:
        return [f"{WAITS} {', '.join(above)}"]
    return stale(step.stage)


def _line(number: int, steps: Sequence[Step], why: Sequence[str]) -> str:
    step, width = steps[number], max(len(each_step.command) for each_step in steps)
    compared = why and why[0] != NOT_MADE and not why[0].startswith(WAITS)
    reason = f"stale: {'; '.join(why)}" if compared else why[0] if why else "up to date"
    return f"{step.command:<{width}}  {step.spec}  {reason}"


def _run(step: Step, options: Options, workers: int | None) -> Mapping[str, Any]:
    more: dict[str, Any] = {}
    if step.kind == "sample":
        from cfem.active_learning.fill import fill

        more = {"fill": fill, "workers": workers, "quick": step.quick}
    return stage_module(step.kind).run(step.spec, step.stage.overrides, None, options, **more)


def _figures(steps: Sequence[Step]) -> dict[str, Any]:
    """Results of a pipeline. judgement: of all stages; headline: of control, calibration and design, or of the last
    stage that has one, and where the pages are; pages: of reports; moved: beside these, the pages in which the reader
    moves the robot."""
    results = [(step, read_manifest(step.stage.out)["results"]) for step in steps]
    headlines = [(step, result["headline"]) for step, result in results if result.get("headline")]
    chosen = [(step, lines) for step, lines in headlines if step.kind in FIGURES] or headlines[-1:]
    several = len(chosen) > 1
    lines = [line for step, headline in chosen for line in ([f"{step.spec}:", *headline] if several else headline)]
    pages = [str((step.stage.out / result["page"]).resolve()) for step, result in results if result.get("page")]
    moved = [str((step.stage.out / result["moved"]).resolve()) for step, result in results if result.get("moved")]
    judged = {judged["what"]: judged for _, result in reversed(results) for judged in reversed(result.get(KEY, []))}
    return ({KEY: list(reversed(judged.values()))} if judged else {}) | {
        "headline": [*lines, *(f"report: {page}" for page in pages), *(f"robot to move: {page}" for page in moved)],
        "pages": pages,
        "moved": moved,
    }
