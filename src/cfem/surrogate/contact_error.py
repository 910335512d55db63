"""What a touched model states of its own error, from places that finite elements touch as well.

A sphere, a plane or the edge of a box, or two or three of them, come to random points of the robot's surface at a
random state between two training states and move on, in steps, as where a point comes to lie beside an edge depends on
the way. The finite elements touch by the same points (`cfem.equilibrium.contact.surfaces`). Bounds are made of the
errors as of the model without contact (`calibration`), but in proportion to the measure of
`cfem.predict.contact.error`."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import count, cycle, islice
from typing import Any

import numpy as np

from cfem.condensed.model_error import ContactError
from cfem.condensed.patches import Patches
from cfem.constraint.surface import outer_surface
from cfem.constraint.surface_points import at_nodes
from cfem.contact.obstacle import Box, Obstacle, Plane, Sphere, tangents
from cfem.contact.obstacle_set import ObstacleSet
from cfem.core.console.progress import progress
from cfem.core.errors import NumericalError
from cfem.equilibrium.contact.skinned_robot import SkinnedRobot
from cfem.equilibrium.contact.surfaces import SurfaceScene, SurfacesState
from cfem.equilibrium.system.robot import Robot
from cfem.predict.contact.error import TINY, forces_of, measure, sizes
from cfem.predict.contact.step.scene import contact_step
from cfem.predict.contact.step.state import ContactState
from cfem.predict.contact.surface.node_model import NodeModel
from cfem.predict.contact.surface.surface_model import SurfaceModel
from cfem.predict.protocol import Predictor
from cfem.surrogate.calibration import promised, proportional

KINDS = ("sphere", "plane", "edge")
SIZE = 1 / 15  # of the length: radius of spheres, and the box
DEPTHS = 0.0025, 0.0125  # of the length
STEPS = 0.05, 0.5, 1.0  # of the depth
LOOSE = 0.1  # of the largest compliance: points that give way
AT_ONCE = 1, 2, 1, 3  # obstacles, in turn
TRIES, MOST_TRIES = 50, 1000  # random places for a number of obstacles, and for any
APART = 3.0  # sizes: points that several obstacles come to


@dataclass(frozen=True)
class Pressed:
    """One place: the learned state and that of finite elements, among the same obstacles.

    kinds, depths (o,) mm: of the obstacles
    free: (n_e,) mm, effectors of finite elements that nothing touches
    off: (N,) mm, how far the learned points are off then, along the normals"""

    kinds: tuple[str, ...]
    depths: np.ndarray
    learned: ContactState
    full: SurfacesState
    free: np.ndarray
    off: np.ndarray

    @property
    def converged(self) -> bool:
        return self.learned.converged and self.full.converged

    @property
    def known(self) -> bool:
        """True where both states are found, the learned one touches and is trusted."""
        return self.converged and self.learned.trusted and bool(self.learned.forces.any())

    def errors(self, touched: SurfaceModel) -> tuple[float, float]:
        """Errors of the forces and of the tip, relative as in `ContactError`."""
        force, moved = sizes(touched, self.learned)
        off = forces_of(self.learned, self._numbers) - forces_of(self.full, self._numbers)
        by_forces = self.full.solved[0].delta_e - self.free
        apart = np.linalg.norm((self.learned.moved[0] - by_forces)[~np.array(touched.model.rows.turns)])
        return float(np.linalg.norm(off, axis=1).max() / max(force, TINY)), float(apart / max(moved, TINY))

    @property
    def _numbers(self) -> list[int]:
        return [1 + number for number in range(len(self.kinds))]


def calibrated_contact(
    touched: SurfaceModel, robot: Robot, places: int = 30, mu: float = 0.0, seed: int = 0
) -> ContactError:
    """Error of the contact of a model from random places, of one to three obstacles each. NumericalError where too few
    of them are trusted and have a state. robot: of finite elements; places: that are tried, one takes three steps of
    them"""
    known = []
    with progress("places that finite elements touch", places) as advance:
        for place in islice(pressed_places(touched, robot, mu, seed), places):
            known += [place] if place.known else []
            advance(1)
    if len(known) < 2:
        what = f"{len(known)} of {places} contact places are trusted and have a state"
        raise NumericalError(what, do="try more places")
    return error_at(touched, known, places - len(known), mu)


def error_at(touched: SurfaceModel, known: Sequence[Pressed], left_out: int, mu: float) -> ContactError:
    """Error of the contact of a model from known places, two at least."""
    squares = np.array([place.off**2 for place in known])
    others = np.sqrt((squares.sum(axis=0) - squares) / (len(known) - 1))  # its own would make its error look smaller
    L = np.array([measure(off, place.learned) for off, place in zip(others, known, strict=True)])
    errors = np.array([place.errors(touched) for place in known])
    force, tip = (proportional(values, L) for values in errors.T)
    return ContactError(
        probability=promised(len(L)),
        places=len(L),
        left_out=left_out,
        friction=mu,
        most=max(len(place.kinds) for place in known),
        off=np.sqrt(squares.mean(axis=0)).tolist(),
        force=force,
        tip=tip,
    )


def pressed_places(
    touched: SurfaceModel, robot: Robot, mu: float = 0.0, seed: int = 0, at_once: Sequence[int] = AT_ONCE
) -> Iterator[Pressed]:
    """Random places, without end where there is room, spheres, planes and edges in turn, so many `at_once` in turn."""
    model, points = touched.model, touched.patches
    skinned = SkinnedRobot(robot, model.skin.nodes, model.skin.triangles, _fe_points(touched, robot), itself=False)
    flexible = touched.flexibility.sum(axis=1)
    stiff = flexible < LOOSE * flexible.max()
    rng, states, tries = np.random.default_rng(seed), model.domain.states[:, : model.rows.n_a], 0
    for place in count():
        kinds, coming = tuple(islice(cycle(KINDS), place, place + at_once[place % len(at_once)])), None
        while coming is None:
            first, second = states[rng.integers(len(states), size=2)]
            delta = first + rng.uniform() * (second - first)
            coming, tries = _coming(model, points, stiff, delta, kinds, rng), tries + 1
            if tries % TRIES == 0:  # there is no room for so many
                kinds = kinds[: max(1, len(kinds) - 1)]
            if tries == MOST_TRIES:
                return
        tries = 0
        yield _pressed(touched, skinned, delta, kinds, *coming, mu)


def _fe_points(touched: SurfaceModel, robot: Robot) -> Any:
    """Points by which the finite elements touch where the model does."""
    if not isinstance(touched, NodeModel):
        return touched.patches
    facets = robot.body.mesh.facets
    return at_nodes(robot.X, facets, outer_surface(robot.X, facets))


def _coming(
    model: Predictor,
    points: Patches,
    stiff: np.ndarray,
    delta: np.ndarray,
    kinds: Sequence[str],
    rng: np.random.Generator,
) -> tuple[list[Obstacle], np.ndarray, np.ndarray] | None:
    """Obstacles at the end of their ways, normals (o, 3) against which they come, and depths (o,) mm; None where one
    would reach where the body is held, and hardly gives way, or where another one is."""
    x, length = model.shape(delta), model.length
    at, chosen, coming, normals, depths = points.mean(x), [], [], [], []
    for kind in kinds:
        number, depth = rng.choice(np.flatnonzero(~stiff)), length * rng.uniform(*DEPTHS)
        normal = outward(model, points, x, number)
        if kind == "plane":  # the foremost point decides how deep
            number = int(np.argmax(at @ normal))
        obstacle = placed(kind, at[number], normal, depth, SIZE * length)
        if kind == "edge":
            obstacle = moved(obstacle, depth / 4 * np.cross(obstacle.R[:, 0], normal))
        for _ in range(10):  # back, where other points are deeper in it
            obstacle = moved(obstacle, max(0.0, -obstacle.distance(at).min() - depth) * normal)
        near = any(np.linalg.norm(at[number] - at[other]) < APART * SIZE * length for other in chosen)
        if near or stiff[obstacle.distance(at) < 0].any():
            return None
        chosen.append(number)
        coming.append(obstacle)
        normals.append(normal)
        depths.append(depth)
    return coming, np.array(normals), np.array(depths)


def _pressed(
    touched: SurfaceModel,
    skinned: SkinnedRobot,
    delta: np.ndarray,
    kinds: tuple[str, ...],
    coming: Sequence[Obstacle],
    normals: np.ndarray,
    depths: np.ndarray,
    mu: float,
) -> Pressed:
    """Both states after the obstacles have come."""
    alone = SurfaceScene([skinned], mu=mu)
    full = alone.step([delta], None)
    full = full if full.converged else alone.go([delta])
    free, learned = full.solved[0].delta_e, None
    surface = skinned.surface(full.solved[0].state.x)
    apart = touched.patches.mean(surface - touched.model.shape(delta))
    off = (apart * skinned.normals(surface)).sum(axis=1)
    for share in STEPS:
        each = zip(coming, normals, depths, strict=True)
        here = ObstacleSet(tuple(moved(obstacle, (1 - share) * depth * normal) for obstacle, normal, depth in each))
        unilateral = skinned.robot.unilateral
        learned = contact_step(touched, delta, here, mu=mu, before=learned, unilateral=unilateral)
        full = SurfaceScene([skinned], here, mu).step([delta], full) if full.converged else full
    return Pressed(kinds, depths, learned, full, free, off)


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
    """The obstacle, displaced by (3,) mm."""
    return replace(obstacle, t=obstacle.t + by)


def outward(model: Predictor, patches: Patches, x: np.ndarray, number: int) -> np.ndarray:
    """(3,) mean normal of a patch, surface nodes at x (m, 3)."""
    corners = x[model.facets[(patches.of[model.facets] == number).any(axis=1)]]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]).sum(axis=0)
    return normal / np.linalg.norm(normal)
