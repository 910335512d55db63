"""A learned robot pressed onto obstacles at unseen places and states, against finite elements that touch at every node.

python benchmarks/contact_resolution.py SCENE MODEL [--places 30] [--mu 0.5] [--seed 0] [--nodes] [--patches 6]
    [--judge FILE] [--aside 1.5]

A sphere of 3, 8 or 20 mm, a plane, an edge or a corner of a box, or a capsule comes straight to a random node of the
surface, or up to so many mm aside of it, and moves 0.3 to 1.5 mm on: in three steps, and in shorter ones, down to 1/64
of the way, where a node would begin a step so deep that another side of the obstacle is near, or a step has no state.
The robot stands at the mean of two random training states. The judge is `cfem.equilibrium.contact.surfaces` with all
nodes of the surface as contact points, and the surface between them, on the mesh of the samples; FILE keeps its answers
for the next run with the same places. Prints for each learned model the error of the force, as a vector over the size
of the judge's, the error of the tip, the depth of the surface in the obstacle, and the processor time of a step. Where
the model says that its state is not known, the judge comes to the same place again, from aside, so that it comes in on
the side of the model."""

import argparse
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from cfem.constraint.surface import Surface, outer_surface
from cfem.constraint.surface_points import at_nodes
from cfem.contact.clearance import nearest_of_surface
from cfem.contact.law.sliding import PARTS
from cfem.contact.obstacle import Box, Capsule, Obstacle
from cfem.contact.obstacle_set import ObstacleSet
from cfem.contact.surface.triangles import area_vectors
from cfem.core.artefact.content import artefact_content
from cfem.equilibrium.contact.skinned_robot import SkinnedRobot
from cfem.equilibrium.contact.surfaces import SurfaceScene, SurfacesState
from cfem.equilibrium.system.robot import Robot
from cfem.predict.contact.step.on_obstacles import SIDE
from cfem.predict.contact.step.scene import contact_step
from cfem.predict.contact.step.state import ContactState
from cfem.predict.contact.surface.kept_patches import node_model_of, patched_model_of
from cfem.predict.contact.surface.node_model import NodeModel
from cfem.predict.contact.surface.surface_model import SurfaceModel
from cfem.predict.load import load_model
from cfem.predict.protocol import Predictor
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh
from cfem.robot.spec import scene_meaning
from cfem.surrogate.contact_error import moved, placed

KINDS = ("sphere 3", "sphere 8", "sphere 20", "plane", "edge", "corner", "capsule")
STEPS, SHORTEST = (0.05, 0.5, 1.0), 1 / 64  # shares of the depth
ASIDE = 0.1  # mm: from where the judge comes again
INSIDE = 0.5  # mm: an obstacle between nodes, which touches them alone, is no deeper where it begins
FROM_HELD = 10.0  # mm: obstacles come to nodes that are at least so far from the nearest that is held


@dataclass(frozen=True)
class Place:
    """One trial. at: delta (n_a,) mm; normal (3,): outward, against which the obstacle comes; depth mm at the end."""

    kind: str
    delta: np.ndarray
    obstacle: Obstacle
    normal: np.ndarray
    depth: float

    def reached(self, share: float, aside: np.ndarray | None = None) -> Obstacle:
        """The obstacle after this share of the depth, `aside` (3,) mm of its course."""
        return moved(self.obstacle, (1 - share) * self.depth * self.normal + (0.0 if aside is None else aside))

    def walked(
        self,
        step: Callable[[Obstacle, Any], Any],
        nodes: Callable[[Any], np.ndarray],
        state: Any,
        aside: np.ndarray | None = None,
        settled: Callable[[Any], bool] = lambda state: True,
    ) -> Any:
        """The state after the whole course from `state`, or that in which a step failed; nodes: (m, 3) mm of a
        state. A step whose state is not settled is halved, as in `cfem control`."""
        share = 0.0
        for end in STEPS:
            while share < end:
                size = end - share
                while size > SHORTEST and _deep(self.reached(share + size, aside), nodes(state)):
                    size /= 2
                tried = step(self.reached(share + size, aside), state)
                while size > SHORTEST and not settled(tried):
                    size /= 2
                    tried = step(self.reached(share + size, aside), state)
                share = end if share + size > end - SHORTEST / 2 else share + size
                state = tried
                if not state.converged:
                    return state
        return state if aside is None else step(self.obstacle, state)


def _deep(obstacle: Obstacle, nodes: np.ndarray) -> bool:
    obstacles = ObstacleSet((obstacle,))
    distances, which = obstacles.nearest(nodes)
    return obstacles.deep(which, nodes, distances, SIDE)


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


def places_of(model: Predictor, held: np.ndarray, count: int, seed: int, aside: float = 0.0) -> list[Place]:
    """`count` places; held (m,) bool: surface nodes that cannot move. Left out is what no robot meets: an obstacle that
    comes to where the body is held, or begins in the body."""
    rng, places = np.random.default_rng(seed), []
    states = model.domain.states[:, : model.rows.n_a]
    while len(places) < count:
        delta = states[rng.integers(len(states), size=2)].mean(axis=0)
        place = _place(model, KINDS[len(places) % len(KINDS)], delta, held, rng, aside)
        x = model.shape(delta)
        reaches_held = place.obstacle.distance(x[held]).min(initial=np.inf) <= 0
        if not reaches_held and depth_of(x, model.skin.triangles, place.reached(0.0)) < INSIDE:
            places.append(place)
    return places


def _place(
    model: Predictor, kind: str, delta: np.ndarray, held: np.ndarray, rng: np.random.Generator, aside: float
) -> Place:
    x, skin, depth = model.shape(delta), model.skin, rng.uniform(0.3, 1.5)
    apart = np.linalg.norm(skin.rest[:, None] - skin.rest[held], axis=2).min(axis=1, initial=np.inf)
    normals, node = area_vectors(x, skin.triangles), rng.choice(np.flatnonzero(apart > FROM_HELD))
    normal = normals[node] / np.linalg.norm(normals[node])
    if kind == "plane":  # the foremost node decides how deep
        node = int(np.argmax(x @ normal))
    obstacle, shallowest = obstacle_of(kind, x[node], normal, depth), 0.0
    if aside:
        across, shallowest = np.cross(normal, rng.standard_normal(3)), -np.inf
        obstacle = moved(obstacle, rng.uniform(0.0, aside) * across / np.linalg.norm(across))
    for _ in range(20):  # back, where other nodes are deeper in it, or on, where the node is beside it
        obstacle = moved(obstacle, max(shallowest, -obstacle.distance(x).min() - depth) * normal)
    return Place(kind, delta, obstacle, normal, depth)


class Judge:
    """Finite elements that touch at every node of the surface."""

    def __init__(self, robot: Robot, surface: Surface, mu: float):
        points = at_nodes(robot.X, robot.body.mesh.facets, surface)
        self.mu, self.skinned = mu, SkinnedRobot(robot, surface.nodes, surface.triangles, points, itself=False)

    def state(self, place: Place, aside: np.ndarray | None = None) -> SurfacesState:
        """The state at the end of the course, that comes `aside` (3,) mm of it first where this is given."""
        free = SurfaceScene([self.skinned], mu=self.mu)  # it would meet the obstacle on its way
        state = free.step([place.delta], None)
        state = state if state.converged else free.go([place.delta])

        def step(here: Obstacle, before: SurfacesState) -> SurfacesState:
            return SurfaceScene([self.skinned], ObstacleSet((here,)), self.mu, PARTS).step([place.delta], before)

        if not state.converged:
            return state
        return place.walked(step, self.nodes, state, aside, settled=lambda state: state.converged)

    def nodes(self, state: SurfacesState) -> np.ndarray:
        return self.skinned.surface(state.solved[0].state.x)

    def answers(self, places: Sequence[Place]) -> dict[str, np.ndarray]:
        """Forces (p, 3) N, tips (p, n_e) mm from rest, numbers of pressed nodes (p,) and depths of the surface (p,) mm;
        NaN where there is no state."""
        force, tip = np.full((len(places), 3), np.nan), np.full((len(places), self.skinned.robot.rows.n_e), np.nan)
        count, depth, spent = np.zeros(len(places), dtype=int), np.full(len(places), np.nan), time.process_time()
        for number, place in enumerate(places):
            state = self.state(place)
            print(f"  judge {number}: {place.kind}, {place.depth:.2f} mm: {state.status.value}", flush=True)
            if state.converged:
                force[number], tip[number] = state.forces.sum(axis=0), state.solved[0].delta_e
                count[number] = np.sum(state.forces.any(axis=1))
                depth[number] = depth_of(self.nodes(state), self.skinned.triangles, place.obstacle)
        print(f"judge: {time.process_time() - spent:.0f} s of processor time")
        return {"force": force, "tip": tip, "count": count, "depth": depth}


def depth_of(surface: np.ndarray, triangles: np.ndarray, obstacle: Obstacle) -> float:
    """mm by which the surface is in the obstacle, between its nodes too."""
    return -nearest_of_surface(surface, triangles, obstacle).distance


def compare(
    name: str, model: SurfaceModel, judge: Judge, places: Sequence[Place], answers: dict[str, np.ndarray]
) -> None:
    """Prints how far a learned model is from the judge."""
    errors, unknown, spent, unilateral = [], [], [], judge.skinned.robot.unilateral

    def step(delta: np.ndarray, here: Obstacle, before: ContactState | None) -> ContactState:
        begin = time.process_time()
        state = contact_step(model, delta, [here], judge.mu, before, unilateral, PARTS)
        spent.append(1e3 * (time.process_time() - begin))
        return state

    for number, place in enumerate(places):
        known = isinstance(model, NodeModel)
        free = contact_step(model, place.delta, [], mu=judge.mu, unilateral=unilateral)
        walk = partial(step, place.delta), lambda state: state.places, free
        state = place.walked(*walk, settled=lambda state: state.converged and not state.unsettled)
        exact, tip = answers["force"][number], answers["tip"][number]
        text = f"  {number} {place.kind:9s} {place.depth:.2f} mm: {name}: "
        if not state.converged or np.isnan(exact).any():
            print(f"{text}{state.status.value}; judge: {exact}")
            unknown.append(np.full(3, np.nan))
            continue
        text += f"{np.linalg.norm(exact):.3f} N on {answers['count'][number]} nodes, "
        if not state.trusted:
            side = state.forces.sum(axis=0)
            side -= side @ place.normal * place.normal
            aside = judge.state(place, -ASIDE * side / np.linalg.norm(side))
            if aside.converged:
                exact, tip = aside.forces.sum(axis=0), aside.solved[0].delta_e
        surface = state.places if known else model.model.skin.surface(state.rows[0])
        values = np.array(
            [
                100 * np.linalg.norm(state.forces.sum(axis=0) - exact) / np.linalg.norm(exact),
                np.linalg.norm(state.delta_e[0] - tip),
                depth_of(surface, model.model.skin.triangles, place.obstacle),
            ]
        )
        (errors if state.trusted else unknown).append(values)
        text += f"{answers['depth'][number]:.3f} mm deep; "
        text += "force off {:.1f} %, tip off {:.3f} mm, {:.3f} mm deep".format(*values)
        print(text + ("" if state.trusted else "; NOT KNOWN, and so far from the judge from aside"), flush=True)
    print(f"{name}: {_summary(errors)}; NOT KNOWN at {len(unknown)}: {_summary(unknown)}")
    spent = spent[len(STEPS) :]  # the first place waits for the compiler
    print(f"  step {np.median(spent):.2f} ms (median), {max(spent):.1f} at most")


def _summary(values: Sequence[np.ndarray]) -> str:
    """Force %, tip mm and depth mm of places, values (3,) each."""
    found = np.sort(np.array(values).reshape(-1, 3), axis=0)
    if not len(found):
        return "none"
    parts = [
        f"{what} {np.median(each):.2g}, {each[-2:][0]:.2g}, {each[-1]:.2g} {unit}"
        for what, each, unit in zip(("force", "tip", "depth"), found.T, ("%", "mm", "mm"), strict=True)
    ]
    return f"{len(found)} places: {'; '.join(parts)} (median, last but one, worst)"


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
    parser.add_argument("--nodes", action="store_true", help="try the model that touches at every node")
    parser.add_argument("--aside", type=float, default=0.0, help="mm by which obstacles miss the node, at most")
    parser.add_argument("--judge", type=Path, help="where the judge's answers are kept (.npz)")
    given = parser.parse_args()
    scene, mesh = load_scene_and_mesh(given.scene)
    model, robot = load_model(given.model), build_robot(scene, mesh)
    surface = outer_surface(robot.X, robot.body.mesh.facets)
    places = places_of(model, np.isin(surface.nodes, robot.fixed), given.places, given.seed, given.aside)
    judge = Judge(robot, surface, given.mu)
    answers = kept(given.judge, lambda: judge.answers(places))
    made_of = {
        "scene": scene_meaning(given.scene),
        "mesh": artefact_content(given.scene.parent / scene.out),
        "loads": {},
    }
    if given.nodes:
        compare("nodes", node_model_of(model, given.model, robot, made_of), judge, places, answers)
    for apart in given.patches:
        patched = patched_model_of(model, given.model, robot, made_of, apart)
        compare(f"patches of {apart:g} mm", patched, judge, places, answers)


if __name__ == "__main__":
    main()
