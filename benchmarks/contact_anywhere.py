"""A learned robot pressed onto obstacles at unseen places, against finite elements whose surface touches the same.

python benchmarks/contact_anywhere.py SCENE MODEL [--places 30] [--patches 6 | --nodes] [--mu 0.5] [--seed 1]

The places are those of `cfem.surrogate.contact_error`: one to three of spheres, planes and edges of boxes come in by
0.25 to 1.25 % of the length. Prints the largest and the median error of forces and tip; whether bounds made at some of
the places hold at the others; and, with patches, the processor time of a learned step with ten pads, each of which
presses on one patch, in C too, and alone with `--places 0`."""

import argparse
import tempfile
import time
from itertools import islice
from pathlib import Path

import numpy as np

from cfem.contact.obstacle import Obstacle
from cfem.contact.obstacle_set import ObstacleSet
from cfem.core.artefact.content import artefact_content
from cfem.equilibrium.system.robot import Robot
from cfem.export.compiled.build import compiler
from cfem.export.compiled.touch import CompiledTouch
from cfem.export.firmware.folder import write_c
from cfem.export.firmware.touch import write_c_touch
from cfem.export.spec import CSpec
from cfem.predict.contact.error import contact_error, sizes
from cfem.predict.contact.step.scene import contact_step
from cfem.predict.contact.surface.kept_patches import node_model_of, patched_model_of
from cfem.predict.contact.surface.patched_model import PatchedModel
from cfem.predict.contact.surface.surface_model import SurfaceModel
from cfem.predict.load import load_model, read_model, read_vectors
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh
from cfem.robot.spec import scene_meaning
from cfem.surrogate.calibration import ENOUGH
from cfem.surrogate.contact_error import Pressed, error_at, outward, placed, pressed_places

IN = np.arange(1, 11) / 100  # mm: depths of pads
SPLITS = 100


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scene", type=Path)
    parser.add_argument("model", type=Path)
    parser.add_argument("--places", type=int, default=30)
    parser.add_argument("--patches", type=float, default=6.0, help="distance of patches, mm")
    parser.add_argument("--nodes", action="store_true", help="touch at every node")
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
    touched: SurfaceModel = (
        node_model_of(model, given.model, robot, made_of)
        if given.nodes
        else patched_model_of(model, given.model, robot, made_of, given.patches)
    )
    what, states = "nodes" if given.nodes else "patches", len(touched.by_fe.states)
    print(f"{len(touched.patches)} {what}, their compliance at {states} states; {len(model.skin)} modes")
    at_places(touched, robot, given.places, given.mu, given.seed)
    size, rng = touched.flexibility.sum(axis=1), np.random.default_rng(given.seed)
    loose = np.flatnonzero(size > 0.1 * size.max())
    for _ in range(0 if given.nodes else 4):
        ten_pads(given.model, touched, rng.choice(loose, 10, replace=False), given.mu)


def at_places(touched: SurfaceModel, robot: Robot, count: int, mu: float, seed: int) -> None:
    """Prints errors at so many places, and how often bounds made of some hold at the others."""
    known = []
    for place in islice(pressed_places(touched, robot, mu, seed), count):
        what = f"  {', '.join(place.kinds):20s} {place.depths.max():.2f} mm: "
        if not place.converged:
            print(f"{what}{place.learned.status.value}; finite elements: {place.full.status.value}")
            continue
        known += [place] if place.known else []
        force, tip = place.errors(touched)
        pressing, moved = sizes(touched, place.learned)
        print(
            f"{what}{pressing:.3f} N, {100 * force:.2f} % off; tip moved {moved:.2f} mm, {100 * tip:.2f} % off"
            f"{'' if place.learned.trusted else '; NOT KNOWN'}",
            flush=True,
        )
    if known:
        print(f"{count} places, {len(known)} trusted")
        errors = 100 * np.array([place.errors(touched) for place in known])
        for name, values in zip(("force", "tip"), errors.T, strict=True):
            print(f"{name}: median {np.median(values):.2g} %, largest {values.max():.2g} %")
    for part in sorted({ENOUGH + 1, len(known) // 2}):
        if len(known) > part > 1:
            print(f"calibrated with {part}: {held(touched, known, part, mu)}")


def held(touched: SurfaceModel, known: list[Pressed], count: int, mu: float) -> str:
    """Coverage of places that took no part in a calibration with `count`, and bound over error, SPLITS times."""
    rng, rows = np.random.default_rng(0), []
    alone = np.array([len(place.kinds) == 1 for place in known])
    errors = np.array([place.errors(touched) for place in known]) * [sizes(touched, place.learned) for place in known]
    for _ in range(SPLITS):
        mine, others = np.split(rng.permutation(len(known)), [count])
        stated = error_at(touched, [known[number] for number in mine], 0, mu)
        bounds = [contact_error(stated, touched, known[number].learned) for number in others]
        most = np.array([(each.force, each.tip) for each in bounds])
        within, several = errors[others] <= most, ~alone[others]
        ratio = np.median(most / np.maximum(errors[others], 1e-12), axis=0)
        rows.append([*(part.mean(axis=0) for part in (within, within[~several], within[several])), ratio])
    (force, *of_force), (tip, *of_tip) = np.nanmean(rows, axis=0).T
    return "; ".join(
        f"{name} within the bound at {100 * all_of_them:.0f} % of the others, at {100 * one:.0f} % of those with one "
        f"obstacle, {100 * several:.0f} % with several; the bound is {ratio:.2g} times the error"
        for name, all_of_them, (one, several, ratio) in (("force", force, of_force), ("tip", tip, of_tip))
    )


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
