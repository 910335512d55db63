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
from cfem.core.kinds import FORMER

# By command: what it does; what it reads and writes, with an example where a robot that comes with cfem has one.
_HELP = {
    "mesh": (
        "Mesh a robot and check the quality of the mesh.",
        "Reads a scene.yaml. Writes a mesh that ParaView opens.",
        "soft-finger/scene.yaml",
    ),
    "sample": (
        "Solve many states of the robot by finite elements and store them. Resumes an interrupted run.",
        "Reads a sample.yaml and a mesh. Writes a Parquet dataset, one state per row. Also: `cfem simulate-sample`.",
        "soft-finger/sample.yaml --workers 4",
    ),
    "merge": (
        "Join the parts that `sample --shard` solved into one dataset.",
        "Reads the sample.yaml of the parts and their folders. Writes a dataset.",
        "soft-finger/sample.yaml",
    ),
    "train": (
        "Fit a small model to the samples, and measure its error on test states.",
        "Reads a train.yaml and a dataset. Writes a model.",
        "soft-finger/train.yaml",
    ),
    "export": (
        "Write a model as arrays, ONNX, TorchScript, C or a page, and compare each with the original.",
        "Reads an export.yaml and a model. Writes a folder with the formats that the spec names.",
        "soft-finger/export.yaml",
    ),
    "control": (
        "Follow trajectories with a learned model, and measure the error on the finite-element robot.",
        "Reads a control.yaml, a scene and models. Writes what was commanded and reached, goal by goal.",
        "soft-finger/control.yaml",
    ),
    "simulate": (
        "Simulate how a learned model moves under commands over time, beside full finite elements if asked.",
        "Reads a simulate.yaml and a model that has learned to move. Writes the motion, time by time.",
        "moving-finger/simulate.yaml",
    ),
    "calibrate": (
        "Find parameters of a robot from measurements, with confidence intervals.",
        "Reads a calibrate.yaml, a model with parameters and a table of measured states.",
        "parametric-finger/calibrate.yaml",
    ),
    "estimate": (
        "Find the shape of a robot, and the forces on it, from recorded markers.",
        "Reads an estimate.yaml, a model and a recording. Writes the state of each sample.",
        "",
    ),
    "measurements": (
        "Turn recordings of camera systems into load cases.",
        "Reads a measurements.yaml and the recordings. Writes a table of load cases.",
        "",
    ),
    "calibrate-cases": (
        "Find parameters of a robot and of its test rig from measured load cases.",
        "Reads a cases.yaml, a scene and a table of load cases.",
        "measured-beam/cases.yaml",
    ),
    "predict-cases": (
        "Predict load cases of a calibrated robot, with intervals, and with errors where there are measurements.",
        "Reads a predict.yaml and the result of calibrate-cases.",
        "measured-beam/predict.yaml",
    ),
    "optimize-design": (
        "Find the best designs, and check them by finite elements.",
        "Reads a design.yaml and a model of many designs. Writes the designs, tables and figures.",
        "parametric-finger/design.yaml",
    ),
    "report": (
        "Make one HTML page of the results.",
        "Reads a report.yaml and the folders that it names. Writes report.html.",
        "soft-finger/report.yaml",
    ),
}


def add_stages(app: typer.Typer) -> None:
    """Adds them to the program."""
    for name, run in (
        ("mesh", _plain("scene")),
        ("sample", _sample),
        ("merge", _merge),
        ("train", _plain("train")),
        ("export", _plain("export")),
        ("control", _plain("control")),
        ("simulate", _plain("simulate")),
        ("calibrate", _plain("calibrate")),
        ("estimate", _plain("estimate")),
        ("measurements", _plain("measurements")),
        ("calibrate-cases", _plain("cases")),
        ("predict-cases", _plain("predict")),
        ("optimize-design", _plain("design")),
        ("report", _plain("report")),
    ):
        _stage(app, name, run)
    _stage(app, "sample", _sample, FORMER["sample"])


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


def _stage(app: typer.Typer, name: str, run: Callable[..., Any], alias: str = "") -> None:
    """Registers `run(spec, ..., set_=, out=, options=)`, with the options of every stage beside its own. alias: another
    word for the command, not listed, under which it is registered if given."""
    summary, files, example = _HELP[name]

    def command(set_, out, force, check, strict, json, quiet, **specific) -> None:
        work = partial(run, **specific, set_=set_ or [], out=out)
        run_command(lambda options: work(options=options), force, check, json, quiet, strict, name)

    given = ("set_", "out", "options")
    specific = [option for name, option in signature(run).parameters.items() if name not in given]
    options = [*specific, *signature(_every_stage).parameters.values()]
    command.__signature__ = Signature([option.replace(kind=Parameter.KEYWORD_ONLY) for option in options])
    command.__annotations__ = {option.name: option.annotation for option in options}
    example = f" Example: cfem {name} pipelines/{example}" if example else ""
    app.command(alias or name, help=summary, epilog=files + example, hidden=bool(alias))(command)


def _plain(kind: str) -> Callable[..., Any]:
    """The stage that reads a kind of spec (`core.kinds`) and has no options of its own."""

    def run(spec: Spec, set_, out, options):
        from cfem.core.artefact.chain import stage_module

        return stage_module(kind).run(spec, set_, out, options)

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
    """Samples a scene, as the stage or, with --scheduler or --shard, in parts."""
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
    """Joins the parts of a dataset."""
    return import_module("cfem.sample.stage").merge(spec, set_, out, options, parts or [])
