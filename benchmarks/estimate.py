"""The whole shape and an unknown push from a few noisy markers on the finite-element robot.

python benchmarks/estimate.py SCENE MODEL [--states 20] [--markers 5] [--noise 0.1] [--push 0.02]

Each state has random displacements of the actuators, a push of stated size (N) in a random direction at the first
effector, noise on markers and 0.05 mm on the actuators' sensors. Prints errors of the surface (root mean square, mm),
of the components of the push that the estimate itself calls observed, and the share of 95 % intervals that hold."""

import argparse
import time
from pathlib import Path

import numpy as np

from cfem.plant.fem_plant import FemPlant, pushed
from cfem.predict.estimate import Estimator
from cfem.predict.load import load_model
from cfem.predict.markers import markers_near
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh

SENSOR = 0.05


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scene", type=Path)
    parser.add_argument("model", type=Path)
    parser.add_argument("--states", type=int, default=20)
    parser.add_argument("--markers", type=int, default=5)
    parser.add_argument("--noise", type=float, default=0.1)
    parser.add_argument("--push", type=float, default=0.02)
    given = parser.parse_args()
    model, robot = load_model(given.model), build_robot(*load_scene_and_mesh(given.scene))
    tip = model.rows.effectors[:3]
    estimator = Estimator(model, markers_near(model, given.markers), given.noise, tip, given.push, SENSOR)
    rng, shapes, pushes, inside, seconds = np.random.default_rng(0), [], [], [], []
    for _ in range(given.states):
        states = model.domain.states[:, : model.rows.n_a]
        delta, direction = states[rng.integers(len(states))], rng.normal(size=3)
        push = np.zeros(model.rows.n_e)
        push[:3] = given.push * direction / np.linalg.norm(direction)
        plant = FemPlant(pushed(robot, push))
        plant.at_displacement(delta)
        surface = plant.x[model.skin.nodes]
        markers = estimator.seen(surface) + given.noise * rng.normal(size=estimator.markers.shape)
        sensed = delta + SENSOR * rng.normal(size=len(delta))
        begin = time.perf_counter()
        found = estimator.estimate(markers, sensed)
        seconds.append(time.perf_counter() - begin)
        apart = model.skin.surface(found.rows) - surface
        shapes.append(np.sqrt((apart**2).sum(axis=1).mean()))
        seen = np.array([name not in found.unseen for name in tip])
        pushes.extend(np.abs(found.loads - push[:3])[seen] / given.push)
        z = (np.concatenate([found.delta_a, found.loads]) - np.concatenate([delta, push[:3]])) / found.deviation
        inside.append(np.abs(z) < 1.96)
    print(f"shape: median {np.median(shapes):.3f} mm rms, largest {max(shapes):.3f} mm, {given.states} states")
    print(f"push: {len(pushes)} of {3 * given.states} components observed", end="")
    print(f", error median {100 * np.median(pushes):.0f} % of {1e3 * given.push:.0f} mN" if pushes else "")
    print(f"95 % intervals that hold: {100 * np.mean(inside):.1f} %")
    print(f"estimate: median {1e3 * np.median(seconds):.1f} ms")


if __name__ == "__main__":
    main()
