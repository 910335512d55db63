"""A learned robot pressed onto obstacles at unseen places, against finite elements whose surface touches the same.

python benchmarks/contact_anywhere.py SCENE MODEL [--places 30] [--patches 6]

A sphere, a plane or the edge of a box is put against a random patch of the robot at a random pull, so deep that the
robot gives way by 0.3 to 1.5 mm. The finite-element truth (`cfem.equilibrium.press`) has the same patches for contact
points. Prints the largest and the median error of force and tip, and the time of a learned step."""

import argparse
import time
from pathlib import Path

import numpy as np

from cfem.contact.obstacle import Box, Obstacle, Plane, Sphere, tangents
from cfem.equilibrium.actuation import displacement
from cfem.equilibrium.patch_compliance import patch_compliance, with_patches
from cfem.equilibrium.press import press
from cfem.equilibrium.problem import Problem
from cfem.predict.load import load_model
from cfem.predict.touching import Touchable, patches_of
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh


def placed(kind: str, point: np.ndarray, normal: np.ndarray, depth: float, size: float) -> Obstacle:
    """An obstacle that reaches `depth` mm into the body at `point`, where the body's surface has the outward normal."""
    away = -tangents(-normal[None])[0]
    R = np.stack([away[1], away[2], -normal], axis=1)
    R[:, 0] *= np.sign(np.linalg.det(R))
    if kind == "sphere":
        return Sphere(size, t=point + (size - depth) * normal)
    if kind == "plane":
        return Plane(R=R, t=point - depth * normal)
    turn = np.array([[1.0, 0, 0], [0, np.sqrt(0.5), -np.sqrt(0.5)], [0, np.sqrt(0.5), np.sqrt(0.5)]])  # edge first
    return Box(np.array([size / 4, size, size]), R=R @ turn, t=point + (np.sqrt(2) * size - depth) * normal)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scene", type=Path)
    parser.add_argument("model", type=Path)
    parser.add_argument("--places", type=int, default=30)
    parser.add_argument("--patches", type=float, default=6.0, help="distance of patches, mm")
    parser.add_argument("--mu", type=float, default=0.0)
    given = parser.parse_args()
    model, robot = load_model(given.model), build_robot(*load_scene_and_mesh(given.scene))
    patches = patches_of(model, given.patches)
    begin = time.perf_counter()
    own = patch_compliance(robot, model.skin.nodes, patches, np.zeros(robot.rows.n_a))
    touchable = Touchable(model, patches, own)
    print(f"{len(patches)} patches, their compliance in {time.perf_counter() - begin:.1f} s; {len(model.skin)} modes")
    size = np.diag(own).reshape(-1, 3).sum(axis=1)
    loose = np.flatnonzero(size > 0.1 * size.max())
    rng, forces, tips, seconds = np.random.default_rng(0), [], [], []
    for place in range(given.places):
        states = model.domain.states[:, : model.rows.n_a]
        delta = states[rng.integers(len(states))]
        at, number = patches.mean(model.shape(delta)), rng.choice(loose)
        corners = model.shape(delta)[model.facets[(patches.of[model.facets] == number).any(axis=1)]]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]).sum(axis=0)
        normal /= np.linalg.norm(normal)
        kind, depth = ("sphere", "plane", "edge")[place % 3], rng.uniform(0.3, 1.5)
        if kind == "plane":  # the foremost patch decides how deep
            number = int(np.argmax(at @ normal))
        obstacle = placed(kind, at[number], normal, depth, 8.0)
        if size[obstacle.distance(at) < 0].min() < 0.1 * size.max():
            print(f"  {kind:6s} at patch {number}: left out, it would reach where the body is held")
            continue
        touchable.at(delta, [obstacle], mu=given.mu)
        begin = time.perf_counter()
        found = touchable.at(delta, [obstacle], mu=given.mu)
        seconds.append(time.perf_counter() - begin)
        if not found.converged:
            print(f"  {kind:6s} at patch {number}: {found.status.value}")
            continue
        near = np.union1d(found.patches, np.flatnonzero(obstacle.distance(at) < 1.0))
        touched = Problem(with_patches(robot, model.skin.nodes, patches, near))
        truth = press(touched, displacement(delta), [obstacle] * len(near), mu=given.mu)
        if not truth.converged:
            print(f"  {kind:6s} at patch {number}: finite elements: {truth.status.value}")
            continue
        solved, mine = truth.solved[0], np.zeros((len(patches), 3))
        mine[found.patches] = found.forces
        exact = solved.lambda_c.reshape(-1, 3)
        largest = np.linalg.norm(exact, axis=1).max()
        forces.append(np.linalg.norm(mine[near] - exact, axis=1).max() / largest)
        tips.append(np.linalg.norm(found.delta_e - solved.delta_e))
        moved = np.linalg.norm(solved.delta_e - model.at_displacement(delta).delta_e)
        print(
            f"  {kind:6s} {depth:.2f} mm: largest force {largest:.3f} N on {np.sum(exact.any(axis=1))} of {len(near)}, "
            f"worst error {100 * forces[-1]:.1f} %; tip moved {moved:.2f} mm, error {tips[-1]:.3f} mm",
            flush=True,
        )
    for name, values, unit in (("force", 100 * np.array(forces), "%"), ("tip", np.array(tips), "mm")):
        print(
            f"{name}: median {np.median(values):.3g} {unit}, largest {values.max():.3g} {unit} of {len(values)} places"
        )
    print(f"step: median {1e3 * np.median(seconds):.2f} ms")


if __name__ == "__main__":
    main()
