"""`cfem`: one command a stage, each reading its YAML spec and making one artefact folder."""

from importlib import import_module
from pathlib import Path
from typing import Annotated

import typer

from cfem.cli.help import App, Commands
from cfem.cli.look import add_looks
from cfem.cli.options import Check, Force, Json, MoveAside, Quiet, Strict, Workers
from cfem.cli.run import run_command
from cfem.cli.stages import add_stages
from cfem.core.errors import SpecError
from cfem.core.version import VERSION

app = App(
    cls=Commands,
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Learned finite-element models that control soft robots. Begin with `cfem demo`. The command of a stage reads "
    "one YAML file and writes one folder.",
)

add_stages(app)
add_looks(app)


@app.command("run")
def run_pipeline(
    places: Annotated[list[Path], typer.Argument(metavar="FOLDER", help="Folders of YAML files, or single files.")],
    until: Annotated[str | None, typer.Option("--until", metavar="STAGE", help="The last stage to run.")] = None,
    only: Annotated[str | None, typer.Option("--only", metavar="STAGE", help="The one stage to run.")] = None,
    set_: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="SPEC.KEY=VALUE", help="Replace a value of a YAML file, as in train.samples=20."),
    ] = None,
    workers: Workers = None,
    quick: Annotated[
        bool,
        typer.Option(
            "--quick",
            help="A coarse answer first, from few states and goals, in folders that end in -quick. The full run goes "
            "on from its states.",
        ),
    ] = False,
    force: MoveAside = False,
    check: Check = False,
    strict: Strict = False,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Run the stages of a folder that are not up to date, in order, and say why each of them runs."""

    def work(options):
        how = {"workers": workers, "quick": quick}
        return import_module("cfem.pipeline.run").run(places, set_ or [], options, until, only, **how)

    run_command(work, force, check, json, quiet, strict, "run")


@app.command()
def demo(
    robot: Annotated[
        str, typer.Argument(help="Robot that comes with cfem, such as soft-finger or bar.")
    ] = "soft-finger",
    folder: Annotated[Path, typer.Option(help="Folder of all robots.")] = Path("pipelines"),
    force: MoveAside = False,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """See a robot meshed, learned and led along a curve: all stages, three numbers and two pages."""

    def work(options):
        from cfem.pipeline.demo import as_text, demo

        outcome = demo(robot, folder, options)
        return outcome if json else as_text(outcome)

    run_command(work, force, as_json=json, quiet=quiet, label="demo")


@app.command()
def init(
    name: Annotated[str, typer.Argument(help="Name of the new robot: small letters, digits and hyphens.")],
    source: Annotated[
        Path | None,
        typer.Option(
            "--from",
            help="File with its shape: .step .brep, a surface (.stl .obj .3mf), or a mesh (.vtu .vtk .msh .inp).",
        ),
    ] = None,
    robot: Annotated[str | None, typer.Option(help="Copy a robot that comes with cfem, instead of --from.")] = None,
    unit: Annotated[
        str | None, typer.Option(help="Unit of the numbers in a file that states none: 'mm', 'm', '25.4 mm'.")
    ] = None,
    cells: Annotated[str | None, typer.Option(help="About how many tetrahedra to make.")] = None,
    fixed: Annotated[
        str | None,
        typer.Option(
            help="What is held: 'z <= 5 mm', bottom, top, left, right, front, back, or a set of the mesh; several "
            "with | between them."
        ),
    ] = None,
    young: Annotated[str | None, typer.Option(help="Young's modulus: '500 kPa'.")] = None,
    poisson: Annotated[str | None, typer.Option(help="Poisson's ratio, at most 0.4999.")] = None,
    cable: Annotated[
        list[str] | None,
        typer.Option(help="A cable: 'NAME: pull point; point; ...', each point 'x, y, z' in mm. Repeatable."),
    ] = None,
    cables: Annotated[
        str | None, typer.Option(help="How many cables to place: in channels, or along the body at equal angles.")
    ] = None,
    through_air: Annotated[
        str | None, typer.Option(help="Whether cables may cross the air between parts of the body: yes, no, auto.")
    ] = None,
    chamber: Annotated[
        list[str] | None,
        typer.Option(help="A chamber: 'NAME: x, y, z' inside it in mm, or 'NAME: FILE' of its surface. Repeatable."),
    ] = None,
    chambers: Annotated[str | None, typer.Option(help="Which closed inner surfaces are inflated: all or none.")] = None,
    reach: Annotated[str | None, typer.Option(help="Largest shortening of each cable: '10 mm'.")] = None,
    growth: Annotated[str | None, typer.Option(help="Largest growth of each chamber: '2 ml'.")] = None,
    remesh: Annotated[
        str | None, typer.Option(help="Whether to mesh the inside of a mesh file anew: yes or no.")
    ] = None,
    body: Annotated[
        str | None, typer.Option(help="Which of several bodies in a file of surfaces, the largest first: 1, 2, ...")
    ] = None,
    effector: Annotated[str | None, typer.Option(help="The watched point: 'x, y, z' in mm.")] = None,
    also: Annotated[
        str | None, typer.Option(help="What else to ask for: push, gravity, region, rigid, contact, symmetry, or none.")
    ] = None,
    push: Annotated[
        list[str] | None,
        typer.Option(help="A force that pushes: 'NAME: x, y, z; dx, dy, dz', place in mm and direction. Repeatable."),
    ] = None,
    travel: Annotated[str | None, typer.Option(help="Largest way of the points that are pushed: '10 mm'.")] = None,
    gravity: Annotated[str | None, typer.Option(help="Which way is down: -z, or 'x, y, z' in m/s^2.")] = None,
    density: Annotated[str | None, typer.Option(help="Density, under gravity: '1070 kg/m^3'.")] = None,
    region: Annotated[
        list[str] | None,
        typer.Option(help="Another material: 'z >= 5 mm: 2 MPa, 0.45', or a set of the mesh for z. Repeatable."),
    ] = None,
    rigid: Annotated[list[str] | None, typer.Option(help="A rigid part: 'z >= 5 mm'. Repeatable.")] = None,
    contact: Annotated[
        list[str] | None, typer.Option(help="A point that something may touch: 'NAME: x, y, z' in mm. Repeatable.")
    ] = None,
    symmetry: Annotated[
        str | None, typer.Option(help="Axis across which the body is its own mirror image: x, y or z (.step, .brep).")
    ] = None,
    folder: Annotated[Path, typer.Option(help="Folder of all robots.")] = Path("pipelines"),
    force: Annotated[bool, typer.Option("--force", help="Replace the files of a scene that is there.")] = False,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Make the YAML files of a new robot from a STEP, STL or mesh file, or copy those of a robot that comes with cfem.
    Asks for what no option states."""

    def work(options):
        from cfem.cli.init import init_robot, init_scene

        given = {"unit": unit, "cells": cells, "fixed": fixed, "young": young, "poisson": poisson}
        given |= {"cables": cables, "through-air": through_air, "chambers": chambers, "remesh": remesh}
        given |= {"reach": reach, "growth": growth, "effector": effector, "body": body}
        given |= {"also": also, "travel": travel, "gravity": gravity, "density": density, "symmetry": symmetry}
        several = {"push": push, "region": region, "rigid": rigid, "contact": contact}
        given |= {flag: " | ".join(said) if said else None for flag, said in several.items()}
        if (source is None) == (robot is None):
            raise SpecError("give --from FILE or --robot NAME, one of the two", where="init")
        if robot is not None:
            stated = [flag for flag, value in (given | {"cable": cable, "chamber": chamber}).items() if value]
            return init_robot(name, robot, folder, stated, options.force, json)
        return init_scene(name, source, folder, given, cable or [], chamber or [], options.force, quiet, json)

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
    """Test the solver on stiff and extreme cases. Exit 4 if one neither converges nor names its cause."""
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
    check: Annotated[bool, typer.Option("--check", help="Exit with 5 if the files are not up to date.")] = False,
) -> None:
    """Write the JSON Schemas of all YAML files, for editors."""
    from cfem.cli.schemas import write_schemas

    run_command(lambda _: write_schemas(out, check))


def _version(wanted: bool) -> None:
    if wanted:
        print(VERSION)
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
