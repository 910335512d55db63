"""A new scene: questions in their order, guesses from the shape, six files and a copy of the shape."""

import shutil
import tempfile
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cfem.core.errors import OutputError, SpecError
from cfem.core.files import disk_errors
from cfem.core.names import demand_scene_name
from cfem.core.place import write_beside
from cfem.core.spec import load_spec
from cfem.init.cables import CableLine, attachment_radius, guess_reach, read_cable, sections_along
from cfem.init.ends import Proposal, place, propose
from cfem.init.hold import Hold, Run, guess_hold, read_hold, run_from
from cfem.init.question import Answer, Ask, Question, point, positive, whole
from cfem.init.shape import Shape, Source, geometry, make_shape, natural_unit, read_source
from cfem.init.texts import SPECS, NewScene, number, short, texts, vector
from cfem.init.watch import carrier_radius, guess_watched, is_inside
from cfem.robot.build import build_robot
from cfem.robot.cable_passage import demand_inside
from cfem.robot.geometry import SURFACES
from cfem.robot.mesh.meshing import make_mesh
from cfem.robot.plausible import size_doubts
from cfem.robot.spec import SceneSpec

_OPTIONS = {"actuators": "--cable", "effectors": "--effector", "fixed": "--fixed"}
_COUNT = Question(
    "cables",
    "How many cables, placed for you?",
    "3",
    "placed at equal angles near the surface",
    lambda text: whole(text, 1, 12),
)
_LINEAR = 15_000  # cells of the user's own mesh above which quadratic ones would take hours


def create(
    name: str,
    path: Path,
    folder: Path,
    cables: Sequence[str],
    ask: Ask,
    stated: Collection[str] = (),
    force: bool = False,
) -> dict[str, Any]:
    """Writes folder / name, asking what is open; cables: 'NAME: pull point; point; ...' each, none where they are to be
    placed here; stated: the flags to which `ask` has an answer already. Returns what was made.

    Raises SpecError (an answer that cannot be), InputError (no shape in the file), OutputError (there is such a scene
    and not `force`)."""
    demand_scene_name(name)
    source = read_source(path)
    _demand_use(source, stated)
    target = folder / name
    copy = f"{name}{path.suffix.lower()}"
    _demand_room(target, [*(f"{spec}.yaml" for spec in SPECS), copy], path, force)
    robot = _robot(name, copy, source, cables, stated, ask)
    made = texts(robot)
    cells = _try(made["scene.yaml"], copy, path)
    with disk_errors(target):
        target.mkdir(parents=True, exist_ok=True)
        if not _same(path, target / copy):
            shutil.copyfile(path, target / copy)
    for file, text in made.items():
        write_beside(target / file, text.encode())
    return {
        "folder": str(target),
        "files": [copy, *made],
        "length": robot.length,
        "cables": [cable.name for cable in robot.cables],
        "coarse_cells": cells,
    }


def _demand_use(source: Source, stated: Collection[str]) -> None:
    """SpecError where an answer would be of no effect."""
    if source.has_unit and "unit" in stated:
        raise SpecError(f"a {source.path.suffix} file states its own unit", where="--unit", do="leave it out")
    if source.own is not None and "cells" in stated:
        raise SpecError("the mesh in the file is taken as it is", where="--cells", do="leave it out")


def _demand_room(target: Path, files: Sequence[str], source: Path, force: bool) -> None:
    there = [file for file in files if (target / file).exists() and not _same(source, target / file)]
    if there and not force:
        raise OutputError(f"holds {', '.join(there)}", where=str(target), do="choose another name, or --force")


def _same(path: Path, other: Path) -> bool:
    return other.exists() and path.samefile(other)


def _robot(name: str, copy: str, source: Source, cables: Sequence[str], stated: Collection[str], ask: Ask) -> NewScene:
    unit, cells = _unit(source, ask), _cells(source, ask)
    scale = 1.0 if unit is None else unit.value
    shape = make_shape(source, scale, cells.value if cells else 0)
    doubts = size_doubts(shape.extent)
    if doubts and unit is not None:
        raise SpecError(doubts[0], where="--unit", do="state the unit of the file's numbers, such as 'mm' or 'm'")
    proposal = _proposal(shape, cables, stated, ask)
    hold = _hold(shape, proposal, ask)
    run = run_from(hold.value, shape)
    young, poisson = _material(ask)
    lines, placed, radius = _cables(shape, run, cables, proposal if hold.value is proposal.hold else None, ask)
    reach = _reach(lines, ask)
    effector = _effector(shape, run, ask)
    outside = not is_inside(shape.mesh, effector.value)
    return NewScene(
        name=name,
        kind=geometry(source.path, 1.0).kind,
        file=copy,
        remesh=source.remesh and source.path.suffix.lower() not in SURFACES,
        unit=unit,
        extent=shape.extent,
        volume=source.volume * scale**3,
        axis=run.axis,
        length=run.length,
        size=shape.size,
        cells=cells,
        element=_element(shape, source),
        hold=hold,
        young=young,
        poisson=poisson,
        cables=lines,
        placed=placed,
        radius=radius,
        reach=reach,
        effector=effector,
        carrier_radius=carrier_radius(shape.mesh, effector.value) if outside else None,
    )


def _unit(source: Source, ask: Ask) -> Answer | None:
    if source.has_unit:
        return None
    unit = natural_unit(source)
    edge = f"{source.volume:.3g} cubic {unit}"
    return ask(
        Question(
            "unit",
            f"What is one unit of the numbers in {source.path.name}?",
            f"1 {unit}",
            f"the body then has {edge}",
            lambda text: positive(text if text.strip()[:1].isdigit() else f"1 {text.strip()}", "mm"),
        )
    )


def _cells(source: Source, ask: Ask) -> Answer | None:
    if source.own is not None:
        return None
    why = "minutes, not hours"
    read = lambda text: whole(text, 300, 1_000_000)  # noqa: E731
    return ask(Question("cells", "About how many tetrahedra?", "5000", why, read))


def _proposal(shape: Shape, cables: Sequence[str], stated: Collection[str], ask: Ask) -> Proposal:
    """What to hold; from where cables stay inside, where both are to be guessed."""
    if cables or "fixed" in stated:
        return Proposal(*guess_hold(shape))
    return propose(shape, ask(_COUNT).value if "cables" in stated else int(_COUNT.default))


def _hold(shape: Shape, proposal: Proposal, ask: Ask) -> Answer:
    hold = proposal.hold
    low, high = vector(_rounded(shape.low)), vector(_rounded(shape.high))
    text = f"What is held? The body goes from {low} to {high} mm"
    return ask(Question("fixed", text, str(hold), proposal.why, lambda text: _exact(hold, read_hold(text, shape))))


def _exact(guess: Hold, read: Hold) -> Hold:
    """The guess itself where its text was read back."""
    return guess if str(guess) == str(read) else read


def _material(ask: Ask) -> tuple[Answer, Answer]:
    young = ask(Question("young", "Young's modulus?", "500 kPa", "a soft silicone rubber", _stress))
    poisson = ask(Question("poisson", "Poisson's ratio?", "0.45", "nearly incompressible", _ratio))
    return young, poisson


def _stress(text: str) -> str:
    positive(text, "MPa")
    return " ".join(text.split())


def _ratio(text: str) -> float:
    value = float(text)
    if not 0 <= value <= 0.4999:
        raise ValueError(f"expected a number from 0 to 0.4999, got '{text}'")
    return value


def _cables(
    shape: Shape, run: Run, given: Sequence[str], proposal: Proposal | None, ask: Ask
) -> tuple[tuple[CableLine, ...], str | None, float]:
    """proposal: of what is held, if that was taken."""
    if given:
        lines = tuple(_cable(text) for text in given)
        names = [line.name for line in lines]
        if len(set(names)) < len(names):
            raise SpecError(f"names must differ, got {', '.join(names)}", where="--cable")
        return lines, None, attachment_radius(sections_along(shape.interior, run), run)
    count = ask(_COUNT).value
    known = proposal.placement if proposal and proposal.count == count else None
    found = known or place(shape, run, count)
    how = "at equal angles near the surface, at least `radius` within it"
    return found.cables, how if found.whole else f"{how}, up to where the body turns", found.radius


def _cable(text: str) -> CableLine:
    try:
        return read_cable(text)
    except ValueError as error:
        raise SpecError(str(error), where="--cable") from None


def _reach(lines: tuple[CableLine, ...], ask: Ask) -> Answer:
    reach, why = guess_reach(lines)
    text = "By how much may each cable be shortened?"
    return ask(Question("reach", text, f"{short(reach)} mm", why, lambda text: positive(text, "mm")))


def _effector(shape: Shape, run: Run, ask: Ask) -> Answer:
    place, why = guess_watched(shape, run)
    default = ", ".join(number(value) for value in place) + " mm"
    return ask(Question("effector", "Which point is watched?", default, why, point))


def _rounded(place: np.ndarray) -> list[float]:
    return [float(f"{value:.6g}") for value in place]


def _element(shape: Shape, source: Source) -> str:
    if shape.mesh.cells.shape[1] == 8:
        return "hex8"
    return "tet10p0" if source.own is None or len(shape.mesh.cells) <= _LINEAR else "tet4"


def _try(scene: str, copy: str, path: Path) -> int:
    """Makes the robot on the coarse mesh, so that what cannot be made is an error now; how many cells that has."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        shutil.copyfile(path, folder / copy)
        (folder / "scene.yaml").write_text(scene, encoding="utf-8")
        spec = load_spec(folder / "scene.yaml", SceneSpec)
        mesh, _ = make_mesh(spec, folder)
        try:
            build_robot(spec, mesh)
            demand_inside(spec, mesh)
        except SpecError as error:  # the file that it names is not written
            key = (error.where or "").rpartition(": ")[2].split(".")[0]
            raise SpecError(error.what, where=_OPTIONS.get(key), do=error.do) from None
    return len(mesh.cells)
