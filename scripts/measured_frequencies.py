"""Natural frequencies of the measured beam under its own weight, at the modulus that its static cases gave, beside the
measured one: measured_frequencies.py [CALIBRATED], `data/measured-beam/calibrated` unless given."""

import csv
import json
import sys
from pathlib import Path

import numpy as np

from cfem.core.spec import load_spec
from cfem.dynamics.modes import natural_modes
from cfem.dynamics.problem import MovingProblem
from cfem.equilibrium.actuation import force
from cfem.equilibrium.solve import solve
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh
from cfem.robot.spec import SceneSpec

SCENE = Path("pipelines/measured-beam/scene.yaml")
MEASURED = Path("pipelines/measured-beam/frequencies.csv")


def main() -> int:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path("data/measured-beam/calibrated")
    young = json.loads((folder / "calibration.json").read_text(encoding="utf-8"))["estimates"]["young"]
    _, mesh = load_scene_and_mesh(SCENE)
    values = [young["value"], *young["interval"]]
    found = [frequencies(mesh, value) for value in values]
    with open(MEASURED, newline="", encoding="utf-8") as file:
        measured = [float(row["natural_frequency_Hz"]) for row in csv.DictReader(file)]
    print("static modulus kPa, lowest modes Hz")
    for value, modes in zip(values, found, strict=True):
        print(f"{1e3 * value:8.1f}  " + " ".join(f"{f:.3f}" for f in modes))
    print("measured, large and small swings: " + " ".join(f"{f:.3f}" for f in measured) + " Hz")
    ratio = (np.mean(measured) / found[0][0]) ** 2
    print(f"the modulus at these frequencies is {ratio:.2f} times the static one, if nothing else differs")
    return 0


def frequencies(mesh, young: float) -> np.ndarray:
    """(3,) Hz about the equilibrium under its weight."""
    keys = [f"{one}.young={1e3 * young} kPa" for one in ("material", "materials.0.material")]
    problem = MovingProblem(build_robot(load_spec(SCENE, SceneSpec, keys), mesh))
    at = solve(problem, force(np.zeros(1)), condense=False)
    return natural_modes(problem, at.state, 3, held=force(np.zeros(1))).frequency


if __name__ == "__main__":
    sys.exit(main())
