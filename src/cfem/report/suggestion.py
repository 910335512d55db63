"""The page that `cfem init` shows before it asks: the body with what is held, its actuators and the watched point."""

import numpy as np

from cfem.init.body.shape import Shape
from cfem.init.chambers import Chamber
from cfem.init.hold import Hold
from cfem.init.texts import NewScene
from cfem.init.written import short
from cfem.mechanics.mesh import Mesh
from cfem.report.page import Card, Summary, page
from cfem.report.sections.robot import LINES
from cfem.report.viewer import BODY, HELD, Polyline, Take, Viewer, flat_triangles
from cfem.robot.selection import select_nodes

_ARROW = 0.2  # of the body's length: a push


def suggestion(robot: NewScene, shape: Shape) -> str:
    """Page that shows what a new robot's actuators would do, HTML in one file."""
    text = "Nothing is written yet. Each answer to a question may change this."
    title = f"{robot.name}: what is suggested"
    return page(title, Summary(text), None, Card(viewer(robot, shape), facts(robot)), [])


def viewer(robot: NewScene, shape: Shape) -> Viewer:
    """Picture of the body, with held nodes dark, actuators as lines and watched points as dots."""
    mesh, driven = shape.mesh, robot.drive
    held = _held(mesh, robot.hold.value)
    triangles = flat_triangles(mesh.facets)
    named = [(cable.name, np.vstack([cable.pull, cable.points])) for cable in driven.cables]
    named += [(chamber.name, _wire(chamber)) for chamber in driven.chambers]
    named += [(push.name, _arrow(push.place, push.direction, robot.length)) for push in robot.further.pushes]
    lines = tuple(Polyline(name, LINES[place % len(LINES)], points[None]) for place, (name, points) in enumerate(named))
    marks = [(robot.effector.value, "--hot")] + [(place, "--c0") for _, place in robot.further.contacts]
    drawn = ["dark: what is held", "red dot: the watched point"] + (["lines: what drives it"] if lines else [])
    caption = f"{robot.name} as suggested; {', '.join(drawn)}. Drag to turn."
    take = Take("rest", mesh.X[None], lines=lines, marks=tuple(marks))
    kinds = np.where(held[triangles].all(axis=1), HELD, BODY)
    return Viewer(robot.name, caption, triangles, kinds, (take,), pale=True)


def facts(robot: NewScene) -> dict[str, str]:
    """Suggested values in words, by the option that states each."""
    extent = " × ".join(short(side) for side in robot.extent)
    words = {"body": f"{extent} mm; volume {short(robot.volume / 1000)} cm³"}
    words["--fixed"] = f"{' | '.join(map(str, robot.hold.value))}{_why(robot.hold.guess)}"
    driven = robot.drive
    if driven.cables:
        names = ", ".join(cable.name for cable in driven.cables)
        words["--cables"] = f"{len(driven.cables)}: {names}{_why(driven.placed)}{_why(driven.fewer)}"
    if driven.chambers:
        names = ", ".join(f"{chamber.name} of {short(chamber.volume)} mm³" for chamber in driven.chambers)
        words["--chambers"] = f"{names}{_why(driven.offered)}"
    if robot.further.pushes:
        words["--push"] = ", ".join(push.name for push in robot.further.pushes)
    if driven.missing:
        words["open"] = f"what drives the robot? {driven.missing}"
    place = ", ".join(f"{value:.4g}" for value in robot.effector.value)
    words["--effector"] = f"{place} mm{_why(robot.effector.guess)}"
    words["--young"] = f"{robot.young.value}{_why(robot.young.guess)}"
    return words


def _why(guess: str | None) -> str:
    return f"; {guess}" if guess else ""


def _held(mesh: Mesh, parts: tuple[Hold, ...]) -> np.ndarray:
    """Mask (n,) of the nodes that the scene holds."""
    held = np.zeros(len(mesh.X), dtype=bool)
    for part in parts:
        held[select_nodes(mesh, part.selection(), "fixed")] = True
    return held


def _wire(chamber: Chamber) -> np.ndarray:
    """Line (k, 3) mm along all edges of the chamber's wall. Each edge is walked there and back, depth first."""
    X, corners = np.unique(chamber.corners.reshape(-1, 3), axis=0, return_inverse=True)
    neighbours: list[set[int]] = [set() for _ in X]
    for triangle in corners.reshape(-1, 3).tolist():
        for node in triangle:
            neighbours[node].update(set(triangle) - {node})
    walk, way_back, reached = [0], [0], {0}
    while way_back:
        node = way_back[-1]
        if not neighbours[node]:
            way_back.pop()
            walk += way_back[-1:]
            continue
        target = neighbours[node].pop()
        neighbours[target].discard(node)
        walk.append(target)
        if target in reached:
            walk.append(node)
        else:
            reached.add(target)
            way_back.append(target)
    return X[walk]


def _arrow(place: np.ndarray, direction: np.ndarray, length: float) -> np.ndarray:
    """Line (5, 3) mm of an arrow for a force that pushes at `place`, with its head there."""
    along = direction / np.linalg.norm(direction)
    across = np.cross(along, np.eye(3)[np.abs(along).argmin()])
    size = _ARROW * length
    sides = [place - 0.3 * size * along + sign * 0.15 * size * across for sign in (1, -1)]
    return np.array([place - size * along, place, sides[0], place, sides[1]])
