"""The robot of a page at rest: a card that says what it is."""

from typing import Any

import numpy as np

from cfem.core.console.shown import stress
from cfem.dataset.reader import Dataset
from cfem.mechanics.mesh import Mesh
from cfem.report.page import Card
from cfem.report.tables import number
from cfem.report.viewer import BODY, HELD, Polyline, Take, Viewer, carried_along, flat_triangles
from cfem.robot.constraints import Cable, Push
from cfem.robot.layers import LayerSpec
from cfem.robot.places import cable_points, pull_point
from cfem.robot.spec import SceneSpec

ELEMENTS = {
    "tet4": "linear tetrahedra",
    "tet10": "quadratic tetrahedra",
    "tet10p0": "quadratic tetrahedra with one pressure per cell",
    "hex8": "hexahedra",
    "hex8-full": "hexahedra between rigid sections",
    "hex8-reduced": "hexahedra between rigid sections, reduced integration",
    "beam": "geometrically exact rod",
}
LINES = ("--c3", "--c1", "--c2", "--fe", "--c5", "--c6")


def cables_of(scene: SceneSpec) -> list[tuple[str, np.ndarray, int]]:
    """Cables of a scene: name, points, and how many of the first of these stay where they are."""
    cables = []
    for item in scene.actuators:
        if isinstance(item, Cable):
            held = [] if (pull := pull_point(scene, item)) is None else [pull]
            cables.append((item.name, np.array([*held, *cable_points(scene, item)], dtype=float), len(held)))
    return cables


def moved_with(points: np.ndarray, held: int, X: np.ndarray, x: np.ndarray) -> np.ndarray:
    moved = carried_along(points, X, x)
    moved[:, :held] = points[:held]
    return moved


def card(scene: SceneSpec, mesh: Mesh, data: Dataset) -> Card:
    """Card of the robot. data: states of it, for the places of its effectors."""
    fixed = np.zeros(len(mesh.X), dtype=bool)
    fixed[mesh.node_sets.get("fixed", [])] = True
    triangles = flat_triangles(mesh.facets)
    held = fixed[triangles].all(axis=1)
    cables = cables_of(scene)
    lines = tuple(
        Polyline(name, LINES[place % len(LINES)], points[None]) for place, (name, points, _) in enumerate(cables)
    )
    rest = np.asarray(data.meta["rest_e"], dtype=float)
    watched = [rest[i : i + 3] for i, name in enumerate(data.rows.effectors) if name.endswith(".x")]
    marks = [(point, "--hot") for point in watched] + [
        (np.asarray(contact.point), "--c0") for contact in scene.contacts
    ]
    take = Take("rest", mesh.X[None], lines=lines, marks=tuple(marks))
    drawn = ["dark: held faces"] + (["coloured lines: cables"] if lines else []) + ["red dots: watched points"]
    drawn += ["blue dots: contact points"] if scene.contacts else []
    caption = f"The robot at rest; {', '.join(drawn)}. Drag to turn."
    viewer = Viewer("robot", caption, triangles, np.where(held, HELD, BODY), (take,), pale=True)
    return Card(viewer, facts(scene, mesh, int(fixed.sum())))


def facts(scene: SceneSpec, mesh: Mesh, held: int) -> dict[str, str]:
    """Facts of the robot, in words, by name."""
    size = np.ptp(mesh.X, axis=0)
    extents, volume = " × ".join(number(extent) for extent in size), float(mesh.volumes.sum()) / 1000
    words = {
        "size": f"{extents} mm; volume {number(volume)} cm³",
        "material": _material(scene.material),
    }
    if scene.materials:
        words["other materials"] = "; ".join(
            f"{item.region.words}: {_material(item.material)}" for item in scene.materials
        )
    if scene.layers:
        words["layers"] = "; ".join(map(_layer, scene.layers))
    if scene.self_contact:
        words["self-contact"] = "walls that face each other across a narrow gap push each other"
    words["held"] = f"{held} of {len(mesh.X)} nodes"
    words["actuators"] = _actuators(scene)
    words["watched"] = ", ".join(item.name for item in scene.effectors)
    if scene.contacts:
        words["contact points"] = ", ".join(item.name for item in scene.contacts)
    if scene.gravity:
        words["gravity"] = f"{number(float(np.linalg.norm(scene.gravity.acceleration)) / 1000)} m/s²"
    if scene.loads:
        words["loads"] = "; ".join(f"{number(float(np.linalg.norm(load.force)))} N" for load in scene.loads)
    element = scene.mesh.element
    words["mesh"] = f"{len(mesh.X)} nodes, {len(mesh.cells)} cells: {ELEMENTS[element]} ({element})"
    return words


def _material(material: Any) -> str:
    return f"{material.law}, Young's modulus {stress(material.young)}, Poisson's ratio {material.poisson:g}"


def _layer(layer: LayerSpec) -> str:
    parts = [f"{number(layer.thickness)} mm thick"]
    parts += [] if layer.young is None else [f"Young's modulus {stress(layer.young)}"]
    parts += [f"fibres of {stress(family.young)}" for family in layer.fibres]
    return ", ".join(parts)


def _actuators(scene: SceneSpec) -> str:
    """Text of the actuators, those with the same limits together."""
    alike: dict[str, list[str]] = {}
    for item in scene.actuators:
        unit, pressure = "mm" if isinstance(item, Cable | Push) else "mm³", getattr(item, "pressure", None)
        text = f"{item.kind}, {' to '.join(number(value) for value in item.reach)} {unit}"
        if pressure is not None:
            text += f", {' to '.join(number(1000 * value) for value in pressure)} kPa"
        alike.setdefault(text, []).append(item.name)
    return "; ".join(f"{', '.join(names)}: {text}" for text, names in alike.items())
