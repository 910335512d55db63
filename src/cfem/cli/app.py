"""`cfem`: one command a stage, each reading its YAML spec and making one artefact folder."""

from collections.abc import Callable
from functools import partial
from importlib import import_module
from inspect import Parameter, Signature, signature
from pathlib import Path
from typing import Annotated, Any

import typer

from cfem import __version__
from cfem.cli.help import Commands
from cfem.cli.run import run_command
from cfem.core.errors import SpecError

app = typer.Typer(
    cls=Commands,
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Condensed finite-element models of soft robots: mesh, sample, train, export, control, calibrate, optimize.",
)

Spec = Annotated[Path, typer.Argument(help="The stage's YAML spec.")]
Set = Annotated[list[str] | None, typer.Option("--set", metavar="KEY.SUB=VALUE", help="Override a value of the spec.")]
Out = Annotated[Path | None, typer.Option("--out", help="Output folder, instead of the spec's.")]
Force = Annotated[bool, typer.Option("--force", help="Run even if up to date, and replace what is there.")]
Check = Annotated[bool, typer.Option("--check", help="Run nothing; exit 5 if the output is stale.")]
Strict = Annotated[bool, typer.Option("--strict", help="Exit 4 where the result is poor: nobody should trust it.")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object.")]
Quiet = Annotated[bool, typer.Option("--quiet", help="No progress.")]
Workers = Annotated[int | None, typer.Option("--workers", min=1, help="Local processes. Default: one per core.")]


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


def _stage(run: Callable[..., Any], summary: str, name: str, hidden: bool = False) -> None:
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
):
    overrides = [*set_, *([f"until.error={until_error}"] if until_error else [])]

    def fill(*arguments):
        return import_module("cfem.active.fill").fill(*arguments)

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


_stage(_plain("robot"), "Mesh a scene and check the quality of the mesh.", "mesh")
_SAMPLE = "Solve many states of the robot by finite elements and store them. Resumes an interrupted run."
_stage(_sample, _SAMPLE, "sample")
_stage(_sample, _SAMPLE, "simulate-sample", hidden=True)
_stage(_merge, "Join the parts that `sample --shard` solved into one dataset.", "merge")
_stage(_plain("surrogate"), "Fit a small model to the samples, and measure its error on test states.", "train")
_stage(
    _plain("export"), "Write a model as arrays, ONNX, TorchScript or C, and compare each with the original.", "export"
)
_stage(_plain("control"), "Follow trajectories with a model; the finite-element robot is the judge.", "control")
_stage(_plain("calibrate"), "Find parameters of a robot from measurements, with confidence intervals.", "calibrate")
_stage(_plain("measurements"), "Turn recordings of camera systems into a table of load cases.", "measurements")
_stage(_plain("cases"), "Find parameters of a robot and its rig from measured load cases.", "calibrate-cases")
_PREDICT = "Predict other load cases of a calibrated robot, with intervals; with errors where they were measured."
_stage(_plain("cases.prediction"), _PREDICT, "predict-cases")
_stage(_plain("design"), "Find the best designs, and check them by finite elements.", "optimize-design")
_stage(_plain("report"), "Make one HTML page of the results.", "report")


@app.command("run")
def run_pipeline(
    places: Annotated[list[Path], typer.Argument(metavar="FOLDER...", help="Folders of specs, or single specs.")],
    until: Annotated[str | None, typer.Option("--until", metavar="STAGE", help="The last stage to run.")] = None,
    only: Annotated[str | None, typer.Option("--only", metavar="STAGE", help="The one stage to run.")] = None,
    set_: Annotated[
        list[str] | None, typer.Option("--set", metavar="SPEC.KEY=VALUE", help="Override, as in train.samples=20.")
    ] = None,
    force: Force = False,
    check: Check = False,
    strict: Strict = False,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Run the stages of a folder that are stale, in order, and what they need; say why each is stale."""

    def work(options):
        return import_module("cfem.pipeline.run").run(places, set_ or [], options, until, only)

    run_command(work, force, check, json, quiet, strict, "run")


@app.command()
def demo(
    robot: Annotated[
        str, typer.Argument(help="Robot that comes with cfem, such as soft-finger or bar.")
    ] = "soft-finger",
    folder: Annotated[Path, typer.Option(help="Folder of all robots.")] = Path("pipelines"),
    force: Force = False,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """See a robot mesh, learn and follow a curve: all stages, three numbers and a page."""

    def work(options):
        from cfem.pipeline.demo import as_text, demo

        outcome = demo(robot, folder, options)
        return outcome if json else as_text(outcome)

    run_command(work, force, as_json=json, quiet=quiet, label="demo")


@app.command()
def init(
    name: Annotated[str, typer.Argument(help="Name of the new robot: small letters, digits and hyphens.")],
    source: Annotated[
        Path | None, typer.Option("--from", help="File with its shape: .step .stp, closed .stl, or .vtu .vtk .msh.")
    ] = None,
    robot: Annotated[str | None, typer.Option(help="Copy a robot that comes with cfem, instead of --from.")] = None,
    unit: Annotated[
        str | None, typer.Option(help="Unit of the numbers in an .stl or mesh file: 'mm', 'm', '25.4 mm'.")
    ] = None,
    cells: Annotated[str | None, typer.Option(help="About how many tetrahedra to make.")] = None,
    fixed: Annotated[
        str | None, typer.Option(help="What is held: 'z <= 5 mm', bottom, top, left, right, front, back, a set.")
    ] = None,
    young: Annotated[str | None, typer.Option(help="Young's modulus: '500 kPa'.")] = None,
    poisson: Annotated[str | None, typer.Option(help="Poisson's ratio, at most 0.4999.")] = None,
    cable: Annotated[
        list[str] | None,
        typer.Option(help="A cable: 'NAME: pull point; point; ...', each point 'x, y, z' in mm. Repeatable."),
    ] = None,
    cables: Annotated[
        str | None, typer.Option(help="How many cables to place along the body, at equal angles.")
    ] = None,
    reach: Annotated[str | None, typer.Option(help="Largest shortening of each cable: '10 mm'.")] = None,
    effector: Annotated[str | None, typer.Option(help="The watched point: 'x, y, z' in mm.")] = None,
    folder: Annotated[Path, typer.Option(help="Folder of all robots.")] = Path("pipelines"),
    force: Annotated[bool, typer.Option("--force", help="Replace the files of a scene that is there.")] = False,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Make the specs of a new robot from a STEP, STL or mesh file, or copy those of a robot that comes with cfem. Asks
    for what no option says."""

    def work(options):
        from cfem.cli.init import init_robot, init_scene

        given = {"unit": unit, "cells": cells, "fixed": fixed, "young": young, "poisson": poisson}
        given |= {"cables": cables, "reach": reach, "effector": effector}
        if (source is None) == (robot is None):
            raise SpecError("give --from FILE or --robot NAME, one of the two", where="init")
        if robot is not None:
            stated = [flag for flag, said in (given | {"cable": cable}).items() if said]
            return init_robot(name, robot, folder, stated, options.force, json)
        return init_scene(name, source, folder, given, cable or [], options.force, quiet, json)

    run_command(work, force=force, as_json=json, quiet=quiet)


@app.command()
def material(
    action: Annotated[str, typer.Argument(metavar="ACTION", help="list, show or fit.")],
    what: Annotated[
        str | None, typer.Argument(help="show: name of an elastomer. fit: table of a tensile test, .csv.")
    ] = None,
    biaxial: Annotated[Path | None, typer.Option(help="Table of an equibiaxial test of the same rubber.")] = None,
    planar: Annotated[Path | None, typer.Option(help="Table of a planar (pure shear) test of it.")] = None,
    length: Annotated[str | None, typer.Option(help="Gauge length at rest, where the table has extension.")] = None,
    area: Annotated[str | None, typer.Option(help="Section at rest, where it has force: '18 mm^2'.")] = None,
    up_to: Annotated[float | None, typer.Option(min=1.0, help="Largest stretch that is fitted.")] = None,
    slack: Annotated[bool, typer.Option("--slack", help="Find the strain at which the specimen is taut.")] = False,
    law: Annotated[str | None, typer.Option(help="Fit this law alone, such as yeoh-3 or ogden-2.")] = None,
    poisson: Annotated[float, typer.Option(help="Poisson's ratio that is written.")] = 0.499,
    out: Annotated[Path | None, typer.Option("--out", help="Folder for material.yaml, fit.json and fit.png.")] = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """List elastomers by name, show one, or fit a law of rubber to a tensile test of your own."""

    def work(options):
        from cfem.cli.material import run_material

        how = {
            "length": length,
            "area": area,
            "most": up_to,
            "slack": slack,
            "law": law,
            "poisson": poisson,
            "out": out,
        }
        return run_material(action, what, {"biaxial": biaxial, "planar": planar}, how, options.force, json)

    run_command(work, force=force, as_json=json, label="material")


@app.command()
def animate(
    control: Annotated[Path, typer.Argument(help="Folder that cfem control made.")],
    format_: Annotated[
        list[str] | None, typer.Option("--format", help="gif or paraview. Repeatable. Default: both.")
    ] = None,
    frames: Annotated[int, typer.Option(min=1, help="Largest number of shapes of the learned skin.")] = 60,
    learned: Annotated[
        bool, typer.Option("--learned", help="Animate the learned skin even where FE shapes were kept.")
    ] = False,
    out: Annotated[
        Path | None, typer.Option("--out", help="Output folder. Default: CONTROL-animation, beside the run.")
    ] = None,
    force: Force = False,
    check: Check = False,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Draw a control run as an animation, and as files for ParaView. Nothing is solved."""

    def work(options):
        formats = format_ or ["gif", "paraview"]
        if unknown := sorted(set(formats) - {"gif", "paraview"}):
            raise SpecError(f"'{unknown[0]}' is not known: gif and paraview are", where="animate --format")
        return import_module("cfem.report.animate").run(control, out, options, formats, frames, learned)

    run_command(work, force, check, json, quiet, label="animate")


@app.command()
def inspect(
    artefact: Annotated[Path, typer.Argument(help="A mesh, dataset, model, control or report folder.")],
    json: Json = False,
) -> None:
    """Print what an artefact holds: origin, rows, units, statistics, errors."""
    from cfem.cli.inspect import describe

    run_command(lambda _: describe(artefact, json), as_json=json)


@app.command("modes")
def natural_modes(
    model: Annotated[Path, typer.Argument(help="Folder of a trained model that moves.")],
    at: Annotated[
        list[str] | None, typer.Option("--at", metavar="MM,...", help="Displacements of the actuators. Repeatable.")
    ] = None,
    free: Annotated[bool, typer.Option("--free", help="Leave the actuators free instead of held.")] = False,
    count: Annotated[int, typer.Option("--count", min=1, max=12, help="How many modes.")] = 3,
    picture: Annotated[Path | None, typer.Option("--picture", help="Draw the frequencies into this file.")] = None,
    json: Json = False,
) -> None:
    """Print natural frequencies and damping of a model along its workspace."""

    def work(_):
        from cfem.cli.modes import as_text, modes

        results = modes(model, at or [], free, count, picture)
        return results if json else as_text(results)

    run_command(work, as_json=json)


@app.command()
def verify(
    folders: Annotated[
        list[Path] | None, typer.Argument(help="Artefacts, or folders of them. Default: data and models.")
    ] = None,
    json: Json = False,
) -> None:
    """Check every file of artefacts against its checksum. Exit 3 if one is damaged, missing or foreign."""
    from cfem.cli.verify import demand_whole, verify_folders

    found = []
    run_command(lambda _: verify_folders(folders or [], json, found), as_json=json, label="verify")
    if any(one.damage for one in found):
        run_command(lambda _: demand_whole(found))


@app.command()
def stability(
    scene: Annotated[Path | None, typer.Argument(help="A scene with a mesh, to try as well.")] = None,
    only: Annotated[
        str | None, typer.Option("--only", metavar="PATTERN", help="Only the cases with such a name: 'cables/*'.")
    ] = None,
    list_: Annotated[bool, typer.Option("--list", help="Print the names of the cases and run none.")] = False,
    heavy: Annotated[bool, typer.Option("--heavy", help="Include the body of 1e5 tetrahedra.")] = False,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Solve stiff and extreme cases. Exit 4 if one neither converges nor names the cause."""
    from cfem.stability import command, suite, table

    results = []

    def work(options):
        cases = command.select(scene, only, heavy)
        if list_:
            names = [case.name for case in cases]
            return {"cases": names} if json else "\n".join(names)
        results.extend(command.run_cases(cases))
        return table.as_data(results) if json else table.as_text(results)

    run_command(work, as_json=json, quiet=quiet, label="stability")
    if suite.misbehaving(results):
        run_command(lambda _: suite.demand_right(results))


@app.command()
def schema(
    out: Annotated[Path, typer.Option("--out", help="Folder for the files.")] = Path("schemas"),
    check: Annotated[bool, typer.Option("--check", help="Exit 5 if the files differ from the specs.")] = False,
) -> None:
    """Write the JSON Schemas of all specs, for editors."""
    from cfem.cli.schemas import write_schemas

    run_command(lambda _: write_schemas(out, check))


@app.command()
def summary(
    folders: Annotated[list[Path], typer.Argument(help="Artefact folders, in the order to be listed.")],
) -> None:
    """Print main results and run time of artefacts."""
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
