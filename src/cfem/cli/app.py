"""`cfem`: one command a stage, each reading its YAML spec and making one artefact folder."""

from collections.abc import Callable
from functools import partial
from importlib import import_module
from inspect import Parameter, Signature, signature
from pathlib import Path
from typing import Annotated, Any

import typer

from cfem import __version__
from cfem.cli.run import run_command
from cfem.core.errors import EXIT_CODES

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    help="Condensed finite-element models of soft robots: mesh, sample, train, export, control, calibrate, optimize.",
    epilog="Exit codes: " + "; ".join(f"{code} {meaning}" for code, meaning in EXIT_CODES.items()) + ".",
)

Spec = Annotated[Path, typer.Argument(help="The stage's YAML spec.")]
Set = Annotated[list[str] | None, typer.Option("--set", metavar="KEY.SUB=VALUE", help="Override a value of the spec.")]
Out = Annotated[Path | None, typer.Option("--out", help="Artefact folder, in place of the spec's.")]
Force = Annotated[bool, typer.Option("--force", help="Run even if up to date, and replace what is there.")]
Check = Annotated[bool, typer.Option("--check", help="Run nothing; exit 5 if the output is stale.")]
Strict = Annotated[bool, typer.Option("--strict", help="Exit 4 where the result is poor: nobody should trust it.")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object.")]
Quiet = Annotated[bool, typer.Option("--quiet", help="No progress.")]
Workers = Annotated[int | None, typer.Option("--workers", min=1, help="Local processes; default: one a core.")]


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


def _stage(run: Callable[..., Any], summary: str, *names: str) -> None:
    """Registers `run(spec, ..., set_=, out=, options=)` under every name, with the options of every stage beside its
    own."""

    def command(set_, out, force, check, strict, json, quiet, **own) -> None:
        work = partial(run, **own, set_=set_ or [], out=out)
        run_command(lambda options: work(options=options), force, check, json, quiet, strict)

    given = ("set_", "out", "options")
    own = [one for name, one in signature(run).parameters.items() if name not in given]
    common = list(signature(_every_stage).parameters.values())
    command.__signature__ = Signature([one.replace(kind=Parameter.KEYWORD_ONLY) for one in (*own, *common)])
    command.__annotations__ = {one.name: one.annotation for one in (*own, *common)}
    for name in names:
        app.command(name, help=summary)(command)


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
        str | None, typer.Option(metavar="ADDRESS", help="Of a Dask scheduler, whose workers solve: tcp://host:8786.")
    ] = None,
    timeout: Annotated[
        float, typer.Option(min=1, metavar="SECONDS", help="Replace the workers when none ends a shard for so long.")
    ] = 3600,
    shard: Annotated[
        str | None, typer.Option(metavar="I/N", help="Solve the I-th of N parts alone; `cfem merge` joins them.")
    ] = None,
    until_error: Annotated[
        str | None, typer.Option(metavar="LENGTH", help="Add states where the model errs, until it errs less.")
    ] = None,
):
    overrides = [*set_, *([f"until.error={until_error}"] if until_error else [])]

    def fill(*arguments):
        return import_module("cfem.active.fill").fill(*arguments)

    solve = import_module("cfem.sample.stage").run
    how = {"workers": workers, "scheduler": scheduler, "timeout": timeout, "shard": shard}
    return solve(spec, overrides, out, options, fill=fill, **how)


def _merge(
    spec: Annotated[Path, typer.Argument(help="The sampling spec that the parts were made from.")],
    set_,
    out,
    options,
    parts: Annotated[list[Path] | None, typer.Argument(help="Folders of all parts; default: those beside OUT.")] = None,
):
    return import_module("cfem.sample.stage").merge(spec, set_, out, options, parts or [])


_stage(_plain("robot"), "Make the mesh of a scene, with named sets and quality figures.", "mesh")
_SAMPLE = "Solve the planned equilibria: FE states with W and delta_free, to Parquet. Resumes what was interrupted."
_stage(_sample, _SAMPLE, "simulate-sample")
_stage(_sample, "The same as simulate-sample.", "sample")
_stage(_merge, "Join the parts of simulate-sample --shard to the dataset that one machine would have made.", "merge")
_stage(_plain("surrogate"), "Fit a condensed model to a dataset; errors on its test set.", "train")
_stage(_plain("export"), "Write a model as plain arrays, ONNX and TorchScript, parity measured.", "export")
_stage(_plain("control"), "Follow trajectories by inverse control, in the FE plant.", "control")
_stage(_plain("calibrate"), "Find parameters of the robot from measurements, with intervals.", "calibrate")
_stage(_plain("design"), "Find the best designs: grid, gradients, trade-offs, checked by FE.", "optimize-design")
_stage(_plain("report"), "One self-contained HTML page: pictures, errors against run time, provenance.", "report")


@app.command()
def init(
    name: Annotated[str, typer.Argument(help="Of the new scene: small letters, digits and hyphens.")],
    source: Annotated[Path, typer.Option("--from", help="Its shape: .step .stp, closed .stl, or .vtu .vtk .msh.")],
    unit: Annotated[
        str | None, typer.Option(help="Of the numbers in an .stl or mesh file: 'mm', 'm', '25.4 mm'.")
    ] = None,
    cells: Annotated[str | None, typer.Option(help="About how many tetrahedra to make.")] = None,
    fixed: Annotated[
        str | None, typer.Option(help="'z <= 5 mm', bottom, top, left, right, front, back, a set.")
    ] = None,
    young: Annotated[str | None, typer.Option(help="Young's modulus: '500 kPa'.")] = None,
    poisson: Annotated[str | None, typer.Option(help="Poisson's ratio, at most 0.4999.")] = None,
    cable: Annotated[
        list[str] | None, typer.Option(help="'NAME: pull point; point; ...', points 'x, y, z' in mm. Repeatable.")
    ] = None,
    cables: Annotated[str | None, typer.Option(help="How many to place along the body, at equal angles.")] = None,
    reach: Annotated[str | None, typer.Option(help="Largest shortening of each cable: '10 mm'.")] = None,
    effector: Annotated[str | None, typer.Option(help="The watched point: 'x, y, z' in mm.")] = None,
    folder: Annotated[Path, typer.Option(help="Where scenes are.")] = Path("pipelines"),
    force: Annotated[bool, typer.Option("--force", help="Replace the files of a scene that is there.")] = False,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """A new scene from a STEP, STL or mesh file; what no option says is asked, or guessed where nobody can be asked."""

    def work(options):
        from cfem.cli.init import init_scene

        given = {"unit": unit, "cells": cells, "fixed": fixed, "young": young, "poisson": poisson}
        given |= {"cables": cables, "reach": reach, "effector": effector}
        return init_scene(name, source, folder, given, cable or [], options.force, quiet, json)

    run_command(work, force=force, as_json=json, quiet=quiet)


@app.command()
def inspect(
    artefact: Annotated[Path, typer.Argument(help="A mesh, dataset, model, control or report folder.")],
    json: Json = False,
) -> None:
    """Print what an artefact holds: origin, rows, units, statistics, errors."""
    from cfem.cli.inspect import describe

    run_command(lambda _: describe(artefact, json), as_json=json)


@app.command()
def verify(
    folders: Annotated[
        list[Path] | None, typer.Argument(help="Artefacts, or folders of them; default: data, models.")
    ] = None,
    json: Json = False,
) -> None:
    """Check every byte of artefacts against their manifests; exit 3 if anything is damaged, missing or foreign."""
    from cfem.cli.verify import demand_whole, verify_folders

    found = []
    run_command(lambda _: verify_folders(folders or [], json, found), as_json=json)
    if any(one.damage for one in found):
        run_command(lambda _: demand_whole(found))


@app.command()
def stability(
    scene: Annotated[Path | None, typer.Argument(help="A scene whose mesh is made: its cases run too.")] = None,
    only: Annotated[str | None, typer.Option("--only", metavar="PATTERN", help="Cases by name: 'cables/*'.")] = None,
    list_: Annotated[bool, typer.Option("--list", help="Print the names of the cases, and run none.")] = False,
    heavy: Annotated[bool, typer.Option("--heavy", help="With the body of 1e5 tetrahedra.")] = False,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Try stiff and extreme cases; exit 4 if any ends neither converged nor with its cause named."""
    from cfem.stability import command, suite, table

    results = []

    def work(options):
        cases = command.select(scene, only, heavy)
        if list_:
            names = [case.name for case in cases]
            return {"cases": names} if json else "\n".join(names)
        results.extend(command.run_cases(cases, options.quiet))
        return table.as_data(results) if json else table.as_text(results)

    run_command(work, as_json=json, quiet=quiet)
    if suite.misbehaving(results):
        run_command(lambda _: suite.demand_right(results))


@app.command()
def schema(
    out: Annotated[Path, typer.Option("--out", help="Folder for one <stage>.json each.")] = Path("schemas"),
    check: Annotated[bool, typer.Option("--check", help="Exit 5 if the files differ from the specs.")] = False,
) -> None:
    """Write the JSON Schemas (draft-07) of all specs, for editors."""
    from cfem.cli.schemas import write_schemas

    run_command(lambda _: write_schemas(out, check))


@app.command()
def summary(
    folders: Annotated[list[Path], typer.Argument(help="Artefact folders, in the order to be listed.")],
) -> None:
    """One line an artefact: its stage, seconds and main figures."""
    from cfem.cli.inspect import summarise

    run_command(lambda _: summarise(folders))


def _version(wanted: bool) -> None:
    if wanted:
        print(__version__)
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    pass


def main() -> None:
    """Entry point of the `cfem` script."""
    app()
