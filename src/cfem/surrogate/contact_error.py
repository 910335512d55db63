"""What a touched model states of its own error, from places that finite elements touch as well.

A sphere, a plane or the edge of a box comes to a random patch of the robot at a random training state and moves on, in
steps, as where a patch comes to lie beside an edge depends on the way. The finite elements have the same patches for
contact points (`cfem.equilibrium.contact.obstacles`). Bounds are made of the errors as of the model without contact
(`calibration`)."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import count, islice

import numpy as np

from cfem.condensed.patches import Patches
from cfem.contact.obstacle import Box, Obstacle, Plane, Sphere, tangents
from cfem.core.console.progress import progress
from cfem.core.errors import NumericalError
from cfem.equilibrium.contact.obstacles import PointsState, obstacle_step
from cfem.equilibrium.contact.patch_compliance import with_patches
from cfem.equilibrium.system.actuation import displacement
from cfem.equilibrium.system.problem import Problem
from cfem.equilibrium.system.robot import Robot
from cfem.predict.contact.error import ContactError, bending, sizes
from cfem.predict.contact.patched_model import PatchedModel
from cfem.predict.contact.scene import contact_step
from cfem.predict.contact.state import ContactState
from cfem.predict.protocol import Predictor
from cfem.surrogate.calibration import bound, promised

KINDS = ("sphere", "plane", "edge")
SIZE = 1 / 15  # of the length: radius of spheres, and the box
DEPTHS = 0.0025, 0.0125  # of the length
STEPS = 0.05, 0.5, 1.0  # of the depth
LOOSE = 0.1  # of the largest compliance: patches that give way
REACHED = 1 / 120  # of the length: patches so near the obstacle are contact points of the finite elements


@dataclass(frozen=True)
class Pressed:
    """One place: the learned state and that of finite elements, whose contact points are the patches `near` (c,)."""

    kind: str
    depth: float
    near: np.ndarray
    learned: ContactState
    full: PointsState

    @property
    def converged(self) -> bool:
        return self.learned.converged and self.full.converged

    def errors(self, points: np.ndarray) -> tuple[float, float]:
        """Errors of the sum of forces and of the tip, relative as in `ContactError`."""
        (solved,) = self.full.solved
        force, moved = sizes(self.learned, points)
        off = self.learned.forces.sum(axis=0) - solved.lambda_c.reshape(-1, 3).sum(axis=0)
        apart = (self.learned.delta_e[0] - solved.delta_e)[points]
        tiny = np.finfo(float).tiny
        return float(np.linalg.norm(off)) / max(force, tiny), float(np.linalg.norm(apart)) / max(moved, tiny)


def calibrated_contact(
    patched: PatchedModel, robot: Robot, places: int = 40, mu: float = 0.0, seed: int = 0
) -> ContactError:
    """Error of the contact of a model from random places. NumericalError where no place is trusted and has a state.
    robot: of finite elements; places: that are tried, one takes three steps of them"""
    points, L, errors = ~np.array(patched.model.rows.turns), [], []
    with progress("places that finite elements touch", places) as advance:
        for place in islice(pressed_places(patched, robot, mu, seed), places):
            if place.converged and place.learned.trusted and place.learned.forces.any():
                L.append(bending(place.learned))
                errors.append(place.errors(points))
            advance(1)
    if not errors:
        raise NumericalError(f"none of {places} contact places is trusted and has a state", do="try more places")
    force, tip = (bound(np.array(values), np.array(L)) for values in zip(*errors, strict=True))
    left_out = places - len(errors)
    return ContactError(
        probability=promised(len(L)), places=len(L), left_out=left_out, friction=mu, force=force, tip=tip
    )


def pressed_places(patched: PatchedModel, robot: Robot, mu: float = 0.0, seed: int = 0) -> Iterator[Pressed]:
    """Random places without end, spheres, planes and edges in turn."""
    model, patches, length = patched.model, patched.patches, patched.model.length
    compliance = np.diag(patched.by_fe.own[0]).reshape(-1, 3).sum(axis=1)
    stiff = compliance < LOOSE * compliance.max()
    rng, states = np.random.default_rng(seed), model.domain.states[:, : model.rows.n_a]
    for place in count():
        delta = states[rng.integers(len(states))]
        x, number = model.shape(delta), rng.choice(np.flatnonzero(~stiff))
        at, normal = patches.mean(x), outward(model, patches, x, number)
        kind, depth = KINDS[place % 3], length * rng.uniform(*DEPTHS)
        if kind == "plane":  # the foremost patch decides how deep
            number = int(np.argmax(at @ normal))
        obstacle = placed(kind, at[number], normal, depth, SIZE * length)
        if kind == "edge":
            obstacle = moved(obstacle, depth / 4 * np.cross(obstacle.R[:, 0], normal))
        for _ in range(10):  # back, where other patches are deeper in it
            obstacle = moved(obstacle, max(0.0, -obstacle.distance(at).min() - depth) * normal)
        if stiff[obstacle.distance(at) < 0].any():
            continue  # it would reach where the body is held, and hardly gives way: another place
        near = np.flatnonzero((obstacle.distance(at) < REACHED * length) & ~patched.held_still)
        problem, learned, full = Problem(with_patches(robot, model.skin.nodes, patches, near)), None, None
        for share in STEPS:
            here = moved(obstacle, (1 - share) * depth * normal)
            learned = contact_step(patched, delta, [here], mu=mu, before=learned, unilateral=robot.unilateral)
            full = obstacle_step(problem, displacement(delta), [here] * len(near), mu=mu, before=full)
        yield Pressed(kind, depth, near, learned, full)


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
