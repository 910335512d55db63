"""What a touched model states of its own error, from places that finite elements touch as well.

A sphere, a plane or the edge of a box, or two or three of them, come to random points of the robot's surface at a
random state between two training states and move on, in steps, as where a point comes to lie beside an edge depends on
the way. The finite elements touch by the same points (`cfem.equilibrium.contact.surfaces`), where the learned state is
trusted all the way. Bounds are made of the errors as of the model without contact (`calibration`), but in proportion to
what `cfem.predict.contact.error` expects, and by themselves where one obstacle touches and where several do: then
each of both promises what it says, and one obstacle does not pay for several."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import count, cycle, islice

import numpy as np

from cfem.condensed.model_error import ContactError, ContactFactors
from cfem.condensed.patches import Patches
from cfem.contact.law.sliding import PARTS
from cfem.contact.obstacle import Box, Obstacle, Plane, Sphere, tangents
from cfem.contact.obstacle_set import ObstacleSet
from cfem.contact.surface.triangles import normals_of
from cfem.core.console.progress import progress
from cfem.core.errors import NumericalError
from cfem.equilibrium.contact.skinned_robot import SkinnedRobot
from cfem.equilibrium.contact.surfaces import SurfaceScene, SurfacesState
from cfem.equilibrium.system.robot import Robot
from cfem.predict.contact.error import expected_error, forces_of, touching
from cfem.predict.contact.step.bodies import Bodies, PlacedModel
from cfem.predict.contact.step.scene import contact_step
from cfem.predict.contact.step.state import ContactState
from cfem.predict.contact.surface.kept_patches import fe_points
from cfem.predict.contact.surface.surface_model import SurfaceModel
from cfem.predict.protocol import Predictor
from cfem.surrogate.calibration import promised, quantile

KINDS = ("sphere", "plane", "edge")
SIZE = 1 / 15  # of the length: radius of spheres, and the box
DEPTHS = 0.0025, 0.0125  # of the length
STEPS = 0.05, 0.5, 1.0  # of the depth, of finite elements
LEARNED_STEPS = 0.05, 0.275, 0.5, 0.75, 1.0  # of the depth
LOOSE = 0.1  # of the largest compliance: points that give way
AT_ONCE = 1, 2, 1, 3  # obstacles, in turn
TRIES, MOST_TRIES = 50, 1000  # random places for a number of obstacles, and for any
APART = 3.0  # sizes: points that several obstacles come to
DRAWN = 5  # times the places that are wanted: at most so many, those left out too


@dataclass(frozen=True)
class Coming:
    """Obstacles at the end of their ways, of these kinds, the normals (o, 3) against which they come, and the depths
    (o,) mm that they reach."""

    kinds: tuple[str, ...]
    obstacles: tuple[Obstacle, ...]
    normals: np.ndarray
    depths: np.ndarray

    def at(self, share: float) -> ObstacleSet:
        """The obstacles at this share of their depths."""
        back = (1 - share) * self.depths[:, None] * self.normals
        return ObstacleSet(tuple(moved(*each) for each in zip(self.obstacles, back, strict=True)))


@dataclass(frozen=True)
class Pressed:
    """One place: the learned state and that of finite elements, among the same obstacles.

    full: None where the learned state is not found or not trusted, at the end or on the way
    alone: (n_e,) mm, how far the learned effectors are off where nothing touches; off: (N,) mm, how far the learned
    points are off then, along the normals"""

    coming: Coming
    learned: ContactState
    full: SurfacesState | None = None
    alone: np.ndarray | None = None
    off: np.ndarray | None = None

    @property
    def known(self) -> bool:
        """True where both states are found, and the learned one is trusted."""
        return self.full is not None and self.full.converged

    @property
    def several(self) -> bool:
        """True where more than one obstacle touches."""
        return len(touching(self.learned)) > 1

    def errors(self, touched: SurfaceModel) -> tuple[float, float]:
        """N and mm: the largest error of the force by any obstacle, and that of how the obstacles move all effector
        points together, slack cables too."""
        numbers = np.union1d(touching(self.learned), touching(self.full)).tolist()
        missed = forces_of(self.learned, numbers) - forces_of(self.full, numbers)
        apart = self.learned.delta_e[0] - self.full.solved[0].delta_e - self.alone
        of_tip = np.linalg.norm(apart[~np.array(touched.model.rows.turns)])
        return float(np.linalg.norm(missed, axis=1).max()), float(of_tip)


def calibrated_contact(
    touched: SurfaceModel, robot: Robot, places: int = 40, mu: float = 0.0, seed: int = 0
) -> ContactError:
    """Error of the contact of a model from random places, half of them of one obstacle, half of two or three.
    NumericalError where too few of them are trusted and have a state. robot: of finite elements; places: that finite
    elements touch, each in three steps"""
    known, drawn = [], 0
    with progress("places that finite elements touch", places) as advance:
        for place in islice(pressed_places(touched, robot, mu, seed), DRAWN * places):
            drawn += 1
            known += [place] if place.known else []
            advance(int(place.known))
            if len(known) == places:
                break
    if len(known) < 2:
        what = f"{len(known)} of {drawn} contact places are trusted and have a state"
        raise NumericalError(what, do="try more places")
    return error_at(touched, known, drawn - len(known), mu)


def error_at(touched: SurfaceModel, known: Sequence[Pressed], left_out: int, mu: float) -> ContactError:
    """Error of the contact of a model from known places, two at least."""
    squares = np.array([place.off**2 for place in known])
    others = np.sqrt((squares.sum(axis=0) - squares) / (len(known) - 1))  # its own would make its error look smaller
    alone = Bodies([PlacedModel(touched, itself=False)])
    expected = np.array(
        [expected_error(distances, alone, each.learned) for distances, each in zip(others, known, strict=True)]
    )
    shares = np.array([place.errors(touched) for place in known]) / expected
    several = np.array([place.several for place in known])
    single, several_at_once = _factors(shares[~several]), _factors(shares[several])
    return ContactError(
        probability=min(each.probability for each in (single, several_at_once) if each),
        left_out=left_out,
        one=single,
        several=several_at_once,
        friction=mu,
        most=max(len(touching(place.learned)) for place in known),
        points=max(int(place.learned.push.any(axis=1).sum()) for place in known),
        off=np.sqrt(squares.mean(axis=0)).tolist(),
    )


def _factors(shares: np.ndarray) -> ContactFactors | None:
    """Factors from errors of places over what is expected there (n, 2); None of none."""
    if not len(shares):
        return None
    force, tip = map(quantile, shares.T)
    return ContactFactors(probability=promised(len(shares)), places=len(shares), force=force, tip=tip)


def pressed_places(
    touched: SurfaceModel, robot: Robot, mu: float = 0.0, seed: int = 0, at_once: Sequence[int] = AT_ONCE
) -> Iterator[Pressed]:
    """Random places, without end where there is room, spheres, planes and edges in turn, so many `at_once` that touch
    in the end. A number has its turn until a place with it is known."""
    model, points = touched.model, touched.patches
    skinned = SkinnedRobot(robot, model.skin.nodes, model.skin.triangles, fe_points(touched, robot), itself=False)
    flexible = touched.flexibility.sum(axis=1)
    stiff = flexible < LOOSE * flexible.max()
    rng, states = np.random.default_rng(seed), model.domain.states[:, : model.rows.n_a]
    for place in count():
        kinds, pressed, tries = tuple(islice(cycle(KINDS), place, place + at_once[place % len(at_once)])), None, 0
        while pressed is None or not pressed.known:
            first, second = states[rng.integers(len(states), size=2)]
            delta = first + rng.uniform() * (second - first)
            coming, tries = _coming(model, points, stiff, delta, kinds, rng), tries + 1
            pressed = None if coming is None else _pressed(touched, skinned, delta, coming, mu)
            if pressed is not None:
                yield pressed
            if tries % TRIES == 0:  # there is no room for so many
                kinds = kinds[: max(1, len(kinds) - 1)]
            if tries == MOST_TRIES:
                return


def _coming(
    model: Predictor,
    points: Patches,
    stiff: np.ndarray,
    delta: np.ndarray,
    kinds: tuple[str, ...],
    rng: np.random.Generator,
) -> Coming | None:
    """Obstacles that come to random points; None where one would reach where the body is held, and hardly gives way, or
    where another one is."""
    x, length = model.shape(delta), model.length
    places, chosen, coming, normals, depths = points.mean(x), [], [], [], []
    for kind in kinds:
        number, depth = rng.choice(np.flatnonzero(~stiff)), length * rng.uniform(*DEPTHS)
        normal = outward(model, points, x, number)
        if kind == "plane":  # the foremost point decides how deep
            number = int(np.argmax(places @ normal))
        obstacle = placed(kind, places[number], normal, depth, SIZE * length)
        if kind == "edge":
            obstacle = moved(obstacle, depth / 4 * np.cross(obstacle.R[:, 0], normal))
        for _ in range(10):  # back, where other points are deeper in it
            obstacle = moved(obstacle, max(0.0, -obstacle.distance(places).min() - depth) * normal)
        near = any(np.linalg.norm(places[number] - places[earlier]) < APART * SIZE * length for earlier in chosen)
        if near or stiff[obstacle.distance(places) < 0].any():
            return None
        chosen.append(number)
        coming.append(obstacle)
        normals.append(normal)
        depths.append(depth)
    return Coming(kinds, tuple(coming), np.array(normals), np.array(depths))


def _pressed(
    touched: SurfaceModel, skinned: SkinnedRobot, delta: np.ndarray, coming: Coming, mu: float
) -> Pressed | None:
    """Both states after the obstacles have come; None where not all of them touch in the end."""
    learned, unilateral = None, skinned.robot.unilateral
    for share in LEARNED_STEPS:
        obstacles = coming.at(share)
        learned = contact_step(touched, delta, obstacles, mu, before=learned, unilateral=unilateral, parts=PARTS)
        if not learned.converged or not learned.trusted:
            return Pressed(coming, learned)
    if len(touching(learned)) < len(coming.kinds):
        return None
    free = SurfaceScene([skinned], mu=mu)
    full = free.step([delta], None)
    full = full if full.converged else free.go([delta])
    nothing = contact_step(touched, delta, (), mu=mu, unilateral=unilateral)
    alone = nothing.delta_e[0] - full.solved[0].delta_e
    surface = skinned.surface(full.solved[0].state.x)
    apart = touched.patches.mean(surface - touched.model.shape(delta))
    off = (apart * skinned.normals(surface)).sum(axis=1)
    for share in STEPS:
        full = SurfaceScene([skinned], coming.at(share), mu, PARTS).step([delta], full) if full.converged else full
    return Pressed(coming, learned, full, alone, off)


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
    """Mean normal (3,) of a patch, surface nodes at x (m, 3)."""
    corners = x[model.facets[(patches.of[model.facets] == number).any(axis=1)]]
    normal = normals_of(corners).sum(axis=0)
    return normal / np.linalg.norm(normal)
