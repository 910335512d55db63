"""A learned robot pressed onto obstacles at unseen places and states, against finite elements that touch at every node.

python benchmarks/contact_resolution.py SCENE MODEL [--places 30] [--mu 0.5] [--seed 0] [--patches 6] [--judge FILE]

A sphere of 3, 8 or 20 mm, a plane, an edge or a corner of a box, or a capsule comes to a random node of the surface and
moves 0.3 to 1.5 mm on, in three steps. The robot stands at the mean of two random training states. The judge is
`cfem.equilibrium.contact.surfaces` with all nodes of the surface as contact points, on the mesh of the samples; FILE
keeps its answers for the next run with the same places. Prints for each learned model the error of the force, as a
vector over the size of the judge's, the error of the tip, and the processor time of a step."""

import argparse
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from contact_anywhere import moved, placed

from cfem.constraint.surface import Surface, outer_surface
from cfem.constraint.surface_points import at_nodes
from cfem.contact.detection import area_vectors
from cfem.contact.obstacle import Box, Capsule, Obstacle
from cfem.contact.obstacle_set import ObstacleSet
from cfem.core.artefact.content import artefact_content
from cfem.equilibrium.contact.skinned_robot import SkinnedRobot
from cfem.equilibrium.contact.surfaces import SurfaceScene
from cfem.equilibrium.robot import Robot
from cfem.predict.contact.kept_patches import patched_model_of
from cfem.predict.contact.scene import contact_step
from cfem.predict.load import load_model
from cfem.predict.protocol import Predictor
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh
from cfem.robot.spec import scene_meaning

KINDS = ("sphere 3", "sphere 8", "sphere 20", "plane", "edge", "corner", "capsule")
STEPS = (0.05, 0.5, 1.0)  # shares of the depth
FROM_HELD = 10.0  # mm: obstacles come to nodes that are at least so far from the nearest that is held


@dataclass(frozen=True)
class Place:
    """One trial. at: delta (n_a,) mm; normal (3,): outward, against which the obstacle comes; depth mm at the end."""

    kind: str
    delta: np.ndarray
    obstacle: Obstacle
    normal: np.ndarray
    depth: float

    def course(self) -> list[Obstacle]:
        return [moved(self.obstacle, (1 - share) * self.depth * self.normal) for share in STEPS]


def obstacle_of(kind: str, point: np.ndarray, normal: np.ndarray, depth: float) -> Obstacle:
    """An obstacle that reaches `depth` mm into the body at `point`."""
    name, *size = kind.split()
    if name == "corner":
        edge = placed("edge", point, normal, depth, 8.0)
        to_corner = np.sqrt(3.0)
        third = np.array([1.0, 1.0, 1.0]) / to_corner
        across = np.linalg.svd(third[None])[2][1:]
        local = np.vstack([third, across])  # (3, 3) rows, right-handed
        local[2] *= np.sign(np.linalg.det(local))
        frame = np.vstack([-normal, edge.R[:, 0], np.cross(-normal, edge.R[:, 0])])
        return Box(np.full(3, 8.0), R=frame.T @ local, t=point + (8.0 * to_corner - depth) * normal)
    if name == "capsule":
        frame = placed("plane", point, normal, depth, 8.0).R  # its axis lies along the surface
        return Capsule(4.0, 8.0, R=frame[:, [1, 2, 0]], t=point + (4.0 - depth) * normal)
    return placed(name, point, normal, depth, float(size[0]) if size else 8.0)


def places_of(model: Predictor, held: np.ndarray, count: int, seed: int) -> list[Place]:
    """`count` places; held (m,) bool: surface nodes that cannot move."""
    rng, skin, places = np.random.default_rng(seed), model.skin, []
    states = model.domain.states[:, : model.rows.n_a]
    apart = np.linalg.norm(skin.rest[:, None] - skin.rest[held], axis=2).min(axis=1, initial=np.inf)
    free = np.flatnonzero(apart > FROM_HELD)
    for number in range(count):
        delta = states[rng.integers(len(states), size=2)].mean(axis=0)
        x, kind, depth = model.shape(delta), KINDS[number % len(KINDS)], rng.uniform(0.3, 1.5)
        node = rng.choice(free)
        normals = area_vectors(x, skin.triangles)
        normal = normals[node] / np.linalg.norm(normals[node])
        if kind == "plane":  # the foremost node decides how deep
            node = int(np.argmax(x @ normal))
        obstacle = obstacle_of(kind, x[node], normal, depth)
        for _ in range(20):  # back, where other nodes are deeper in it
            obstacle = moved(obstacle, max(0.0, -obstacle.distance(x).min() - depth) * normal)
        places.append(Place(kind, delta, obstacle, normal, depth))
    return places


def judged(robot: Robot, surface: Surface, places: Sequence[Place], mu: float) -> dict[str, np.ndarray]:
    """Forces (p, 3) N, tips (p, n_e) mm from rest, numbers of pressed nodes (p,) and depths of the surface (p,) mm by
    finite elements; NaN where they find no state."""
    points = at_nodes(robot.X, robot.body.mesh.facets, surface)
    skinned = SkinnedRobot(robot, surface.nodes, surface.triangles, points, itself=False)
    force, tip = np.full((len(places), 3), np.nan), np.full((len(places), robot.rows.n_e), np.nan)
    count, depth, spent = np.zeros(len(places), dtype=int), np.full(len(places), np.nan), time.process_time()
    for number, place in enumerate(places):
        away = moved(place.obstacle, 3 * place.depth * place.normal)
        state = SurfaceScene([skinned], ObstacleSet((away,)), mu).go([place.delta])
        for here in place.course():
            state = SurfaceScene([skinned], ObstacleSet((here,)), mu).step([place.delta], state)
            if not state.converged:
                break
        print(f"  judge {number}: {place.kind}, {place.depth:.2f} mm: {state.status.value}", flush=True)
        if state.converged:
            force[number], tip[number] = state.forces.sum(axis=0), state.solved[0].delta_e
            count[number] = np.sum(state.forces.any(axis=1))
            depth[number] = -here.distance(skinned.surface(state.solved[0].state.x)).min()
    print(f"judge: {time.process_time() - spent:.0f} s of processor time")
    return {"force": force, "tip": tip, "count": count, "depth": depth}


def compare(
    name: str, model: object, robot: Robot, places: Sequence[Place], judge: dict[str, np.ndarray], mu: float
) -> None:
    """Prints how far a learned model is from the judge."""
    force, tip, spent, unknown = [], [], [], 0
    for number, place in enumerate(places):
        state, exact = None, judge["force"][number]
        for here in place.course():
            begin = time.process_time()
            state = contact_step(model, place.delta, [here], mu=mu, before=state, unilateral=robot.unilateral)
            spent.append(1e3 * (time.process_time() - begin))
        if not state.converged or np.isnan(exact).any():
            print(f"  {place.kind:9s} {place.depth:.2f} mm: {name}: {state.status.value}; judge: {exact}")
            unknown += 1
            continue
        force.append(np.linalg.norm(state.forces.sum(axis=0) - exact) / np.linalg.norm(exact))
        tip.append(np.linalg.norm(state.delta_e[0] - judge["tip"][number]))
        print(
            f"  {place.kind:9s} {place.depth:.2f} mm: {np.linalg.norm(exact):.3f} N on {judge['count'][number]} nodes; "
            f"{name}: force off {100 * force[-1]:.1f} %, tip off {tip[-1]:.3f} mm"
            f"{'' if state.trusted else '; NOT KNOWN'}",
            flush=True,
        )
    if not force:
        return
    parts = [f"{name}: {len(force)} places, {unknown} without an answer"]
    for what, values, unit in (("force", 100 * np.array(force), "%"), ("tip", np.array(tip), "mm")):
        values = np.sort(values)
        parts.append(f"{what} {np.median(values):.2g}, {values[-2:][0]:.2g}, {values[-1]:.2g} {unit}")
    print(f"{'; '.join(parts)} (median, last but one, worst); step {np.median(spent):.2f} ms, {max(spent):.1f} at most")


def kept(file: Path | None, make: Callable[[], dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
    if file is None or not file.is_file():
        answers = make()
        if file is not None:
            np.savez(file, **answers)
        return answers
    with np.load(file) as stored:
        return dict(stored)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", type=Path)
    parser.add_argument("model", type=Path)
    parser.add_argument("--places", type=int, default=30)
    parser.add_argument("--mu", type=float, default=0.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--patches", type=float, nargs="*", default=[6.0], help="distances of patches to try, mm")
    parser.add_argument("--judge", type=Path, help="where the judge's answers are kept (.npz)")
    given = parser.parse_args()
    scene, mesh = load_scene_and_mesh(given.scene)
    model, robot = load_model(given.model), build_robot(scene, mesh)
    surface = outer_surface(robot.X, robot.body.mesh.facets)
    places = places_of(model, np.isin(surface.nodes, robot.fixed), given.places, given.seed)
    judge = kept(given.judge, lambda: judged(robot, surface, places, given.mu))
    made_of = {
        "scene": scene_meaning(given.scene),
        "mesh": artefact_content(given.scene.parent / scene.out),
        "loads": {},
    }
    for apart in given.patches:
        patched = patched_model_of(model, given.model, robot, made_of, apart)
        compare(f"patches of {apart:g} mm", patched, robot, places, judge, given.mu)


if __name__ == "__main__":
    main()
