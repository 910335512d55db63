"""`cfem`: one command a stage, each reading its YAML spec and making one artefact folder."""

from importlib import import_module
from pathlib import Path
from typing import Annotated

import typer

from cfem.cli.help import App, Commands
from cfem.cli.init_command import add_init
from cfem.cli.look import add_looks
from cfem.cli.options import Check, Force, Json, MoveAside, Quiet, Strict, Workers
from cfem.cli.run import run_command
from cfem.cli.stages import add_stages
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


add_init(app)


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
        """Runs the action."""
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
    from cfem.stability import suite, table

    results = []

    def work(options):
        cases = suite.select(scene, only, heavy)
        if list_:
            names = [case.name for case in cases]
            return {"cases": names} if json else "\n".join(names)
        results.extend(suite.run_all(cases))
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
