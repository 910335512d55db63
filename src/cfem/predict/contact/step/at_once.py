"""Rounds of a step (`cfem.predict.contact.step.rounds`) in one compiled call each: of robots and obstacles on rigid
bodies, where no soft surfaces meet and all obstacles are rounded boxes. They call the loops that the rounds of other
steps call one by one.

Then the patches near obstacles (d,) are those that are known, and what obstacles press is all that presses."""

from typing import NamedTuple

import numpy as np
from numba import njit

from cfem.contact.rounded_boxes import Boxes, deep, frames, nearest
from cfem.predict.contact.forces.load_kernel import Answers, answers, load_robots, turned_compliance
from cfem.predict.contact.step.bodies import Bodies
from cfem.predict.contact.step.on_obstacles import CLOSE, FAR, OVERLAP, SIDE, TOLERANCE, Ended, _lawful, ended
from cfem.predict.contact.step.poses import _balance, _follow, gaps_of

# how rounds end: with what the law says, as more patches may touch, as one has to be made in parts, or not yet
HOLDS, GROWS, IN_PARTS, GOES_ON = range(4)


class UnpressedScene(NamedTuple):
    """Robots (r) with N patches, rounded boxes (n) and rigid bodies (b) where nothing but `before` presses.

    bodies (N,), still (N,): robots of the patches, and which are held still
    R (r, 3, 3), t (r, 3) mm: of the robots
    of_robots (r,), of_obstacles (n,), centres (b, 3), mobility and before: of `RigidBodies`
    boxes: of the obstacles"""

    bodies: np.ndarray
    still: np.ndarray
    R: np.ndarray
    t: np.ndarray
    of_robots: np.ndarray
    of_obstacles: np.ndarray
    centres: np.ndarray
    mobility: np.ndarray
    before: np.ndarray
    boxes: Boxes

    @classmethod
    def of(cls, scene: Bodies) -> "UnpressedScene | None":
        """None where rounds are not made in one call."""
        rigid, boxes = scene.rigid, scene.obstacles.boxes
        if rigid is None or scene.soft or boxes is None or not len(rigid.centres):
            return None
        robots = scene.bodies, scene.surfaces.held_still, scene.R, scene.t
        of_bodies = rigid.of_robots, rigid.of_obstacles, rigid.centres, rigid.mobility, rigid.before
        return cls(*robots, *of_bodies, boxes)


class PressedScene(NamedTuple):
    """Robots, patches and obstacles where forces bring them.

    places: (N, 3) mm of the patches
    R (r, 3, 3), t (r, 3) mm: of the robots
    R_met (n, 3, 3), t_met (n, 3) mm: of the obstacles
    distance (N,) mm of the patches from obstacles, `farthest` at most, and which (N,) is the nearest"""

    places: np.ndarray
    R: np.ndarray
    t: np.ndarray
    R_met: np.ndarray
    t_met: np.ndarray
    distance: np.ndarray
    which: np.ndarray


@njit(inline="always", error_model="numpy")  # else numba optimises what it calls once more
def _press(robots, loaded, predicted, R, t, near, forces, push, which, sloped, farthest):
    """`PressedScene` under forces (d, 3) N on patches near (d,) obstacles `which` (N,), push (N, 3) N on all: robots
    at R and t bear them, and rigid bodies follow."""
    load_robots(robots, near, forces, R, sloped, loaded)
    bodies, still, R_begin, t_begin, of_robots, of_obstacles, centres, mobility, before, boxes = predicted
    met, rigid = (of_obstacles, boxes.R, boxes.t), (centres, mobility, before)
    places, R, t, R_met, t_met = _follow(
        loaded.places, bodies, R_begin, t_begin, R, t, of_robots, near, forces, near, which, push, met, rigid
    )
    distance, place = nearest(_at(boxes, R_met, t_met), places, farthest)
    for p in range(len(distance)):
        if still[p]:
            distance[p] = np.inf
    return PressedScene(places, R, t, R_met, t_met, distance, place)


@njit(inline="always", error_model="numpy")
def _at(boxes, R, t):
    """The boxes in other poses."""
    return Boxes(R, t, boxes.core, boxes.rounding, boxes.below, boxes.reach)


@njit(cache=True, error_model="numpy")
def _near(near, numbers):
    """Those of `near` (d,) of numbers (N, 3)."""
    some = np.empty((len(near), 3))
    for i in range(len(near)):
        for a in range(3):
            some[i, a] = numbers[near[i], a]
    return some


@njit(cache=True, error_model="numpy")
def _frames(boxes, near, placed):
    """Frames (d, 3, 3) of obstacles near patches (d,)."""
    which = np.empty(len(near), dtype=np.int64)
    for i in range(len(near)):
        which[i] = placed.which[near[i]]
    return frames(_at(boxes, placed.R_met, placed.t_met), which, _near(near, placed.places))


class Ending(NamedTuple):
    """End of rounds in one call.

    how: HOLDS, GROWS, IN_PARTS or GOES_ON
    rounds: that were made
    depth: mm, how far within an obstacle the deepest patch began; deep: whether another side of it is nearer twice as
        far in
    held: (N, 3) mm, from where slip counts
    push (N, 3) N, sticks (N,) bool and modes (d,) of the last round
    missed: mm, by which patches missed the law after it
    ended, answers: of a state there"""

    how: int
    rounds: int
    placed: PressedScene
    depth: float
    deep: bool
    held: np.ndarray
    push: np.ndarray
    sticks: np.ndarray
    modes: np.ndarray
    missed: float
    ended: Ended
    answers: Answers


@njit(cache=True, error_model="numpy")
def rounds_at_once(robots, to_answer, loaded, predicted, R, t, presses, slips, mu, length, most, first):
    """`Ending` of rounds, `most` at most, with robots at R (r, 3, 3), t (r, 3) mm; first: whether a step begins.

    to_answer: actuators and numbers of `load_kernel.answers`
    presses: patches near (d,), obstacles `which` (N,) that press them by push (N, 3) N, and which stick, (N,) bool
    slips: from where slip counts: where patches are stuck, (N, 3) mm, else, where that is NaN, where they began, (N, 3)
        mm, with obstacles at (n, 3, 3) and (n, 3) mm"""
    (near, which, push, sticks), (stuck, begun, R_then, t_then) = presses, slips
    d, forces, rounds, missed, far = len(near), _near(near, push), 0, 0.0, FAR * length
    placed = _press(robots, loaded, predicted, R, t, near, forces, push, which, True, far)
    held, depth = _held(stuck, begun, placed.distance)
    boxes = _at(predicted.boxes, placed.R_met, placed.t_met)
    is_deep = depth > 0 and deep(boxes, placed.which, placed.places, placed.distance, SIDE)
    there, modes, how = _frames(predicted.boxes, near, placed), np.zeros(d, dtype=np.int8), GOES_ON
    on_bodies = predicted.of_robots, predicted.bodies, predicted.of_obstacles, predicted.centres
    while how == GOES_ON and rounds < most:
        if (first or rounds) and _grows(placed.distance, near):
            how = GROWS
            break
        if not d:  # all are free
            how, rounds = HOLDS, rounds + 1
            break
        if rounds:
            load_robots(robots, near, forces, placed.R, True, loaded)
        slides, turn = _sliding(near, forces, sticks, placed.which, predicted.boxes.rounding)
        gaps = gaps_of(
            *(there, placed.places, near, placed.which, held, placed.distance),
            *(R_then, t_then, placed.R_met, placed.t_met, True, mu),
        )
        compliance = turned_compliance(robots, loaded.compliance, placed.R, True)
        local, found, found_modes, mobility, turning, sound = _balance(
            *(there, gaps, mu, placed.places, near, placed.which, near, forces, push, slides, compliance),
            *(on_bodies, predicted.mobility),
        )
        if turn or not sound:
            how = IN_PARTS
            break
        rounds, modes = rounds + 1, found_modes
        forces = _turned(found, forces, turning)
        push, sticks = np.zeros(push.shape), np.zeros(len(push), np.bool_)
        _put(near, forces, push)
        _put_sticking(near, modes, sticks)
        placed = _press(robots, loaded, predicted, placed.R, placed.t, near, forces, push, placed.which, False, far)
        there = _frames(predicted.boxes, near, placed)
        compliance = turned_compliance(robots, loaded.compliance, placed.R, False)
        by_law, away, turns, beyond, within, largest, differs = _lawful(
            *(local, forces, sticks, there, placed.places, near, placed.which, held, placed.distance),
            *((R_then, t_then, placed.R_met, placed.t_met, True), mu, compliance, np.arange(d), mobility),
        )
        missed = max(away, within, 0.0)
        if max(away, turns) <= TOLERANCE * length and within <= OVERLAP * length and beyond <= TOLERANCE * largest:
            how = HOLDS
            if differs:
                _put(near, by_law, push)
                load_robots(robots, near, by_law, placed.R, False, loaded)
    of_near = near, push, sticks, placed.which, there, placed.distance
    poses, keeps = (R_then, t_then, placed.R_met, placed.t_met, True), mu > 0 and d > 0
    end = ended(placed.places, held, *of_near, poses, CLOSE * length, keeps, len(R))
    says = answers(robots.shapes, *to_answer, loaded)
    return Ending(how, rounds, placed, depth, is_deep, held, push, sticks, modes, missed, end, says)


@njit(cache=True, error_model="numpy")
def _held(stuck, begun, distance):
    """Places from where slip counts, (N, 3) mm, and how far the deepest patch is within an obstacle, mm, at distances
    (N,) mm."""
    held, depth = stuck.copy(), 0.0
    for p in range(len(held)):
        depth = max(depth, -distance[p])
        for a in range(3):
            if np.isnan(stuck[p, a]):
                held[p, a] = begun[p, a]
    return held, depth


@njit(cache=True, error_model="numpy")
def _put_sticking(near, modes, sticks):
    """Puts which of the patches near (d,) stick, by modes (d,), into those of all, (N,) bool."""
    for i in range(len(near)):
        sticks[near[i]] = modes[i] == 1


@njit(cache=True, error_model="numpy")
def _grows(distance, near):
    """True where others than the patches near (d,) may touch."""
    mine = np.zeros(len(distance), np.bool_)
    for p in near:
        mine[p] = True
    others = 0
    for p in range(len(distance)):
        others += distance[p] <= 0 and not mine[p]
    return others > 0


@njit(cache=True, error_model="numpy")
def _sliding(near, forces, sticks, which, rounding):
    """Which patches near (d,) obstacles slide, and whether any does that presses a curved one by forces (d, 3) N."""
    slides, turns = np.empty(len(near), dtype=np.bool_), False
    for i in range(len(near)):
        slides[i] = not sticks[near[i]]
        pressed = forces[i, 0] != 0.0 or forces[i, 1] != 0.0 or forces[i, 2] != 0.0
        turns |= slides[i] and pressed and rounding[which[near[i]]] > 0
    return slides, turns


@njit(cache=True, error_model="numpy")
def _turned(push, before, turning):
    """Push (d, 3) N with what forces turn as bodies move, by turning (3 d, 3 d) of its change from `before`, of size 0
    where none turns."""
    changed = push.copy()
    for i in range(len(turning)):
        for j in range(len(turning)):
            changed[i // 3, i % 3] += turning[i, j] * (push[j // 3, j % 3] - before[j // 3, j % 3])
    return changed


@njit(cache=True, error_model="numpy")
def _put(near, forces, on_all):
    """Puts forces (d, 3) N of patches near (d,) into those of all, (N, 3) N."""
    for i in range(len(near)):
        for a in range(3):
            on_all[near[i], a] = forces[i, a]
