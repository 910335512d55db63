"""A learned robot pressed onto obstacles at unseen places, against finite elements whose surface touches the same.

python benchmarks/contact_anywhere.py SCENE MODEL [--places 30] [--patches 6] [--mu 0.5] [--seed 1]

A sphere, a plane or the edge of a box comes to a random patch of the robot at a random pull and moves on, until the
robot gives way by 0.3 to 1.5 mm: in three steps, as where a patch comes to lie beside an edge depends on the way. The
edge is a quarter of the depth aside of the patch. The finite-element truth (`cfem.equilibrium.contact.obstacles`) has
the same patches for contact points. Prints the largest and the median error of force and tip, and the processor time
of a learned step: with one obstacle, and with ten pads, each of which presses on one patch, the latter in C too, and
alone with `--places 0`."""

import argparse
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from cfem.condensed.patches import Patches
from cfem.contact.obstacle import Box, Obstacle, Plane, Sphere, tangents
from cfem.contact.obstacle_set import ObstacleSet
from cfem.core.artefact.content import artefact_content
from cfem.equilibrium.contact.obstacles import obstacle_step
from cfem.equilibrium.contact.patch_compliance import with_patches
from cfem.equilibrium.system.actuation import displacement
from cfem.equilibrium.system.problem import Problem
from cfem.export.compiled.build import compiler
from cfem.export.compiled.touch import CompiledTouch
from cfem.export.firmware.folder import write_c
from cfem.export.firmware.touch import write_c_touch
from cfem.export.spec import CSpec
from cfem.predict.contact.kept_patches import patched_model_of
from cfem.predict.contact.patched_model import PatchedModel
from cfem.predict.contact.scene import contact_step
from cfem.predict.load import load_model, read_model, read_vectors
from cfem.predict.protocol import Predictor
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh
from cfem.robot.spec import scene_meaning

IN = np.arange(1, 11) / 100  # mm: depths of pads


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
    if kind == "pad":
        return Box(np.array([2.0, 2.0, 1.0]), R=R, t=point + (1.0 - depth) * normal)
    return Box(np.array([size / 4, size, size]), R=R @ turn, t=point + (np.sqrt(2) * size - depth) * normal)


def moved(obstacle: Obstacle, by: np.ndarray) -> Obstacle:
    return replace(obstacle, t=obstacle.t + by)


def outward(model: Predictor, patches: Patches, x: np.ndarray, number: int) -> np.ndarray:
    """(3,) mean normal of a patch, surface nodes at x (m, 3)."""
    corners = x[model.facets[(patches.of[model.facets] == number).any(axis=1)]]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]).sum(axis=0)
    return normal / np.linalg.norm(normal)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scene", type=Path)
    parser.add_argument("model", type=Path)
    parser.add_argument("--places", type=int, default=30)
    parser.add_argument("--patches", type=float, default=6.0, help="distance of patches, mm")
    parser.add_argument("--mu", type=float, default=0.0)
    parser.add_argument("--seed", type=int, default=0, help="of the places")
    given = parser.parse_args()
    scene, mesh = load_scene_and_mesh(given.scene)
    model, robot = load_model(given.model), build_robot(scene, mesh)
    made_of = {
        "scene": scene_meaning(given.scene),
        "mesh": artefact_content(given.scene.parent / scene.out),
        "loads": {},
    }
    patched = patched_model_of(model, given.model, robot, made_of, given.patches)
    patches, own = patched.patches, patched.by_fe.own
    print(f"{len(patches)} patches, their compliance at {len(patched.by_fe.states)} states; {len(model.skin)} modes")
    size = np.diag(own[0]).reshape(-1, 3).sum(axis=1)
    loose = np.flatnonzero(size > 0.1 * size.max())
    rng, forces, tips, seconds, failed = np.random.default_rng(given.seed), [], [], [], 0
    place = -1
    while len(forces) + failed < given.places:
        place += 1
        states = model.domain.states[:, : model.rows.n_a]
        delta = states[rng.integers(len(states))]
        x, number = model.shape(delta), rng.choice(loose)
        at, normal = patches.mean(x), outward(model, patches, x, number)
        kind, depth = ("sphere", "plane", "edge")[place % 3], rng.uniform(0.3, 1.5)
        if kind == "plane":  # the foremost patch decides how deep
            number = int(np.argmax(at @ normal))
        obstacle = placed(kind, at[number], normal, depth, 8.0)
        if kind == "edge":
            obstacle = moved(obstacle, depth / 4 * np.cross(obstacle.R[:, 0], normal))
        for _ in range(10):  # back, where other patches are deeper in it
            obstacle = moved(obstacle, max(0.0, -obstacle.distance(at).min() - depth) * normal)
        if size[obstacle.distance(at) < 0].min(initial=np.inf) < 0.1 * size.max():
            continue  # it would reach where the body is held, and hardly gives way: another place
        near, steps = np.flatnonzero((obstacle.distance(at) < 1.0) & ~patched.held_still), (0.05, 0.5, 1.0)
        problem, found, truth = Problem(with_patches(robot, model.skin.nodes, patches, near)), None, None
        for share in steps:
            here = moved(obstacle, (1 - share) * depth * normal)
            begin = time.process_time()
            found = contact_step(patched, delta, [here], mu=given.mu, before=found, unilateral=robot.unilateral)
            seconds.append(time.process_time() - begin)
            truth = obstacle_step(problem, displacement(delta), [here] * len(near), mu=given.mu, before=truth)
        if not (found.converged and truth.converged):
            failed += 1
            print(f"  {kind:6s} at patch {number}: {found.status.value}; finite elements: {truth.status.value}")
            continue
        solved, mine = truth.solved[0], found.forces
        exact = solved.lambda_c.reshape(-1, 3)
        largest = np.linalg.norm(exact, axis=1).max()
        unseen = np.delete(np.linalg.norm(mine, axis=1), near).max()
        forces.append(max(np.linalg.norm(mine[near] - exact, axis=1).max(), unseen) / largest)
        tips.append(np.linalg.norm(found.delta_e[0] - solved.delta_e))
        away = np.linalg.norm(solved.delta_e - model.at_displacement(delta).delta_e)
        print(
            f"  {kind:6s} {depth:.2f} mm: largest force {largest:.3f} N on {np.sum(exact.any(axis=1))} of {len(near)}, "
            f"worst error {100 * forces[-1]:.1f} %; tip moved {away:.2f} mm, error {tips[-1]:.3f} mm"
            f"{'' if found.trusted else '; NOT KNOWN'}",
            flush=True,
        )
    if forces:
        for name, values, unit in (("force", 100 * np.array(forces), "%"), ("tip", np.array(tips), "mm")):
            middle, largest = f"{np.median(values):.3g} {unit}", f"{values.max():.3g} {unit}"
            print(f"{name}: median {middle}, largest {largest} of {len(values)} places")
        print(f"step with one obstacle: median {1e3 * np.median(seconds):.2f} ms")
    for _ in range(4):
        ten_pads(given.model, patched, rng.choice(loose, 10, replace=False), given.mu)


def ten_pads(folder: Path, patched: PatchedModel, where: np.ndarray, mu: float) -> None:
    """Prints what a step costs where ten patches are pressed at once, by pads that have come 0.1 mm in, in steps."""
    model, patches = patched.model, patched.patches
    delta = model.domain.states[0, : model.rows.n_a]
    x, before, spent = model.shape(delta), None, []
    ways = [
        [placed("pad", patches.mean(x)[p], outward(model, patches, x, p), depth, 0.0) for p in where] for depth in IN
    ]
    for pads in ways:
        found = contact_step(patched, delta, ObstacleSet(tuple(pads)), mu=mu, before=before)
        before = found if found.converged else before
    if not found.converged:
        print(f"ten pads: {found.status.value}")
        return
    together = ObstacleSet(tuple(ways[-1]))
    for step in range(200):
        begin = time.process_time()
        before = contact_step(patched, delta * (1 + 1e-4 * step), together, mu=mu, before=before)
        spent.append(1e3 * (time.process_time() - begin))
        if not before.converged:
            print(f"ten pads, step {step}: {before.status.value}")
            return
    pressed, most = np.sum(before.forces.any(axis=1)), np.linalg.norm(before.forces, axis=1).max()
    cost = f"least {min(spent):.2f} ms, median {np.median(spent):.2f} ms"
    print(f"step with ten pads, {pressed} pressed, {most:.1f} N at most: {cost}")
    if compiler():
        print(f"the same in C: {in_c(folder, patched, delta, ways, mu)}")


def in_c(folder: Path, patched: PatchedModel, delta: np.ndarray, ways: list[list[Obstacle]], mu: float) -> str:
    """Time of a step, the least of a hundred means of ten."""
    meta, arrays = read_model(folder)
    with tempfile.TemporaryDirectory() as place:
        write_c(Path(place), meta, arrays, CSpec(), read_vectors(folder, meta)["s"])
        write_c_touch(Path(place), patched, ways[-1], mu, np.zeros(len(delta)))
        compiled = CompiledTouch(Path(place))
    statuses = [compiled(delta, pads, mu).status for pads in ways]
    if statuses[-1]:
        return f"status {statuses[-1]}"
    return f"{1e6 * min(compiled.seconds(delta * (1 + 1e-4), ways[-1], mu, 10) for _ in range(100)):.0f} us"


if __name__ == "__main__":
    main()
