"""The error of the contact of a learned robot, calibrated on finite elements that touch the same rigid obstacles.

Where a touching pair i lies, of a point and the obstacle or the soft surface before it, the model knows up to about

    g_i = eps_i + w(m_i)        w(m) = FLOOR m (1 + m / (BENT length))

along the force on it. eps_i is how far the free surface is off, of a soft pair those of all its points by their weights
in its gap, of both bodies. m_i is the way by which forces move the two sides of the pair apart, those of each obstacle
by themselves, added up: where obstacles press against each other, they move it little together, while errors of what
each does remain. Forces make up for g by A^-1 g, with A the compliance between the touching pairs along their forces,
of all bodies. With obstacles on both sides of the robot A^-1 is large: 1 % of the motion by each may be 30 % of the
forces. The bound of a force is a factor times the largest that g makes of it. That of the tip is a factor times what
these forces do to it and the largest w. One obstacle and several have factors of their own
(`cfem.surrogate.contact_error`).

Soft obstacles take the factors of rigid ones. These hold where the points that a node presses lie in a plane. Over an
edge, the plane that fits them turns with where they are, which g leaves out: there nothing is stated."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cfem.condensed.model_error import ContactError
from cfem.contact.pairs import Pairs, Pressing
from cfem.predict.contact.forces.loaded_robots import LoadedRobots
from cfem.predict.contact.step.bodies import Bodies
from cfem.predict.contact.step.state import ContactState

FLOOR, BENT = 1e-3, 0.01  # share of a motion that is not known, and the motion, of the length, that doubles it
STIFFEST = 1e6  # times the least stiffness of the touching points
FLAT = 0.05  # distances of points: how far, at most, the points that a soft pair presses lie beside their plane


@dataclass(frozen=True)
class ContactBounds:
    """Bounds of the error of one contact state, infinite where nothing is stated of it.

    force: N, of the force by any of the obstacles; tip: mm, of how forces move all effector points together"""

    force: float
    tip: float


NOT_STATED = ContactBounds(np.inf, np.inf)


def contact_error(stated: Sequence[ContactError], scene: Bodies, state: ContactState) -> ContactBounds:
    """Bounds of the error of the first robot of a scene at a state. Infinite where the state is not trusted, where more
    obstacles touch than in the calibration, and where soft surfaces press each other by more points than in the
    calibration, or at edges.

    stated: error of the contact of each robot's model"""
    count = len(touching(state))
    if not state.converged or not state.trusted:
        return NOT_STATED
    if not count:
        return ContactBounds(0.0, 0.0)
    factors = [robot.of(count) for robot in stated]
    if None in factors or not _known_between_soft(stated, scene, state):
        return NOT_STATED
    force, tip = expected_error(np.concatenate([robot.off for robot in stated]), scene, state)
    return ContactBounds(max(each.force for each in factors) * force, max(each.tip for each in factors) * tip)


def _known_between_soft(stated: Sequence[ContactError], scene: Bodies, state: ContactState) -> bool:
    """True where no soft surfaces press each other, or do so by no more points than in the calibration, on points that
    lie in planes."""
    pressed = state.push.any(axis=1)
    soft = state.pairs.some(pressed & (state.pairs.slots < len(state.places)))
    if not len(soft):
        return True
    if pressed.sum() > min(robot.points for robot in stated):
        return False
    return bool((unevenness(soft, state.places, scene.surroundings.spacings) <= FLAT).all())


def unevenness(soft: Pairs, places: np.ndarray, spacings: np.ndarray) -> np.ndarray:
    """(p,) root mean squares of how far the points that soft pairs press lie beside the planes through their nodes, in
    distances of points; places (N, 3) mm of all points, spacings (N,) mm."""
    weights = -soft.relative
    weights[np.arange(len(soft)), soft.points] = 0.0
    heights = soft.frames[:, 0] @ places.T
    beside, sizes = heights - (weights * heights).sum(axis=1)[:, None], np.abs(weights)
    return np.sqrt((sizes * beside**2).sum(axis=1)) / ((sizes @ spacings) / sizes.sum(axis=1))


def expected_error(off: np.ndarray, scene: Bodies, state: ContactState) -> tuple[float, float]:
    """N and mm, of the force between the first robot and any obstacle, soft or rigid, and of its tip, that errors are
    in proportion to; off (N,) mm of the points of all robots as `ContactError` has it. The first robot touches
    something."""
    pressed = np.flatnonzero(state.push.any(axis=1))
    pairs, push = state.pairs.some(pressed), state.push[pressed]
    size = np.linalg.norm(push, axis=1)
    along, points = push / size[:, None], pairs.used
    relative = pairs.relative[:, points]
    meetings, of_pairs = _meetings(state, pressed)
    C, to_tip = _compliance(scene, state, points)
    by_pairs = relative[:, :, None] * along[:, None, :]  # (p, c, 3) on points by forces of 1 N of pairs
    A = np.einsum("pia,iajb,qjb->pq", by_pairs, C, by_pairs, optimize=True)
    motion = np.abs((A * size) @ of_pairs).sum(axis=1)
    unknown = FLOOR * motion * (1 + motion / (BENT * scene.length))
    misplaced = (np.abs(relative) @ off[points]) * np.abs((along * pairs.frames[:, 0]).sum(axis=1))
    forces = _stiffness(A) @ ((misplaced + unknown)[:, None] * of_pairs)  # (p, o) by what is off at each meeting
    of_tip = np.linalg.norm(np.einsum("eia,pia->ep", to_tip, by_pairs, optimize=True) @ forces, axis=0).sum()
    between = np.einsum("ip,io,ik->pok", of_pairs, forces, _counted(pairs, along))[meetings.min(axis=1) == 0]
    return float(np.linalg.norm(between, axis=2).sum(axis=1).max()), float(of_tip + unknown.max())


def _meetings(state: Pressing, pressed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(m, 2) numbers of bodies or obstacles that press each other, and of which of these the pairs `pressed` (p,) are,
    (p, m) 0 or 1."""
    sides = np.stack([state.bodies[state.pairs.points[pressed]], state.pairs.partners[pressed]], axis=1)
    meetings, numbers = np.unique(np.sort(sides, axis=1), axis=0, return_inverse=True)
    return meetings, (numbers.reshape(-1, 1) == np.arange(len(meetings))).astype(float)


def _compliance(scene: Bodies, state: ContactState, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(c, 3, c, 3) and (n, c, 3) mm/N: of points (c,) of all robots and of the effector points of the first one to
    forces on these points, in the scene's axes."""
    nothing, forces = [None] * len(state.deltas), np.zeros_like(state.forces)
    robots = LoadedRobots(scene.surfaces, state.deltas, nothing, state.R, state.t, points, forces)
    C, held = robots.compliance(under_forces=False).reshape(len(points), 3, -1, 3), robots.held[0]
    first = scene.robots[0].patched
    mine, seen = points[points < len(first.patches)], ~np.array(first.model.rows.turns)
    of_tip = np.einsum("ek,iak->eia", held.C_es, first.U[mine])
    of_tip += first.tip(mine, first.turns(held.rows, mine), held.basis)
    to_tip = np.zeros((seen.sum(), len(points), 3))
    to_tip[:, : len(mine)] = of_tip[seen] @ state.R[0].T
    return C, to_tip


def _stiffness(A: np.ndarray) -> np.ndarray:
    """Inverse (c, c) N/mm of a compliance, `STIFFEST` at most."""
    sizes, axes = np.linalg.eigh(A)
    return (axes / np.maximum(sizes, sizes.max() / STIFFEST)) @ axes.T


def touching(state: Pressing) -> list[int]:
    """Numbers of the bodies and obstacles that press the first robot, the body 0, as `pairs` have them."""
    pressed = state.push.any(axis=1)
    mine, met = state.bodies[state.pairs.points[pressed]], state.pairs.partners[pressed]
    return np.unique(np.concatenate([met[mine == 0], mine[met == 0]])).tolist()


def forces_of(state: Pressing, met: list[int]) -> np.ndarray:
    """(o, 3) N of the bodies and obstacles `met` and the first robot: vectors of rigid obstacles, and of soft ones the
    sum of the normal forces, in the first column."""
    counted = _counted(state.pairs, state.push)
    return np.array([counted[state.among(0, number)].sum(axis=0) for number in met]).reshape(-1, 3)


def _counted(pairs: Pairs, forces: np.ndarray) -> np.ndarray:
    """(p, 3) of forces (p, 3) on the points of pairs, as they count in sums: those of soft pairs, which point to either
    side, by their normal parts, in the first column."""
    normal = np.zeros_like(forces)
    normal[:, 0] = (forces * pairs.frames[:, 0]).sum(axis=1)
    return np.where((pairs.slots < pairs.relative.shape[1])[:, None], normal, forces)
