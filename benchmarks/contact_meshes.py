"""Forces of rigid obstacles on a bar of finite elements, at nodes alone and between nodes too, on finer meshes.

python benchmarks/contact_meshes.py [--quick]

The cantilever of the tests, 60 mm long and 10 mm wide and high, of `hex8` cells of 5, 2.5 and 1.25 mm. A ball, a
capsule along the bar, an edge across it and a corner of a box come down by 1 mm in three steps, beside the nodes of all
meshes, without friction. Prints the force as a vector, how far it is from that of the finest mesh that touches between
its nodes too, and how far the surface is in the obstacle."""

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from scipy.spatial.transform import Rotation
from support.blocks import bar
from support.held_body import AtNodes

from cfem.constraint.surface import outer_surface
from cfem.constraint.surface_points import at_nodes
from cfem.contact.clearance import nearest_of_surface
from cfem.contact.obstacle import Box, Capsule, Obstacle, Sphere
from cfem.contact.obstacle_set import ObstacleSet
from cfem.equilibrium.contact.skinned_robot import SkinnedRobot
from cfem.equilibrium.contact.surfaces import SurfaceScene

PLACE, DEPTHS = np.array([41.3, 4.3, 10.0]), (0.2, 0.6, 1.0)  # mm
CELLS = ((12, 3, 2), (24, 6, 4), (48, 12, 8))
ALONG, TILTED = (Rotation.from_rotvec([0, turn, 0]).as_matrix() for turn in (np.pi / 2, np.arcsin(0.6)))
ON_CORNER = np.vstack([np.array([0, 1, -1]) / np.sqrt(2), np.array([-2, 1, 1]) / np.sqrt(6), np.ones(3) / np.sqrt(3)])
OBSTACLES: dict[str, tuple[float, Callable[[np.ndarray], Obstacle]]] = {  # height of the middle, mm
    "ball of 3 mm": (3.0, lambda t: Sphere(3.0, t=t)),
    "ball of 10 mm": (10.0, lambda t: Sphere(10.0, t=t)),
    "capsule": (2.0, lambda t: Capsule(2.0, 6.0, R=ALONG, t=t)),
    "edge": (11.2, lambda t: Box(np.full(3, 8.0), R=TILTED, t=t)),
    "corner": (4 * np.sqrt(3), lambda t: Box(np.full(3, 4.0), R=ON_CORNER, t=t)),
}


def skinned_bar(divisions: tuple[int, int, int]) -> SkinnedRobot:
    robot = bar(element="hex8", divisions=divisions, cables=1)
    surface = outer_surface(robot.X, robot.body.mesh.facets)
    points = at_nodes(robot.X, robot.body.mesh.facets, surface)
    return SkinnedRobot(robot, surface.nodes, surface.triangles, points, itself=False)


def pressed(skinned: SkinnedRobot, kind: str) -> tuple[np.ndarray, float]:
    """Force (3,) N, NaN without a state, and depth mm of the surface in the obstacle."""
    state, (height, shape) = None, OBSTACLES[kind]
    for depth in DEPTHS:
        obstacle = shape(PLACE + [0.0, 0.0, height - depth])
        state = SurfaceScene([skinned], ObstacleSet((obstacle,))).step([np.zeros(1)], state)
        if not state.converged:
            return np.full(3, np.nan), np.nan
    surface = skinned.surface(state.solved[0].state.x)
    return state.forces.sum(axis=0), -nearest_of_surface(surface, skinned.triangles, obstacle).distance


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="the two coarser meshes alone")
    given = parser.parse_args()
    meshes = [skinned_bar(divisions) for divisions in CELLS[: 2 if given.quick else 3]]
    for kind in OBSTACLES:
        answers = {
            name: [pressed(touch(mesh), kind) for mesh in meshes]
            for name, touch in (("at nodes alone", AtNodes.of), ("between nodes too", lambda mesh: mesh))
        }
        exact = answers["between nodes too"][-1][0]
        for name, each in answers.items():
            for divisions, (force, depth) in zip(CELLS, each, strict=False):
                off = 100 * np.linalg.norm(force - exact) / np.linalg.norm(exact)
                vector = ", ".join(f"{1e3 * part:.1f}" for part in force)
                cell = 60 / divisions[0]
                print(f"{kind}, {name}, cells of {cell:g} mm: {vector} mN, {off:.0f} % off; {depth:.3f} mm deep")


if __name__ == "__main__":
    main()
