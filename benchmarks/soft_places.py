"""Random places where a robot touches its twin or itself, learned and in finite elements, for `contact_anywhere.py`.

A random point of the robot and one of its twin, both between two training states, face each other, the twin turned at
random about their normal. They come as far in as the rigid obstacles of `cfem.surrogate.contact_error` do. A robot
that touches itself does so on the way from rest to a state between two training states."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from cfem.contact.law.sliding import PARTS
from cfem.contact.obstacle import ClosedMesh, tangents
from cfem.contact.surface.closed_surface import ClosedSurface
from cfem.core.errors import InputError
from cfem.equilibrium.contact.skinned_robot import SkinnedRobot
from cfem.equilibrium.contact.surfaces import SurfaceScene
from cfem.equilibrium.system.robot import Robot
from cfem.predict.contact.step.bodies import Bodies, PlacedModel
from cfem.predict.contact.step.scene import INSIDE, ContactScene, contact_step
from cfem.predict.contact.surface.kept_patches import fe_points
from cfem.predict.contact.surface.surface_model import SurfaceModel
from cfem.surrogate.contact_error import DEPTHS, LEARNED_STEPS, LOOSE, Coming, Pressed, outward

BEFORE, FAR = -0.3, -1000.0  # of the depth: where soft surfaces begin, apart, and where they are far apart
STEP = 0.08  # distances of points: of finite elements that come in. What a longer step passes has not come in
HALVINGS = 12


@dataclass(frozen=True)
class Way:
    """A way, from share BEFORE to 1, on which soft surfaces come to touch, from 0 on.

    begin, end: actuators (n_a,) mm of each robot at shares 0 and 1
    R: (3, 3) of the twin, and t (3,) mm at share 1, from which it is `back` (3,) mm away at 0; None: it meets itself
    depth: mm, that it comes in"""

    begin: list[np.ndarray]
    end: list[np.ndarray]
    depth: float
    R: np.ndarray | None = None
    t: np.ndarray | None = None
    back: np.ndarray | None = None

    def deltas(self, share: float) -> list[np.ndarray]:
        return [begin + share * (end - begin) for begin, end in zip(self.begin, self.end, strict=True)]

    def poses(self, share: float) -> list[tuple]:
        """R, t and whether it touches itself, of each robot."""
        here = np.eye(3), np.zeros(3), self.R is None
        return [here] if self.R is None else [here, (self.R, self.t + (1 - share) * self.back, False)]


@dataclass(frozen=True)
class Met(Pressed):
    """A place where soft surfaces touch at the end of a way."""

    way: Way | None = None


def soft_places(touched: SurfaceModel, robot: Robot, mu: float, seed: int, kind: str) -> Iterator[Met]:
    """Random places without end."""
    rng, draw = np.random.default_rng(seed), {"twin": onto_twin, "itself": into_itself}[kind]
    while True:
        way = draw(touched, rng)
        place = way and met(touched, robot, way, mu, kind)
        if place:
            yield place


def between_states(touched: SurfaceModel, rng: np.random.Generator) -> np.ndarray:
    """(n_a,) mm between two training states."""
    states = touched.model.domain.states[:, : touched.model.rows.n_a]
    first, second = states[rng.integers(len(states), size=2)]
    return first + rng.uniform() * (second - first)


def onto_twin(touched: SurfaceModel, rng: np.random.Generator) -> Way | None:
    """None where the twin would reach where either is held, or does not reach the point, or a robot overlaps itself."""
    model, flexible = touched.model, touched.flexibility.sum(axis=1)
    stiff, depth = flexible < LOOSE * flexible.max(), model.length * rng.uniform(*DEPTHS)
    deltas = [between_states(touched, rng) for _ in range(2)]
    shapes = [model.shape(delta) for delta in deltas]
    numbers = rng.choice(np.flatnonzero(~stiff), size=2)
    normals = [outward(model, touched.patches, x, number) for x, number in zip(shapes, numbers, strict=True)]
    angle = rng.uniform(0, 2 * np.pi)
    spin = np.array([[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]])
    first, second = (tangents(normal[None])[0] for normal in (-normals[0], normals[1]))
    R = first.T @ spin @ second
    mine, others = (touched.patches.mean(x) for x in shapes)
    t = mine[numbers[0]] - R @ others[numbers[1]] - depth * normals[0]
    try:
        here, there = (ClosedMesh(ClosedSurface(x, model.skin.triangles)) for x in shapes)
    except InputError:
        return None
    for _ in range(30):  # back, where other points are deeper in it
        distances = np.stack([there.distance((mine - t) @ R), here.distance(others @ R.T + t)])
        t = t + max(0.0, -distances.min() - depth) * normals[0]
    if abs(distances.min() + depth) > 0.2 * depth or (distances[:, stiff] < 0).any():
        return None
    return Way(deltas, deltas, depth, R, t, depth * normals[0])


def into_itself(touched: SurfaceModel, rng: np.random.Generator) -> Way | None:
    """None where it does not touch itself on the way."""
    end, depth = between_states(touched, rng), touched.model.length * rng.uniform(*DEPTHS)
    scene, nothing = Bodies([PlacedModel(touched)]), np.zeros(0)

    def gap(share: float) -> float:
        places, rows = (
            touched.patches.mean(touched.model.shape(share * end)),
            touched.model.skin.rows(share * end, nothing),
        )
        return float(scene.surroundings.pairs(places, scene.normals([rows])).gaps.min(initial=np.inf))

    def first(least: float) -> float | None:
        """Share at which the gap is `least` for the first time."""
        high = next((share for share in np.linspace(0, 1, 41) if gap(share) < least), None)
        if not high:
            return None
        low = high - 1 / 40
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            low, high = (low, middle) if gap(middle) < least else (middle, high)
        return low

    shares = first(0.0), first(-depth)
    return None if None in shares else Way(*([share * end] for share in shares), depth)


def learned_scene(touched: SurfaceModel, robot: Robot, way: Way, share: float, mu: float) -> ContactScene:
    robots = [PlacedModel(touched, *pose, unilateral=robot.unilateral) for pose in way.poses(share)]
    return ContactScene(robots, mu=mu, parts=PARTS)


def met(touched: SurfaceModel, robot: Robot, way: Way, mu: float, kind: str) -> Met | None:
    """Both states at the end of the way; None where nothing touches then, or something does at its begin."""
    skin = touched.model.skin
    skinned = SkinnedRobot(robot, skin.nodes, skin.triangles, fe_points(touched, robot), itself=False)
    learned = learned_scene(touched, robot, way, BEFORE, mu).step(way.deltas(BEFORE), None)
    if learned.push.any() or learned.gap < -INSIDE * touched.model.length:
        return None
    coming = Coming((kind,), (), np.zeros((1, 3)), np.array([way.depth]))
    for share in LEARNED_STEPS:
        learned = learned_scene(touched, robot, way, share, mu).step(way.deltas(share), learned)
        if not learned.converged or not learned.trusted:
            return Met(coming, learned, way=way)
    if not learned.push.any():
        return None

    def fe(share: float) -> SurfaceScene:
        poses = [dict(zip(("R", "t", "itself"), pose, strict=True)) for pose in way.poses(share)]
        return SurfaceScene([replace(skinned, **pose) for pose in poses], mu=mu, parts=PARTS)

    free = SurfaceScene([skinned]).go(way.end[:1])
    full = fe(BEFORE if way.R is None else FAR).go(way.deltas(BEFORE))
    alone = contact_step(touched, way.end[0], (), unilateral=robot.unilateral).delta_e[0] - free.solved[0].delta_e
    longest = STEP * np.median(touched.spacings)
    for share in np.linspace(BEFORE, 1, 1 + int(np.ceil((1 - BEFORE) * way.depth / longest))):
        full = fe(share).step(way.deltas(share), full) if full.converged else full
    return Met(coming, learned, full, alone, way=way)
