"""What the size of the patches costs, and what it leaves: the finite-element finger against plane, box and ball.

python benchmarks/contact_patches.py [--patches 4 6 8 12]

The soft finger bends in three steps onto an obstacle that its sharp edge meets first (plane, box) or its face (ball).
Each size of patches, with and without `sharp_edges`, is compared with patches of 2 mm: force on the obstacle and place
of the tip at the steps that press, how deep the surface is in the obstacle between the patches, and processor time."""

import argparse
import time
from pathlib import Path

import numpy as np

from cfem.condensed.patches import cut
from cfem.constraint.surface import Surface, outer_surface
from cfem.contact.obstacle import Box, Obstacle, Plane, Sphere
from cfem.equilibrium.contact.skinned_robot import SkinnedRobot
from cfem.equilibrium.system.robot import Robot
from cfem.plant.touch_plant import TouchPlant
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh

SCENE = Path("pipelines/soft-finger/scene.yaml")
PULLS = (2.0, 3.0, 4.0)  # mm of both cables
FINEST = 2.0  # mm
OBSTACLES: dict[str, Obstacle] = {
    "plane": Plane(R=np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]), t=np.array([0.0, 28.0, 0.0])),
    "box": Box(np.array([20.0, 5.0, 5.0]), t=np.array([0.0, 33.0, -96.0])),
    "ball": Sphere(8.0, t=np.array([0.0, 34.0, -90.0])),
}


def pressed(robot: Robot, surface: Surface, obstacle: Obstacle, apart: float, sharp: bool) -> tuple:
    """Number of patches, forces (k,) N and tips (k, 3) mm at PULLS, depth (mm), processor time (s)."""
    patches = cut(surface.rest, surface.weights, apart, surface.triangles, sharp)
    plant = TouchPlant(SkinnedRobot(robot, surface.nodes, surface.triangles, patches), {"it": obstacle}, ("it",))
    begin, found = time.process_time(), []
    for pull in PULLS:
        step = plant.step(np.array([pull, pull]))
        if step.status != "converged":
            raise SystemExit(f"patches of {apart:g} mm: {step.status}")
        found.append(step.x_e)
    ends = np.array(found)
    return len(patches), ends[:, 3], ends[:, :3], plant.deepest[0], time.process_time() - begin


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--patches", type=float, nargs="+", default=[4.0, 6.0, 8.0, 12.0], help="mm")
    given = parser.parse_args()
    robot = build_robot(*load_scene_and_mesh(SCENE))
    surface = outer_surface(robot.X, robot.body.mesh.facets)
    for name, obstacle in OBSTACLES.items():
        _, forces, tips, deep, cost = pressed(robot, surface, obstacle, FINEST, True)
        some = forces > 0
        print(
            f"{name}: {', '.join(f'{one:.3f}' for one in forces[some])} N with patches of {FINEST:g} mm; {cost:.1f} s"
        )
        for apart in given.patches:
            for sharp in (False, True):
                count, force, tip, deep, cost = pressed(robot, surface, obstacle, apart, sharp)
                off = np.abs(force / np.where(some, forces, 1.0) - 1)[some].max()
                away = np.linalg.norm(tip - tips, axis=1).max()
                print(
                    f" {apart:3g} mm{', sharp edges' if sharp else '':13s}: {count:3d} patches, force {100 * off:5.1f} "
                    f"% off, tip {away:.3f} mm off, {deep:.3f} mm deep, {cost:.1f} s",
                    flush=True,
                )


if __name__ == "__main__":
    main()
