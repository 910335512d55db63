"""A learned robot pressed onto obstacles at unseen places, against finite elements whose surface touches the same.

python benchmarks/contact_anywhere.py SCENE MODEL [--places 30] [--patches 6] [--mu 0.5] [--seed 1]

The places are those of `cfem.surrogate.contact_error`: a sphere, a plane or the edge of a box comes in by 0.25 to
1.25 % of the length. Prints the largest and the median error of force and tip; whether bounds of the sum of forces and
of the tip, made at half of the places, hold at the others; and the processor time of a learned step with ten pads, each
of which presses on one patch, in C too, and alone with `--places 0`."""

import argparse
import tempfile
import time
from itertools import islice
from pathlib import Path

import numpy as np

from cfem.contact.obstacle import Obstacle
from cfem.contact.obstacle_set import ObstacleSet
from cfem.core.artefact.content import artefact_content
from cfem.export.compiled.build import compiler
from cfem.export.compiled.touch import CompiledTouch
from cfem.export.firmware.folder import write_c
from cfem.export.firmware.touch import write_c_touch
from cfem.export.spec import CSpec
from cfem.predict.contact.error import bending
from cfem.predict.contact.kept_patches import patched_model_of
from cfem.predict.contact.patched_model import PatchedModel
from cfem.predict.contact.scene import contact_step
from cfem.predict.load import load_model, read_model, read_vectors
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh
from cfem.robot.spec import scene_meaning
from cfem.surrogate.calibration import ENOUGH, bound
from cfem.surrogate.contact_error import outward, placed, pressed_places

IN = np.arange(1, 11) / 100  # mm: depths of pads


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
    loose, rng = np.flatnonzero(size > 0.1 * size.max()), np.random.default_rng(given.seed)
    forces, tips, failed, points, judged = [], [], 0, ~np.array(model.rows.turns), []
    for place in islice(pressed_places(patched, robot, given.mu, given.seed), given.places):
        if not place.converged:
            failed += 1
            print(f"  {place.kind:6s}: {place.learned.status.value}; finite elements: {place.full.status.value}")
            continue
        found, solved, mine, near = place.learned, place.full.solved[0], place.learned.forces, place.near
        exact = solved.lambda_c.reshape(-1, 3)
        largest = np.linalg.norm(exact, axis=1).max()
        unseen = np.delete(np.linalg.norm(mine, axis=1), near).max()
        forces.append(max(np.linalg.norm(mine[near] - exact, axis=1).max(), unseen) / largest)
        tips.append(np.linalg.norm(found.delta_e[0] - solved.delta_e))
        away = np.linalg.norm(solved.delta_e - model.at_displacement(found.deltas[0]).delta_e)
        if found.trusted:
            judged.append((bending(found), *place.errors(points)))
        print(
            f"  {place.kind:6s} {place.depth:.2f} mm: largest force {largest:.3f} N on {np.sum(exact.any(axis=1))} of "
            f"{len(near)}, worst error {100 * forces[-1]:.1f} %; tip moved {away:.2f} mm, error {tips[-1]:.3f} mm"
            f"{'' if found.trusted else '; NOT KNOWN'}",
            flush=True,
        )
    if forces:
        for name, values, unit in (("force", 100 * np.array(forces), "%"), ("tip", np.array(tips), "mm")):
            middle, largest = f"{np.median(values):.3g} {unit}", f"{values.max():.3g} {unit}"
            print(f"{name}: median {middle}, largest {largest} of {len(values)} places, {failed} without a state")
    if len(judged) > 2 * ENOUGH:
        L, *errors = np.array(judged).T
        for name, values in zip(("sum of forces", "tip by its motion"), errors, strict=True):
            print(f"{name}: median {100 * np.median(values):.2g} %, {held(values, L)}")
    for _ in range(4):
        ten_pads(given.model, patched, rng.choice(loose, 10, replace=False), given.mu)


def held(errors: np.ndarray, L: np.ndarray) -> str:
    """Coverage of places that took no part, and bound over error, of bounds from half of the places, 200 times."""
    rng, rows = np.random.default_rng(0), []
    for _ in range(200):
        mine, others = np.split(rng.permutation(len(L)), [len(L) // 2])
        most = bound(errors[mine], L[mine]).at(L[others])
        rows.append(((errors[others] <= most).mean(), np.median(most / np.maximum(errors[others], 1e-12))))
    coverage, ratio = np.mean(rows, axis=0)
    return f"within the bound at {100 * coverage:.0f} % of the others, which is {ratio:.2g} times the error"


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
