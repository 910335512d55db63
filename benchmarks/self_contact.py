"""Self-contact of walls: error against run time. Usage: self_contact.py [--scene FILE] [--volumes MM3 ...].

The PneuNet of the catalogue is inflated to the same volumes without self-contact, with onsets from 20 to 2 % of the
gap, and with 0.5 %, the reference. A row has the distance of the tip from the reference (largest, % of the length), the
difference of the pressure (largest, %), by how much walls overlap (mm), and what a state costs: factorisations and CPU
seconds. Prints a table."""

import argparse
import time
from pathlib import Path

import numpy as np

from cfem.constraint.surface import triangulated
from cfem.contact.surface.overlap import boundary_of
from cfem.core.spec import load_spec
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import displacement
from cfem.equilibrium.system.problem import Problem
from cfem.equilibrium.system.robot import Robot
from cfem.robot.build import build_robot
from cfem.robot.mesh.accuracy import scene_mesh
from cfem.robot.spec import SceneSpec

SCENE = Path(__file__).parents[1] / "pipelines" / "pneunet" / "scene.yaml"
VOLUMES = (2000.0, 3000.0, 4500.0, 7500.0)
REFERENCE = 0.005
ONSETS = (0.2, 0.1, 0.05, 0.02)


def states(robot: Robot, volumes: list[float]) -> dict[str, np.ndarray | float]:
    """States at volumes mm^3, one after the other: tips (k, n_e) mm, pressures (k,) MPa, the deepest overlap mm, and
    factorisations and CPU seconds a state."""
    problem, base, solved = Problem(robot), None, []
    begin = time.process_time()
    for volume in volumes:
        solved.append(solve(problem, displacement(np.array([volume])), base=base))
        assert solved[-1].converged, solved[-1].status
        base = solved[-1].state
    seconds = time.process_time() - begin
    boundary = boundary_of(robot.X, triangulated(robot.body.mesh.facets))
    return {
        "tips": np.array([state.delta_e for state in solved]),
        "pressures": np.array([state.state.lam[0] for state in solved]),
        "overlap": max(boundary.overlap(state.state.x).depth for state in solved),
        "factorisations": sum(state.factorizations for state in solved) / len(solved),
        "seconds": seconds / len(solved),
    }


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scene", type=Path, default=SCENE)
    parser.add_argument("--volumes", type=float, nargs="+", default=VOLUMES)
    arguments = parser.parse_args()
    scene = load_spec(arguments.scene, SceneSpec)
    mesh, *_ = scene_mesh(scene, arguments.scene.parent)
    rows = {}
    for onset in (REFERENCE, None, *ONSETS):
        asked = scene.self_contact and onset and scene.self_contact.model_copy(update={"onset": onset})
        robot = build_robot(scene.model_copy(update={"self_contact": asked or None}), mesh)
        rows["none" if onset is None else f"{100 * onset:g} %"] = states(robot, arguments.volumes)
    exact = rows[f"{100 * REFERENCE:g} %"]
    print("| onset | tip (% of length) | pressure (%) | overlap (mm) | factorisations a state | CPU s a state |")
    print("|---|---|---|---|---|---|")
    for name, row in rows.items():
        tip = 100 * np.linalg.norm(row["tips"] - exact["tips"], axis=1).max() / scene.length
        pressure = 100 * np.abs(row["pressures"] / exact["pressures"] - 1).max()
        figures = f"{tip:.2g} | {pressure:.2g} | {row['overlap']:.2g} | {row['factorisations']:.3g}"
        print(f"| {name} | {figures} | {row['seconds']:.2g} |")


if __name__ == "__main__":
    main()
