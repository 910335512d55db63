"""The command `cfem init` and its options."""

from inspect import Parameter, Signature, signature
from pathlib import Path
from typing import Annotated

import typer

from cfem.cli.options import Json, Quiet
from cfem.cli.run import run_command
from cfem.core.errors import SpecError

# The questions of `cfem init`, by flag: an option for each answers it in advance.
_ANSWERS = {
    "unit": "Unit of the numbers in a file that states none: 'mm', 'm', 'inch'.",
    "cells": "About how many tetrahedra to make.",
    "fixed": "What is held: 'z <= 5 mm', bottom, top, left, right, front, back, 'face at 1, 2, 3 mm', or a set of the "
    "mesh; several with | between them.",
    "young": "Young's modulus: '500 kPa'.",
    "poisson": "Poisson's ratio, at most 0.4999.",
    "cable": "A cable: 'NAME: pull point; point; ...', each point 'x, y, z' in mm. Repeatable.",
    "cables": "How many cables to place: in channels, or along the body at equal angles.",
    "through-air": "Whether cables may cross the air between parts of the body: yes, no, auto.",
    "chamber": "A chamber: 'NAME: x, y, z' inside it in mm, or 'NAME: FILE' of its surface. Repeatable.",
    "chambers": "Which closed inner surfaces are inflated: all or none.",
    "reach": "Largest shortening of each cable: '10 mm', or one each with commas.",
    "growth": "Largest growth of each chamber: '2 ml', or one each with commas.",
    "self-contact": "Whether walls that face each other across a narrow gap push each other: yes or no.",
    "remesh": "Whether to replace the cells of a mesh file by a new mesh of its surface: yes or no.",
    "body": "Which of several bodies in a file of surfaces, the largest first: 1, 2, ...",
    "effector": "The watched point: 'x, y, z' in mm.",
    "also": "What else to ask for: push, gravity, region, rigid, contact, symmetry, or none.",
    "push": "A force that pushes: 'NAME: x, y, z; dx, dy, dz', place in mm and direction. Repeatable.",
    "travel": "Largest way of the points that are pushed: '10 mm', or one each with commas.",
    "gravity": "Which way is down: -z, or 'x, y, z' in m/s^2.",
    "density": "Density, under gravity: '1070 kg/m^3'.",
    "region": "Another material: 'z >= 5 mm: 2 MPa, 0.45', or a set of the mesh for z. Repeatable.",
    "rigid": "A rigid part: 'z >= 5 mm'. Repeatable.",
    "contact": "A point that something may touch: 'NAME: x, y, z' in mm. Repeatable.",
    "symmetry": "Axis across which the body is its own mirror image: x, y or z (.step, .brep).",
}
_PARTS = ("cable", "chamber")  # each names one actuator
_JOINED = ("push", "region", "rigid", "contact")  # repeated options, which a question takes in one text


def add_init(app: typer.Typer) -> None:
    """Adds the command to the program."""
    first, last = signature(_inputs).parameters.values(), signature(_how).parameters.values()
    options = [option.replace(kind=Parameter.KEYWORD_ONLY) for option in (*first, *map(_answer, _ANSWERS), *last)]

    def init(**values) -> None:
        """Make the YAML files of a new robot from a STEP, STL or mesh file, or copy those of a robot that comes with
        cfem. Asks for what no option states."""
        _init(**values)

    init.__signature__ = Signature(options)
    init.__annotations__ = {option.name: option.annotation for option in options}
    app.command()(init)


def _inputs(
    name: Annotated[str, typer.Argument(help="Name of the new robot: small letters, digits and hyphens.")],
    source: Annotated[
        Path | None,
        typer.Option(
            "--from",
            help="File with its shape: .step .brep, a surface (.stl .obj .3mf), or a mesh (.vtu .vtk .msh .inp).",
        ),
    ] = None,
    robot: Annotated[str | None, typer.Option(help="Copy a robot that comes with cfem, instead of --from.")] = None,
) -> None:
    """The options that say from what the robot is made."""


def _how(
    folder: Annotated[Path, typer.Option(help="Folder of all robots.")] = Path("pipelines"),
    force: Annotated[bool, typer.Option("--force", help="Replace the files of a scene that is there.")] = False,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """The options that say where the files go and what is printed."""


def _answer(flag: str) -> Parameter:
    """The option that answers one question."""
    kind = list[str] | None if flag in (*_PARTS, *_JOINED) else str | None
    option = Annotated[kind, typer.Option(f"--{flag}", help=_ANSWERS[flag])]
    return Parameter(flag.replace("-", "_"), Parameter.KEYWORD_ONLY, default=None, annotation=option)


def _init(name, source, robot, folder, force, json, quiet, **values) -> None:
    """Makes the scene. values: of the options in `_ANSWERS`, None where an option is not given."""
    answers = {flag: values[flag.replace("-", "_")] for flag in _ANSWERS}

    def work(options):
        """Copies a robot or makes a scene."""
        from cfem.cli.init import init_robot, init_scene

        if (source is None) == (robot is None):
            raise SpecError("give --from FILE or --robot NAME, one of the two", where="init")
        if robot is not None:
            stated = [flag for flag, value in answers.items() if value]
            return init_robot(name, robot, folder, stated, options.force, json)
        cables, chambers = (answers[flag] or [] for flag in _PARTS)
        given = {flag: value for flag, value in answers.items() if flag not in _PARTS}
        given |= {flag: " | ".join(given[flag]) if given[flag] else None for flag in _JOINED}
        return init_scene(name, source, folder, given, cables, chambers, options.force, quiet, json)

    run_command(work, force=force, as_json=json, quiet=quiet, label="init", interrupted="no scene was written")
