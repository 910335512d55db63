"""A PneuNet bent by pressure, of ten cells to 180 degrees: cfem against CalculiX. Usage: pneunet_bending.py
[--cells N] [--pressures KPA ...] [--sizes MM ...] [--elements NAME ...] [--hexahedra MM ...] [--ccx PROGRAM].

Prints the bending angle at each pressure, and what a state costs, for each mesh and element. Where the program
`ccx` is there (`apt install calculix-ccx`), it solves the same solid: half of it, in hexahedra with quadratic sides and
reduced integration (C3D20R) on a grid of its own, the paper as membranes (M3D8), and the walls of neighbouring cells in
contact from surface to surface. Shared are lengths, constants and pressures."""

import argparse
import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from cfem.core.spec import load_spec
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import force
from cfem.equilibrium.system.problem import Problem
from cfem.robot.build import build_robot
from cfem.robot.mesh.accuracy import scene_mesh
from cfem.robot.spec import SceneSpec

SCENE = Path(__file__).parents[1] / "pipelines" / "pneunet" / "scene.yaml"
PRESSURES = [5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 35.0, 39.0]
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])
EDGES = ((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7))
SIDES = ((0, 0, -1), (0, 0, 1), (0, -1, 0), (1, 0, 0), (0, 1, 0), (-1, 0, 0))  # of a cell, as CalculiX numbers them
STIFF = 5.0  # MPa/mm of the walls' contact
TOUCH = 1e-6  # mm: what lies in a plane


@dataclass(frozen=True)
class Bending:
    """Angles (degrees) at the pressures, and what a state costs."""

    name: str
    nodes: int
    factorisations: float | None
    seconds: float
    angles: list[float]

    def row(self) -> str:
        factorisations = "" if self.factorisations is None else f"{self.factorisations:.3g}"
        angles = " | ".join(f"{angle:.1f}" for angle in self.angles)
        return f"| {self.name} | {self.nodes} | {factorisations} | {self.seconds:.3g} | {angles} |"


def scene_of(cells: int, size: float, element: str) -> SceneSpec:
    """The PneuNet of the catalogue with so many cells."""
    length = 11.5 * cells - 1.5
    changes = [f"geometry.cells={cells}", f"length={length} mm", f"mesh.size={size} mm", f"mesh.element={element}"]
    return load_spec(SCENE, SceneSpec, changes)


def tip_of(scene: SceneSpec, X: np.ndarray) -> int:
    """The node of X (n, 3) mm below the middle of the free end."""
    apart = np.linalg.norm(X - [scene.length, 0, 0], axis=1)
    assert apart.min() < TOUCH
    return int(apart.argmin())


def angles(tips: Iterable[np.ndarray]) -> list[float]:
    """Bending angles, degrees, with the tip at places (3,) mm: twice the angle by which the line to it from the held
    end has turned, which is the rotation of the tip where the curvature is even."""
    return [float(2 * np.degrees(np.arctan2(-z, x)) % 360) for x, _, z in tips]


def by_cfem(cells: int, size: float, element: str, pressures: list[float]) -> Bending:
    scene = scene_of(cells, size, element)
    robot = build_robot(scene, scene_mesh(scene, SCENE.parent)[0])
    problem, base, solved = Problem(robot), None, []
    begin = time.process_time()
    for pressure in pressures:
        solved.append(solve(problem, force(np.array([1e-3 * pressure])), base=base))
        assert solved[-1].converged, f"{pressure} kPa: {solved[-1].status}"
        base = solved[-1].state
    seconds = (time.process_time() - begin) / len(solved)
    factorisations = sum(state.factorizations for state in solved) / len(solved)
    tip = tip_of(scene, robot.X)
    turned = angles(state.state.x[tip] for state in solved)
    return Bending(f"`{element}`, {size:g} mm", len(robot.X), factorisations, seconds, turned)


def by_calculix(cells: int, size: float, pressures: list[float], program: str, folder: Path) -> Bending:
    scene = scene_of(cells, 6.0, "tet10p0")
    deck, X = calculix_deck(scene, size, pressures)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "pneunet.inp").write_text(deck)
    before = os.times().children_user
    with (folder / "log").open("w") as log:
        subprocess.run([program, "pneunet"], cwd=folder, stdout=log, check=True)
    seconds = (os.times().children_user - before) / len(pressures)
    moved = printed(folder / "pneunet.dat")
    assert len(moved) == len(pressures), f"CalculiX ended after {len(moved)} pressures, see {folder}"
    return Bending(f"CalculiX, {size:g} mm", len(X), None, seconds, angles(X[tip_of(scene, X)] + moved))


def calculix_deck(scene: SceneSpec, size: float, pressures: list[float]) -> tuple[str, np.ndarray]:
    """Input of CalculiX, which prints the displacement of the tip after each pressure, and its nodes (n, 3) mm."""
    spec, rubber, paper = scene.geometry, scene.material, scene.layers[0]
    ticks, material = grid(scene, size)
    solid = np.argwhere(material == 1)
    number = {tuple(cell): e + 1 for e, cell in enumerate(solid)}
    corners = 2 * (solid[:, None] + CORNERS)  # places on the grid of half a cell
    places = np.concatenate([corners, *((corners[:, [a]] + corners[:, [b]]) // 2 for a, b in EDGES)], axis=1)
    used, nodes = np.unique(places.reshape(-1, 3), axis=0, return_inverse=True)
    nodes = nodes.reshape(len(solid), 20) + 1
    X = np.stack([np.interp(used[:, axis], 2 * np.arange(len(t)), t) for axis, t in enumerate(ticks)], axis=1)
    low = nodes[solid[:, 2] == 0]
    sets = {"HELD": X[:, 0] < TOUCH, "MIDDLE": X[:, 1] < TOUCH, "TIP": np.arange(len(X)) == tip_of(scene, X)}
    bulk = 4 * rubber.c1 * (1 + rubber.poisson) / (3 * (1 - 2 * rubber.poisson))

    lines = ["*NODE, NSET=ALL", *(f"{n + 1}, {x:.9g}, {y:.9g}, {z:.9g}" for n, (x, y, z) in enumerate(X))]
    lines += ["*ELEMENT, TYPE=C3D20R, ELSET=RUBBER", *numbered(nodes, 1)]
    lines += ["*ELEMENT, TYPE=M3D8, ELSET=PAPER", *numbered(low[:, [0, 1, 2, 3, 8, 9, 10, 11]], 1 + len(solid))]
    for name, members in sets.items():
        lines += [f"*NSET, NSET={name}", *(str(n + 1) for n in np.flatnonzero(members))]
    lines += ["*MATERIAL, NAME=RUBBER", "*HYPERELASTIC, YEOH"]
    lines += [f"{rubber.c1:.9g}, {rubber.c2:.9g}, 0., {2 / bulk:.9g}, 0., 0."]
    lines += ["*MATERIAL, NAME=PAPER", "*ELASTIC", f"{paper.young:.9g}, {paper.poisson:.9g}"]
    lines += ["*SOLID SECTION, ELSET=RUBBER, MATERIAL=RUBBER"]
    lines += ["*MEMBRANE SECTION, ELSET=PAPER, MATERIAL=PAPER", f"{paper.thickness:.9g}"]
    lines += ["*SURFACE INTERACTION, NAME=WALLS", "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", f"{STIFF}"]
    for gap in range(spec.cells - 1):
        left = gap * (spec.cell_length + spec.gap) + spec.cell_length
        for name, x, side, step in (("LEFT", left, 4, 1), ("RIGHT", left + spec.gap, 6, -1)):
            column = int(np.abs(ticks[0] - x).argmin()) - (step > 0)
            walls = [c for c in solid[solid[:, 0] == column] if material[c[0] + step, c[1], c[2]] == 0]
            lines += [f"*SURFACE, NAME={name}{gap}, TYPE=ELEMENT", *(f"{number[tuple(c)]}, S{side}" for c in walls)]
        lines += ["*CONTACT PAIR, INTERACTION=WALLS, TYPE=SURFACE TO SURFACE", f"LEFT{gap}, RIGHT{gap}"]
    lines += ["*BOUNDARY", "HELD, 1, 3", "MIDDLE, 2, 2"]
    inner = []
    for face, step in enumerate(SIDES):
        beside = solid + step
        inside = ((beside >= 0) & (beside < material.shape)).all(axis=1)
        rooms = [c for c, b in zip(solid[inside], beside[inside], strict=True) if material[tuple(b)] == 2]
        inner += [f"{number[tuple(c)]}, P{face + 1}" for c in rooms]
    for pressure in pressures:
        lines += ["*STEP, NLGEOM, INC=1000", "*STATIC", "0.25, 1., 1e-5, 0.5", "*DLOAD"]
        lines += [f"{where}, {1e-3 * pressure:.9g}" for where in inner]
        lines += ["*NODE PRINT, NSET=TIP, FREQUENCY=1000", "U", "*END STEP"]
    return "\n".join([*lines, ""]), X


def grid(scene: SceneSpec, size: float) -> tuple[list[np.ndarray], np.ndarray]:
    """Ticks mm along x, y > 0 and z, and what each cell is of: 0 air, 1 rubber, 2 the chamber."""
    spec, wall, half = scene.geometry, scene.geometry.wall, scene.geometry.width / 2
    starts = [cell * (spec.cell_length + spec.gap) for cell in range(spec.cells)]
    breaks_x = [x + dx for x in starts for dx in (0, wall, spec.cell_length - wall, spec.cell_length)]
    slab, roof = spec.floor + spec.duct + wall, spec.height - wall
    breaks = [breaks_x, [0, spec.duct / 2, half - wall, half]]
    breaks += [[0, spec.floor, spec.floor + spec.duct, slab, roof, spec.height]]
    ticks = [divided(places, size) for places in breaks]
    x, y, z = np.meshgrid(*[(t[1:] + t[:-1]) / 2 for t in ticks], indexing="ij")
    into = x % (spec.cell_length + spec.gap)
    above, rubber = z > spec.floor, (z < slab) | (into < spec.cell_length)
    room = (into > wall) & (into < spec.cell_length - wall) & (y < half - wall) & above & (z < roof)
    duct = (x > wall) & (x < scene.length - wall) & (y < spec.duct / 2) & above & (z < slab - wall)
    return ticks, np.where(room | duct, 2, np.where(rubber, 1, 0))


def divided(places: list[float], size: float) -> np.ndarray:
    """Ticks at the places, and between them about every `size`."""
    pieces = [np.linspace(a, b, max(1, round((b - a) / size)) + 1)[:-1] for a, b in pairwise(places)]
    return np.concatenate([*pieces, [places[-1]]])


def numbered(cells: np.ndarray, first: int) -> list[str]:
    """Lines of elements, of at most 16 numbers each."""
    texts = [[str(first + e), *map(str, cell)] for e, cell in enumerate(cells)]
    return [", ".join(text[:16]) + (",\n" + ", ".join(text[16:]) if len(text) > 16 else "") for text in texts]


def printed(path: Path) -> np.ndarray:
    """Displacements (k, 3) mm of one node that CalculiX printed after each step."""
    rows = [line.split() for line in path.read_text().splitlines()]
    return np.array([row[1:] for row in rows if len(row) == 4 and row[0].isdigit()], float).reshape(-1, 3)


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cells", type=int, default=10)
    parser.add_argument("--pressures", type=float, nargs="+", default=PRESSURES, metavar="KPA")
    parser.add_argument("--sizes", type=float, nargs="*", default=[6.0, 3.0], metavar="MM")
    parser.add_argument("--elements", nargs="+", default=["tet10p0", "tet10"], metavar="NAME")
    parser.add_argument("--hexahedra", type=float, nargs="*", default=[3.0, 2.0], metavar="MM")
    parser.add_argument("--ccx", default="ccx", metavar="PROGRAM")
    parser.add_argument("--folder", type=Path, help="where CalculiX works; a folder of its own unless given")
    asked = parser.parse_args()
    cells, pressures = asked.cells, asked.pressures
    heads = ["", "nodes", "factorisations a state", "CPU s a state", *(f"{pressure:g} kPa" for pressure in pressures)]
    print("| " + " | ".join(heads) + " |\n" + "|---" * len(heads) + "|", flush=True)
    for size in asked.sizes:
        for element in asked.elements:
            print(by_cfem(cells, size, element, pressures).row(), flush=True)
    if shutil.which(asked.ccx) is None:
        print("CalculiX is not here: `apt install calculix-ccx`, or --ccx PROGRAM")
        return
    with tempfile.TemporaryDirectory() as place:
        for size in asked.hexahedra:
            folder = (asked.folder or Path(place)) / f"{size:g}"
            print(by_calculix(cells, size, pressures, asked.ccx, folder).row(), flush=True)


if __name__ == "__main__":
    main()
