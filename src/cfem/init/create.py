"""A new scene: questions in their order, guesses from the shape, its files and a copy of the shape."""

import shutil
from collections.abc import Callable, Collection, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from cfem.core.artefact.files import disk_errors
from cfem.core.artefact.place import write_beside
from cfem.core.console.progress import doing
from cfem.core.errors import InputError, OutputError, SpecError
from cfem.core.names import demand_scene_name
from cfem.init.body.shape import MESH, Shape, Source, geometry, make_shape, read_source
from cfem.init.cables.ends import Proposal
from cfem.init.drive import NOTHING, Stated, drive, proposal
from cfem.init.further import further
from cfem.init.hold import Hold, Run, read_hold, run_from
from cfem.init.question import Answer, Ask, Question, choice, integer, parts, point, ratio, stress
from cfem.init.texts import SPECS, NewScene, texts
from cfem.init.trial import tried
from cfem.init.unit import demand_unit, unit_doubt, unit_of
from cfem.init.watch import carrier_radius, guess_watched, is_inside
from cfem.init.written import number, vector
from cfem.robot.checks.plausible import LENGTHS, sides
from cfem.robot.geometry import SURFACES
from cfem.robot.mesh.mesh_file import REMESH
from cfem.robot.mesh.quality import dihedral_angles
from cfem.robot.mesh.surface_file import count_bodies

_SHARP = 5.0  # degrees: cells with sharper angles are doubtful
_LINEAR = 15_000  # cells of the user's own mesh above which quadratic ones would take hours


@dataclass(frozen=True)
class Show:
    """ask: answers by what options say and by defaults, without a question; look: is given the robot and its body."""

    ask: Ask
    look: Callable[[NewScene, Shape], None]


def create(
    name: str,
    path: Path,
    folder: Path,
    ask: Ask,
    stated: Stated = NOTHING,
    force: bool = False,
    show: Show | None = None,
) -> dict[str, Any]:
    """Writes folder / name, asking what is open; stated: what options say about actuators, and the flags to which `ask`
    has an answer already; show: is given what is suggested before the first question about it. Returns what was made;
    open: what nobody could answer, fewer: why there are fewer cables than asked for, doubts: what was guessed and is
    uncertain, a sentence each.

    Raises SpecError (an answer that cannot be), InputError (no shape in the file), OutputError (there is such a scene
    and not `force`)."""
    demand_scene_name(name)
    doing(f"reading {path.name}")
    source = _source(path, stated, ask)
    target = folder / name
    copy = f"{name}{path.suffix.lower()}"
    _demand_room(target, [*(f"{spec}.yaml" for spec in SPECS), copy], path, force)
    known = _known(source, stated, ask)
    if show is not None:
        with suppress(SpecError):  # of what is wrong the questions tell
            show.look(*_robot(name, copy, source, stated, show.ask, known))
    robot, _ = _robot(name, copy, source, stated, ask, known)
    doing("building the robot on a coarse mesh")
    robot, cells = tried(robot, path, stated, ask)
    made = texts(robot)
    with disk_errors(target):
        target.mkdir(parents=True, exist_ok=True)
        if not _same(path, target / copy):
            shutil.copyfile(path, target / copy)
    for file, text in made.items():
        write_beside(target / file, text.encode())
    doubt = unit_doubt(source) if robot.unit and robot.unit.guess else ""
    return {
        "folder": str(target),
        "files": [copy, *made],
        "length": robot.length,
        "cables": [cable.name for cable in robot.drive.cables],
        "chambers": [chamber.name for chamber in robot.drive.chambers],
        "coarse_cells": cells,
        "mended": list(source.mended),
        "open": [robot.drive.missing] if robot.drive.missing else [],
        "fewer": [robot.drive.fewer] if robot.drive.fewer else [],
        "doubts": [f"the unit of {path.name} is uncertain, as {doubt}: state --unit"] if doubt else [],
    }


def _source(path: Path, stated: Stated, ask: Ask) -> Source:
    """The file, its mesh or only the surface of it."""
    try:
        source = read_source(path)
    except InputError as error:
        if error.do != REMESH:
            raise
        source = _cells_or_surface(path, None, error.what, stated, ask)
    else:
        if source.mesh is not None and source.mesh.cells.shape[1] == 4:
            angles = dihedral_angles(source.mesh)
            poor, why = angles.min() < _SHARP, f"its angles go from {angles.min():.0f} to {angles.max():.0f} degrees"
            source = _cells_or_surface(path, source, why, stated, ask, poor)
    count = count_bodies(path) if source.mesh is None and path.suffix.lower() in SURFACES + MESH else 1
    if count > 1 or "body" in stated.flags:
        source = read_source(path, source.remesh, ask(_body_question(count)).value)
    _demand_use(source, stated.flags)
    return source


def _cells_or_surface(
    path: Path, with_cells: Source | None, why: str, stated: Stated, ask: Ask, poor: bool = True
) -> Source:
    """Geometry taken of a mesh file: its cells, None where they cannot be used, or its surface, which is suggested
    where they are poor. Where the surface cannot be meshed, poor cells are better than none."""
    anew = refused = None
    if poor:
        try:
            anew = read_source(path, remesh=True)
        except InputError as error:
            if with_cells is None:
                raise
            refused = f"its surface cannot be meshed: {error.what}"
    if refused and "cells" in stated.flags:
        raise SpecError(f"the mesh in the file is taken as it is, as {refused}", where="--cells", do="leave it out")
    question = Question(
        "remesh",
        "Replace the cells of the file by a new mesh of its surface (yes, no)?",
        "yes" if anew else "no",
        f"{why}, but {refused}" if refused else why,
        lambda text: choice(text, ("yes", "no")),
    )
    if ask(question).value == "no":
        return with_cells or read_source(path)
    if refused:
        raise SpecError(refused, where="--remesh", do="say --remesh no")
    return anew or read_source(path, remesh=True)


def _body_question(count: int) -> Question:
    return Question(
        "body",
        f"Which of the {count} bodies in the file, the largest first?",
        "1",
        "the largest",
        lambda text: integer(text, 1, count),
    )


def _demand_use(source: Source, stated: Collection[str]) -> None:
    """SpecError where an answer would be of no effect."""
    if source.has_unit and "unit" in stated:
        raise SpecError(f"a {source.path.suffix} file states its own unit", where="--unit", do="leave it out")
    if source.mesh is not None and "cells" in stated:
        do = "leave it out, or say --remesh yes"
        raise SpecError("the mesh in the file is taken as it is", where="--cells", do=do)


def _demand_room(target: Path, files: Sequence[str], source: Path, force: bool) -> None:
    existing = [file for file in files if (target / file).exists() and not _same(source, target / file)]
    if existing and not force:
        raise OutputError(f"holds {', '.join(existing)}", where=str(target), do="choose another name, or --force")


def _same(path: Path, other: Path) -> bool:
    return other.exists() and path.samefile(other)


Known = Callable[[float, int], tuple[Shape, Proposal]]


def _known(source: Source, stated: Stated, ask: Ask) -> Known:
    """The body and what is proposed to be held, by unit (mm) and cells: of the same ones found once. SpecError where no
    robot is of such a size."""

    @cache
    def known(unit: float, cells: int) -> tuple[Shape, Proposal]:
        doing("meshing the body coarsely")
        shape = make_shape(source, unit, cells)
        doing("looking for what is held and for ways of cables")
        if not source.has_unit:
            demand_unit(shape.extent / unit, unit)
        return shape, proposal(shape, stated, ask)

    return known


def _robot(name: str, copy: str, source: Source, stated: Stated, ask: Ask, known: Known) -> tuple[NewScene, Shape]:
    """All but how far the actuators go; and the body."""
    unit, cells = unit_of(source, ask), _cells(source, ask)
    scale = 1.0 if unit is None else unit.value
    shape, proposed = known(scale, cells.value if cells else 0)
    hold = _hold(shape, proposed, ask)
    run = run_from(hold.value[0], shape)
    young, poisson = _material(ask)
    driven = drive(shape, run, stated, proposed if hold.value == (proposed.hold,) else None, ask)
    effector = _effector(shape, run, hold.value, ask)
    outside = not is_inside(shape.mesh, effector.value)
    also = further(shape, source, stated.flags, ask)
    # The way from what is held to the tip, unless that is so short beside the body that `cfem mesh` would doubt it.
    axis = run.axis if shape.extent.max() <= LENGTHS * run.length else int(shape.extent.argmax())
    robot = NewScene(
        name=name,
        kind=geometry(source.path, 1.0).kind,
        file=copy,
        body=source.body,
        remesh=source.remesh and source.path.suffix.lower() not in SURFACES,
        mended=source.mended,
        unit=unit,
        extent=shape.extent,
        volume=source.volume * scale**3,
        axis=axis,
        length=run.length if axis == run.axis else float(shape.extent[axis]),
        size=shape.size,
        cells=cells,
        element=_element(shape, source),
        hold=hold,
        young=young,
        poisson=poisson,
        drive=replace(driven, missing=None) if also.pushes else driven,
        further=also,
        reach=(),
        least=(),
        effector=effector,
        carrier_radius=carrier_radius(shape.mesh, effector.value) if outside else None,
    )
    return robot, shape


def _cells(source: Source, ask: Ask) -> Answer | None:
    if source.mesh is not None:
        return None
    why = "minutes, not hours"
    read = lambda text: integer(text, 300, 1_000_000)  # noqa: E731
    return ask(Question("cells", "About how many tetrahedra?", "5000", why, read))


def _hold(shape: Shape, proposal: Proposal, ask: Ask) -> Answer:
    """The answer to what is held: parts of the body, by a proposal that is asked about."""
    hold = proposal.hold
    low, high = vector(_rounded(shape.low)), vector(_rounded(shape.high))
    names = sorted({*shape.mesh.node_sets, *shape.mesh.facet_sets})
    sets = f"; sets of the mesh: {', '.join(names)}" if names else ""
    text = f"What is held? The body goes from {low} to {high} mm; several parts with | between them{sets}"

    def read(text: str) -> tuple[Hold, ...]:
        return tuple(_exact(hold, read_hold(part, shape)) for part in parts(text) or [text])

    return ask(Question("fixed", text, str(hold), proposal.why, read))


def _exact(guess: Hold, read: Hold) -> Hold:
    """The guess itself where its text was read back."""
    return guess if str(guess) == str(read) else read


def _material(ask: Ask) -> tuple[Answer, Answer]:
    young = ask(Question("young", "Young's modulus?", "500 kPa", "a soft silicone rubber", stress))
    poisson = ask(Question("poisson", "Poisson's ratio?", "0.45", "nearly incompressible", ratio))
    return young, poisson


def _effector(shape: Shape, run: Run, held: Sequence[Hold], ask: Ask) -> Answer:
    """The answer to which point (3,) mm is watched: near the body, and not held."""
    place, why = guess_watched(shape, run)
    default = ", ".join(number(value) for value in place) + " mm"

    def read(text: str) -> np.ndarray:
        place = point(text)
        if any(part.holds(place) for part in held):
            raise SpecError(f"the point ({text.strip()}) is held", do="state one that moves")
        apart = float(np.linalg.norm(shape.mesh.X - place, axis=1).min())
        if apart > shape.extent.max():
            size = f"the body measures {sides(shape.extent)} mm"
            raise SpecError(f"the point ({text.strip()}) is {apart:.3g} mm from the body", do=f"check its unit: {size}")
        return place

    return ask(Question("effector", "Which point is watched?", default, why, read))


def _rounded(place: np.ndarray) -> list[float]:
    return [float(f"{value:.6g}") for value in place]


def _element(shape: Shape, source: Source) -> str:
    if shape.mesh.cells.shape[1] == 8:
        return "hex8"
    return "tet10p0" if source.mesh is None or len(shape.mesh.cells) <= _LINEAR else "tet4"
