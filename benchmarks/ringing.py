"""A finger that rings: its shape, from noisy markers, by the static filter and by the one on the condensed dynamics.

python benchmarks/ringing.py SCENE MODEL [--seeds 20] [--noise 0.1] [--markers 5] [--rate 100] [--push 0.02]
                             [--stroke 3] [--stiffer 1.0] [--lost 0.05] [--wrong 0.02]

Truth is the robot in full finite elements, --stiffer times the model's Young's modulus: its cables are pulled or let
go by up to --stroke mm within one frame, three times, and a push of unknown direction appears. Five such motions, so
many seeds of noise. A share of the markers is lost, and a share is another point, 20 mm away. Prints the error of the
whole surface while it swings and in all frames, of the push at the end, the share of 95 % intervals that hold, and the
innovations over what the filter says of them."""

import argparse
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from cfem.motion.estimation.marker_filter import MarkerFilter
from cfem.motion.estimation.uncertainty import MotionUncertainty
from cfem.motion.load import load_motion
from cfem.plant.fem_plant import pushed
from cfem.plant.marked_plant import MarkedPlant
from cfem.plant.marker_noise import MarkerNoise
from cfem.plant.moving_plant import MovingFemPlant
from cfem.predict.estimation.estimate import Estimator
from cfem.predict.estimation.filter import Filter
from cfem.predict.estimation.markers import markers_near
from cfem.predict.load import load_model
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh

SECONDS, SINCE = 2.0, 1.2  # of a run; when the push appears
SLIP, OFFSET = 0.01, 0.05  # mm


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", type=Path)
    parser.add_argument("model", type=Path)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--noise", type=float, default=0.1)
    parser.add_argument("--markers", type=int, default=5)
    parser.add_argument("--rate", type=float, default=100.0)
    parser.add_argument("--push", type=float, default=0.02)
    parser.add_argument("--stiffer", type=float, default=1.0)
    parser.add_argument("--stroke", type=float, default=3.0)
    parser.add_argument("--lost", type=float, default=0.05)
    parser.add_argument("--wrong", type=float, default=0.02)
    given = parser.parse_args()
    model, motion = load_model(given.model), load_motion(given.model)
    places = markers_near(model, given.markers)
    tip = model.rows.effectors[:3]
    found = {"static": [], "dynamic": []}
    for run in range(given.runs):
        commands, truth, push = moved(given, model, places, run)
        for seed in range(given.seeds):
            estimator = Estimator(model, places, given.noise, tip, given.push / np.sqrt(3))
            camera = MarkerNoise(given.noise, given.lost, given.wrong, 20.0, seed=1000 * run + seed)
            frames = [camera.seen(one) for one in truth]
            unknown = MotionUncertainty(SLIP * np.sqrt(given.rate), OFFSET, 0.05 * model.length, lasts=1.0)
            filters = {
                "static": Filter(estimator, SLIP, given.rate, OFFSET),
                "dynamic": MarkerFilter(estimator, motion, "displacement", unknown),
            }
            for name, one in filters.items():
                found[name].append(judged(given, one, name, commands, frames, truth, push, model))
    print(f"{given.runs} motions in finite elements, {given.seeds} seeds of noise each: {given.markers} markers, "
          f"{given.noise} mm, {given.rate:g} Hz, Young's modulus {given.stiffer:g} of the model's")  # fmt: skip
    print("means over runs: filter | surface rms mm while it swings: median | 95 % | all frames: median | tip rms mm | "
          "push at the end, error % | ",
          "95 % intervals that hold: actuators | push | innovations | no estimate % | ms a frame", sep="")  # fmt: skip
    for name, rows in found.items():
        print(f"{name} | " + " | ".join(f"{one:.3g}" for one in np.array(rows).mean(axis=0)))


def moved(given, model, places, run):
    """Commands (f, n_a) mm, what happened in each frame, and the push (3,) N."""
    rng = np.random.default_rng(run)
    scene, nodes = load_scene_and_mesh(given.scene)
    robot = build_robot(scene, nodes)
    if given.stiffer != 1.0:
        from cfem.core.spec import load_spec
        from cfem.robot.spec import SceneSpec

        young = f"material.young={3000 * given.stiffer} kPa"
        robot = build_robot(load_spec(given.scene, SceneSpec, [young]), nodes)
    direction = rng.normal(size=3)
    push = given.push * direction / np.linalg.norm(direction)
    period, count = 1 / given.rate, round(SECONDS * given.rate)
    on_tip = np.concatenate([push, np.zeros(model.rows.n_e - 3)])
    plant = MovingFemPlant(
        robot, period, max(1, round(400 / given.rate)), pushed(robot, on_tip), round(SINCE * given.rate)
    )
    states = model.domain.states[:, : model.rows.n_a]
    about = states.mean(axis=0) + 0.3 * (states[rng.integers(len(states))] - states.mean(axis=0))
    stops = about + given.stroke * rng.uniform(-1, 1, (3, model.rows.n_a))
    commands = stops[np.minimum(np.arange(count) * 3 // count, 2)]
    seen = MarkedPlant(plant, robot, places, model.skin.rest)
    seen.settle(commands[0])
    return commands, [replace(seen.step(u), t=k) for k, u in enumerate(commands)], push


def judged(given, one, name, commands, frames, truth, push, model):
    shape, swings, inside, tip, nis, lost = [], [], [], [], [], 0
    begin = time.process_time()
    answers = []
    for k, frame in enumerate(frames):
        more = {"after": 1 / given.rate} if name == "dynamic" else {}
        answers.append(one.tick(frame.markers, None, commands[k], **more))
        if answers[-1].converged:
            nis.append(answers[-1].innovation)
    cost = (time.process_time() - begin) / len(frames)
    since, before = round(SINCE * given.rate), None
    for k, (found, true) in enumerate(zip(answers, truth, strict=True)):
        apart = model.skin.surface(found.rows) - true.surface
        shape.append(np.sqrt((apart**2).sum(axis=1).mean()))
        speed = 0.0 if before is None else np.sqrt(((true.surface - before) ** 2).sum(axis=1).mean())
        swings.append(speed > 0.05)
        before = true.surface
        lost += not found.converged
        tip.append(np.linalg.norm(model.rest_e[:3] + found.delta_e[:3] - true.x_e[:3]))
        x = np.concatenate([true.delta_a, push if k + 1 >= since else 0 * push])
        if k > 20:
            z = (np.concatenate([found.delta_a, found.loads]) - x) / found.deviation
            inside.append(np.abs(z) < 1.96)
    shape, swings, inside = np.array(shape), np.array(swings), np.array(inside)
    n_a = model.rows.n_a
    end = np.linalg.norm(answers[-1].loads - push) / given.push
    ratio = np.nan if not nis else np.sum(nis, axis=0)[0] / np.sum(nis, axis=0)[1]
    return (
        np.median(shape[swings]),
        np.quantile(shape[swings], 0.95),
        np.median(shape),
        np.sqrt(np.mean(np.square(tip))),
        100 * end,
        100 * inside[:, :n_a].mean(),
        100 * inside[:, n_a:].mean(),
        ratio,
        100 * lost / len(frames),
        1e3 * cost,
    )


if __name__ == "__main__":
    main()
