"""The whole shape and an unknown push from a few noisy markers on the finite-element robot.

python benchmarks/estimate.py SCENE MODEL [--states 20] [--frames 200] [--seeds 1000] [--markers 5] [--noise 0.1]
                              [--push 0.02] [--tension 0.02] [--along] [--bound]

Each state has random displacements of the actuators, a push of stated size (N) in a random direction at the first
effector, noise on markers, 0.05 mm on the actuators' displacements and, with --tension, so much (N) on their forces.
With --along, the direction of the push is known, as that of a push along the surface's normal at a known place. The
robot holds still for all frames, whose noise differs. Prints errors of the surface (root mean square, mm) and of the
push, one frame alone and after all; the share of 95 % intervals that hold, on finite elements and, for loads, slips and
noise drawn as the filter assumes, on so many seeds of the model; and what an estimate costs. With --bound, prints only
the least error of the push that any estimate can promise, by frames and markers."""

import argparse
import time
from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np

from cfem.plant.fem_plant import FemPlant, pushed
from cfem.predict.estimation.estimate import Estimator
from cfem.predict.estimation.filter import Filter
from cfem.predict.estimation.markers import markers_near
from cfem.predict.estimation.push_bound import Seen, frames_for, push_errors
from cfem.predict.load import load_model
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh

SENSOR, SLIP = 0.05, 0.001
MARKS = (1, 5, 20, 50, 100, 200, 500)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", type=Path)
    parser.add_argument("model", type=Path)
    parser.add_argument("--states", type=int, default=20)
    parser.add_argument("--frames", type=int, default=200)
    parser.add_argument("--seeds", type=int, default=1000)
    parser.add_argument("--markers", type=int, default=5)
    parser.add_argument("--noise", type=float, default=0.1)
    parser.add_argument("--push", type=float, default=0.02)
    parser.add_argument("--tension", type=float)
    parser.add_argument("--along", action="store_true")
    parser.add_argument("--bound", action="store_true")
    given = parser.parse_args()
    model, robot = load_model(given.model), build_robot(*load_scene_and_mesh(given.scene))
    tip = model.rows.effectors[:3]
    if given.bound:
        return bound(given, model, tip)
    places = markers_near(model, given.markers)
    estimator = Estimator(model, places, given.noise, tip, given.push, SENSOR, given.tension or 1.0)
    finite_elements(given, model, robot, estimator)
    drawn(given, estimator)


def bound(given, model, tip) -> None:
    """A direction known: the median of those of so many states."""
    rng, states = np.random.default_rng(0), model.domain.states[:, : model.rows.n_a]
    drawn = [(states[rng.integers(len(states))], rng.normal(size=3)) for _ in range(given.states)]
    seen = Seen(SLIP, 1.0, sensed=True, forces=bool(given.tension))
    print(
        "least error of the push %, median of states, after frames: " + " ".join(map(str, MARKS)) + " | frames for 10 %"
    )
    for count in (5, 10, 20, 40):
        places, rows, enough = markers_near(model, count), [], []
        for delta, direction in drawn:
            along = direction if given.along else None
            size = given.push / (1 if given.along else np.sqrt(3))
            one = Estimator(model, places, given.noise, tip, size, SENSOR, given.tension or 1.0, along=along)
            errors = list(islice(push_errors(one, delta, seen), MARKS[-1]))
            rows.append([errors[mark - 1] for mark in MARKS])
            enough.append(frames_for(one, delta, seen, 0.1) or np.inf)
        told = " ".join(f"{100 * one:.0f}" for one in np.median(rows, axis=0))
        print(f"{count} markers: {told} | {np.median(enough):.0f}")


def finite_elements(given, model, robot, estimator) -> None:
    rng, marks = np.random.default_rng(0), [one for one in MARKS if one <= given.frames]
    found, seconds = {one: [] for one in marks}, {"first": [], "next": []}
    for _ in range(given.states):
        states = model.domain.states[:, : model.rows.n_a]
        delta, direction = states[rng.integers(len(states))], rng.normal(size=3)
        push = np.zeros(model.rows.n_e)
        push[:3] = given.push * direction / np.linalg.norm(direction)
        plant = FemPlant(pushed(robot, push))
        plant.at_displacement(delta)
        surface = plant.x[model.skin.nodes]
        knowing = replace(estimator, along=direction) if given.along else estimator
        truth, filtered = np.concatenate([delta, push[:3]]), Filter(knowing, SLIP, 100 * given.frames)
        for frame in range(1, given.frames + 1):
            markers = estimator.seen(surface) + given.noise * rng.normal(size=estimator.markers.shape)
            sensed = delta + SENSOR * rng.normal(size=len(delta))
            forces = plant.state.lambda_a + given.tension * rng.normal(size=len(delta)) if given.tension else None
            begin = time.thread_time()
            one = filtered.tick(markers, sensed, delta, forces)
            seconds["first" if frame == 1 else "next"].append(time.thread_time() - begin)
            if frame in found:
                apart = model.skin.surface(one.rows) - surface
                shape = np.sqrt((apart**2).sum(axis=1).mean())
                z = (np.concatenate([one.delta_a, one.loads]) - truth) / one.deviation
                off = np.linalg.norm(one.loads - push[:3])
                told = np.sqrt(np.trace(one.covariance[-3:, -3:])) / given.push
                found[frame].append((shape, off / given.push, told, np.mean(np.abs(z) < 1.96)))
    print(f"{given.states} FE states, {given.markers} markers, push {1e3 * given.push:.0f} mN at the tip, tension "
          f"{'not measured' if not given.tension else f'{1e3 * given.tension:.0f} mN'}, direction "
          f"{'known' if given.along else 'unknown'}")  # fmt: skip
    print("frame | shape, median and largest rms mm | push, median error % | its standard deviation % | "
          "intervals hold %")  # fmt: skip
    for frame, rows in found.items():
        shape, off, told, held = np.array(rows).T
        print(f"{frame} | {np.median(shape):.3f} {shape.max():.3f} | {100 * np.median(off):.0f} | "
              f"{100 * np.median(told):.0f} | {100 * held.mean():.0f}")  # fmt: skip
    cost = {name: 1e3 * np.median(values) for name, values in seconds.items()}
    print(f"estimate: median {cost['first']:.2f} ms of CPU for a first one, {cost['next']:.2f} ms for the next ones")


def drawn(given, estimator) -> None:
    """Coverage where all is as the filter assumes: moving actuators, loads that come and go."""
    n_a, ticks, slip, offset, inside = estimator.model.rows.n_a, 50, 0.01, 0.3, []
    rho, states = np.exp(-1 / ticks), estimator.model.domain.states[:, : estimator.model.rows.n_a]
    for seed in range(given.seeds):
        rng = np.random.default_rng(seed)
        u, w = states[rng.integers(len(states))].copy(), estimator.largest * rng.normal(size=3)
        delta, filtered = u + offset * rng.normal(size=n_a), Filter(estimator, slip, ticks, offset)
        for frame in range(20):
            if frame:
                step = rng.uniform(-0.2, 0.2, n_a)
                u, delta = u + step, delta + step + slip * rng.normal(size=n_a)
                w = rho * w + np.sqrt(1 - rho**2) * estimator.largest * rng.normal(size=3)
            x = np.concatenate([delta, w])
            seen = estimator.places(x) + given.noise * rng.normal(size=estimator.markers.shape)
            forces = estimator.tensions(x) + given.tension * rng.normal(size=n_a) if given.tension else None
            one = filtered.tick(seen, delta + SENSOR * rng.normal(size=n_a), u, forces)
        inside.append(np.abs(np.concatenate([one.delta_a, one.loads]) - x) < 1.96 * one.deviation)
    share, by = 100 * np.mean(inside), 100 * np.mean(inside, axis=0)
    print(f"{given.seeds} seeds of the model, 20 moving frames each: 95 % intervals hold in {share:.1f} % "
          f"({', '.join(f'{name} {one:.1f}' for name, one in zip(estimator.unknowns, by, strict=True))})")  # fmt: skip


if __name__ == "__main__":
    main()
