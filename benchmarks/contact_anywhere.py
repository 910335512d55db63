"""A learned robot pressed onto obstacles at unseen places, against finite elements whose surface touches the same.

python benchmarks/contact_anywhere.py SCENE MODEL [--places 30] [--patches 6 | --nodes] [--mu 0.5] [--seed 1]
                                      [--soft twin | itself]

The places are those of `cfem.surrogate.contact_error`: one to three of spheres, planes and edges of boxes come in by
0.25 to 1.25 % of the length. Prints the largest and the median error of forces and tip; from 41 places on, whether
bounds made at 20 places with one obstacle and 20 with several hold at the others, SPLITS times; and, with
patches, the processor time of a learned step with ten pads, each of which presses on one patch, in C too, and alone
with `--places 0`.

With `--soft` it meets its twin or itself instead, and bounds from 40 places of rigid obstacles (seed 0) are asked
there (`soft_places`)."""

import argparse
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from soft_places import learned_scene, soft_places

from cfem.condensed.model_error import ContactError
from cfem.contact.obstacle import Obstacle
from cfem.contact.obstacle_set import ObstacleSet
from cfem.core.artefact.content import artefact_content
from cfem.equilibrium.system.robot import Robot
from cfem.export.compiled.build import compiler
from cfem.export.compiled.touch import CompiledTouch
from cfem.export.firmware.folder import write_c
from cfem.export.firmware.touch import write_c_touch
from cfem.export.spec import CSpec
from cfem.predict.contact.error import contact_error, forces_of, touching
from cfem.predict.contact.step.bodies import Bodies, PlacedModel
from cfem.predict.contact.step.scene import contact_step
from cfem.predict.contact.surface.kept_patches import node_model_of, patched_model_of
from cfem.predict.contact.surface.patched_model import PatchedModel
from cfem.predict.contact.surface.surface_model import SurfaceModel
from cfem.predict.load import load_model, read_model, read_vectors
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh
from cfem.robot.spec import scene_meaning
from cfem.surrogate.calibration import ENOUGH
from cfem.surrogate.contact_error import (
    Pressed,
    calibrated_contact,
    error_at,
    outward,
    placed,
    pressed_places,
)

IN = np.arange(1, 11) / 100  # mm: depths of pads
SPLITS = 100
NUMBERS = {1: "one obstacle", 2: "two", 3: "three"}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scene", type=Path)
    parser.add_argument("model", type=Path)
    parser.add_argument("--places", type=int, default=30)
    parser.add_argument("--patches", type=float, default=6.0, help="distance of patches, mm")
    parser.add_argument("--nodes", action="store_true", help="touch at every node")
    parser.add_argument("--mu", type=float, default=0.0)
    parser.add_argument("--seed", type=int, default=0, help="of the places")
    parser.add_argument("--soft", choices=("twin", "itself"), help="what it meets instead of rigid obstacles")
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
    if given.soft:
        among_soft(touched, robot, given.places, given.mu, given.seed, given.soft)
        return
    at_places(touched, robot, given.places, given.mu, given.seed)
    size, rng = touched.flexibility.sum(axis=1), np.random.default_rng(given.seed)
    loose = np.flatnonzero(size > 0.1 * size.max())
    for _ in range(0 if given.nodes else 4):
        ten_pads(given.model, touched, rng.choice(loose, 10, replace=False), given.mu)


def at_places(touched: SurfaceModel, robot: Robot, count: int, mu: float, seed: int) -> None:
    """Prints errors at so many known places, and how often bounds made of some hold at the others."""
    known = known_places(pressed_places(touched, robot, mu, seed), touched, count)
    groups = {"one obstacle": [], "several": []}
    for place in known:
        groups["several" if place.several else "one obstacle"].append(place)
    for name, places in groups.items():
        if places:
            print(f"{len(places)} with {name}: {sizes(touched, places)}")
    if min(map(len, groups.values())) > ENOUGH + 1:
        print(f"calibrated with {ENOUGH + 1} of each and asked at the others:")
        print(held(touched, groups, mu))


def known_places(places: Iterator[Pressed], touched: SurfaceModel, count: int) -> list[Pressed]:
    """So many known places, each printed."""
    known, left_out = [], 0
    for place in places if count else ():
        what = f"  {', '.join(place.coming.kinds):20s} {place.coming.depths.max():.2f} mm: "
        if place.known:
            known.append(place)
            (force, tip), whole = place.errors(touched), pressing(place)
            print(f"{what}{whole:.3f} N, {100 * force / whole:.2f} % off; tip {tip:.4f} mm off", flush=True)
        else:
            left_out += 1
            unknown = "NOT KNOWN" if place.learned.converged else place.learned.status.value
            print(f"{what}{place.full.status.value if place.full else unknown}", flush=True)
        if len(known) == count:
            break
    print(f"{len(known)} places; {left_out} left out: not trusted, or without a state")
    return known


def pressing(place: Pressed) -> float:
    """N, the sum of the forces of all obstacles on the learned robot."""
    return float(np.linalg.norm(forces_of(place.learned, touching(place.learned)), axis=1).sum())


def sizes(touched: SurfaceModel, places: list[Pressed]) -> str:
    """Median and largest errors."""
    force, tip = np.array([place.errors(touched) for place in places]).T
    share = 100 * force / [pressing(place) for place in places]
    return (
        f"force {np.median(share):.2g} % off, {share.max():.2g} % at most, tip {np.median(tip):.2g} mm, "
        f"{tip.max():.2g} mm at most"
    )


def held(touched: SurfaceModel, groups: dict[str, list[Pressed]], mu: float) -> str:
    """Coverage of places that took no part in calibrations with some of each group, by how many obstacles touch, bound
    over error, and bound: means of coverage and medians of medians over SPLITS of them."""
    rng, rows = np.random.default_rng(0), []
    for _ in range(SPLITS):
        parts = [np.split(rng.permutation(len(places)), [ENOUGH + 1]) for places in groups.values()]
        each = list(zip(groups.values(), parts, strict=True))
        stated = error_at(touched, [places[number] for places, (mine, _) in each for number in mine], 0, mu)
        others = [places[number] for places, (_, rest) in each for number in rest]
        by_count = [[place for place in others if len(place.coming.kinds) == count] for count in NUMBERS]
        rows.append([_asked(stated, touched, places) for places in by_count])
    covered, medians = np.nanmean(rows, axis=0)[:, 0], np.nanmedian(rows, axis=0)[:, 1:]
    return "\n".join(
        f"  {name}: force within the bound at {100 * within[0]:.0f} %, tip at {100 * within[1]:.0f} %; the bound is "
        f"{ratio[0]:.2g} and {ratio[1]:.2g} times the error, {100 * bound[0]:.2g} % of the force and {bound[1]:.2g} mm"
        for name, within, (ratio, bound) in zip(NUMBERS.values(), covered, medians, strict=True)
    )


def _asked(stated: ContactError, touched: SurfaceModel, places: list[Pressed]) -> np.ndarray:
    """(3, 2) of force and tip: share of the places that are within the bound, medians of bound over error, and of the
    bound, relative to the force and in mm. NaN of no places."""
    alone = Bodies([PlacedModel(touched, itself=False)])
    most = [contact_error([stated], alone, place.learned) for place in places]
    return _compared(touched, places, np.array([(each.force, each.tip) for each in most]))


def _compared(touched: SurfaceModel, places: list[Pressed], most: np.ndarray) -> np.ndarray:
    """(3, 2) as of `_asked`; most (n, 2): bounds of force and tip."""
    if not places:
        return np.full((3, 2), np.nan)
    errors, whole = np.array([place.errors(touched) for place in places]), np.ones((len(places), 2))
    whole[:, 0] = [pressing(place) for place in places]
    return np.array([(errors <= most).mean(axis=0), *np.median([most / errors, most / whole], axis=1)])


def among_soft(touched: SurfaceModel, robot: Robot, count: int, mu: float, seed: int, kind: str) -> None:
    """Prints errors at so many known places, and how often bounds of rigid obstacles hold where they are stated."""
    stated, groups = calibrated_contact(touched, robot, mu=mu), {"stated": [], "NOT STATED": []}
    for place in known_places(soft_places(touched, robot, mu, seed, kind), touched, count):
        scene = learned_scene(touched, robot, place.way, 1.0, mu)
        bounds = contact_error([stated] * len(scene.robots), scene, place.learned)
        groups["stated" if np.isfinite(bounds.force) else "NOT STATED"].append((place, (bounds.force, bounds.tip)))
    for name, places in groups.items():
        if places:
            print(f"{len(places)} {name}: {sizes(touched, [place for place, _ in places])}")
    places, most = zip(*groups["stated"], strict=True)
    within, ratio, bound = _compared(touched, list(places), np.array(most))
    print(
        f"where it is stated, force within the bound at {100 * within[0]:.0f} %, tip at {100 * within[1]:.0f} %; the "
        f"bound is {ratio[0]:.2g} and {ratio[1]:.2g} times the error, {100 * bound[0]:.2g} % of the force and "
        f"{bound[1]:.2g} mm"
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
