"""The commands that show what there is. They solve nothing."""

from importlib import import_module
from pathlib import Path
from typing import Annotated

import typer

from cfem.cli.options import Check, Force, Json, Quiet
from cfem.cli.run import run_command
from cfem.core.errors import SpecError


def add_looks(app: typer.Typer) -> None:
    """Adds them to the program."""
    for command in (summary, animate, inspect, verify, clean):
        app.command()(command)
    app.command("modes")(natural_modes)


def animate(
    control: Annotated[Path, typer.Argument(help="Folder that cfem control made.")],
    format_: Annotated[
        list[str] | None,
        typer.Option("--format", help="gif, paraview or still. Repeatable. Default: gif and paraview."),
    ] = None,
    still: Annotated[
        bool, typer.Option("--still", help="A PNG of 2400 pixels for a paper: as --format still.")
    ] = False,
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
    """Draw a control run as an animation, and as files for ParaView. Solves nothing."""

    def work(options):
        formats = [*(format_ or ([] if still else ["gif", "paraview"])), *(["still"] if still else [])]
        if unknown := sorted(set(formats) - {"gif", "paraview", "still"}):
            raise SpecError(f"'{unknown[0]}' is not known: gif, paraview and still are", where="animate --format")
        return import_module("cfem.report.animate").run(control, out, options, formats, frames, learned)

    run_command(work, force, check, json, quiet, label="animate")


def inspect(
    artefact: Annotated[Path, typer.Argument(help="A mesh, dataset, model, control or report folder.")],
    json: Json = False,
) -> None:
    """Print what a folder that a command made holds: origin, rows, units, statistics, errors."""
    from cfem.cli.inspect import describe

    run_command(lambda _: describe(artefact, json), as_json=json)


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


def verify(
    folders: Annotated[
        list[Path] | None,
        typer.Argument(help="Folders that commands made, or folders of them. Default: data and models."),
    ] = None,
    json: Json = False,
) -> None:
    """Check every file that commands made against its checksum. Exit 3 if one is damaged, missing or not theirs."""
    from cfem.cli.verify import demand_whole, verify_folders

    verified = []
    run_command(lambda _: verify_folders(folders or [], json, verified), as_json=json, label="verify")
    if any(artefact.damage for artefact in verified):
        run_command(lambda _: demand_whole(verified))


def clean(
    folders: Annotated[
        list[Path] | None, typer.Argument(help="Folders to look through. Default: data, models and pipelines.")
    ] = None,
    delete: Annotated[bool, typer.Option("--delete", help="Delete copies, and what is cheap to make again.")] = False,
    dear: Annotated[bool, typer.Option("--dear", help="Also samples and unfinished work, which took long.")] = False,
    json: Json = False,
) -> None:
    """Say how much room set-aside folders (NAME.old-1) and unfinished work take. Deletes nothing unless told."""

    def work(_):
        return import_module("cfem.cli.clean").clean(folders or [], delete, dear, json)

    run_command(work, as_json=json)


def summary(
    folders: Annotated[list[Path], typer.Argument(help="Folders, in the order to be listed.")],
) -> None:
    """Print the main results and the run times of folders that commands made."""
    from cfem.cli.inspect import summarise

    run_command(lambda _: summarise(folders))
