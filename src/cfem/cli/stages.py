"""The commands that run one stage each."""

from collections.abc import Callable
from functools import partial
from importlib import import_module
from inspect import Parameter, Signature, signature
from pathlib import Path
from typing import Annotated, Any

import typer

from cfem.cli.options import Check, Force, Json, Out, Quiet, Set, Spec, Strict, Workers
from cfem.cli.run import run_command

_SAMPLE = "Solve many states of the robot by finite elements and store them. Resumes an interrupted run."


def add_stages(app: typer.Typer) -> None:
    """Adds them to the program."""
    model = "Write a model as arrays, ONNX, TorchScript, C or a page, and compare each with the original."
    found = "Predict other load cases of a calibrated robot, with intervals; with errors where they were measured."
    for name, run, summary in (
        ("mesh", _plain("robot"), "Mesh a scene and check the quality of the mesh."),
        ("sample", _sample, _SAMPLE),
        ("merge", _merge, "Join the parts that `sample --shard` solved into one dataset."),
        ("train", _plain("surrogate"), "Fit a small model to the samples, and measure its error on test states."),
        ("export", _plain("export"), model),
        ("control", _plain("control"), "Follow trajectories with a model; the finite-element robot is the judge."),
        ("simulate", _plain("motion"), "Move a model by commands over time; full finite elements beside it."),
        ("calibrate", _plain("calibrate"), "Find parameters of a robot from measurements, with confidence intervals."),
        ("estimate", _plain("estimation"), "Find the state of a robot, and forces on it, from recorded markers."),
        ("measurements", _plain("measurements"), "Turn recordings of camera systems into a table of load cases."),
        ("calibrate-cases", _plain("cases"), "Find parameters of a robot and its rig from measured load cases."),
        ("predict-cases", _plain("cases.prediction"), found),
        ("optimize-design", _plain("design"), "Find the best designs, and check them by finite elements."),
        ("report", _plain("report"), "Make one HTML page of the results."),
    ):
        _stage(app, name, run, summary)
    _stage(app, "simulate-sample", _sample, _SAMPLE, hidden=True)


def _every_stage(
    set_: Set = None,
    out: Out = None,
    force: Force = False,
    check: Check = False,
    strict: Strict = False,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """The options of every stage."""


def _stage(app: typer.Typer, name: str, run: Callable[..., Any], summary: str, hidden: bool = False) -> None:
    """Registers `run(spec, ..., set_=, out=, options=)`, with the options of every stage beside its own."""

    def command(set_, out, force, check, strict, json, quiet, **own) -> None:
        work = partial(run, **own, set_=set_ or [], out=out)
        run_command(lambda options: work(options=options), force, check, json, quiet, strict, name)

    given = ("set_", "out", "options")
    own = [one for name, one in signature(run).parameters.items() if name not in given]
    common = list(signature(_every_stage).parameters.values())
    command.__signature__ = Signature([one.replace(kind=Parameter.KEYWORD_ONLY) for one in (*own, *common)])
    command.__annotations__ = {one.name: one.annotation for one in (*own, *common)}
    app.command(name, help=summary, hidden=hidden)(command)


def _plain(package: str) -> Callable[..., Any]:
    """The stage of a package that has no options of its own."""

    def run(spec: Spec, set_, out, options):
        return import_module(f"cfem.{package}.stage").run(spec, set_, out, options)

    return run


def _sample(
    spec: Spec,
    set_,
    out,
    options,
    workers: Workers = None,
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="Let the workers of this Dask scheduler solve: tcp://host:8786."),
    ] = None,
    timeout: Annotated[
        float,
        typer.Option(min=1, metavar="SECONDS", help="Replace the workers when none finishes a shard for so long."),
    ] = 3600,
    shard: Annotated[
        str | None, typer.Option(metavar="I/N", help="Solve only the I-th of N parts; `cfem merge` joins them.")
    ] = None,
    until_error: Annotated[
        str | None,
        typer.Option(metavar="LENGTH", help="Add states where the model is worst, until its error is below LENGTH."),
    ] = None,
    around: Annotated[
        Path | None,
        typer.Option(metavar="TASK", help="Add states to the dataset where this run of `cfem control` went."),
    ] = None,
):
    overrides = [*set_, *([f"until.error={until_error}"] if until_error else [])]
    overrides += [f"around.task={around.resolve()}"] if around else []

    def fill(*arguments):
        return import_module("cfem.active_learning.fill").fill(*arguments)

    solve = import_module("cfem.sample.stage").run
    how = {"workers": workers, "scheduler": scheduler, "timeout": timeout, "shard": shard}
    return solve(spec, overrides, out, options, fill=fill, **how)


def _merge(
    spec: Annotated[Path, typer.Argument(help="The sample.yaml of the parts.")],
    set_,
    out,
    options,
    parts: Annotated[
        list[Path] | None, typer.Argument(help="Folders of all parts. Default: those beside the output folder.")
    ] = None,
):
    return import_module("cfem.sample.stage").merge(spec, set_, out, options, parts or [])
