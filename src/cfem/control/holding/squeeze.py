"""Shares of a squeeze among robots, so that it does not push the object aside.

Where all actuators are pulled alike, two robots on one side of an object push the one on the other side back: the
object moves away from where it stands, and plans that bring it there again tilt it. Seen from rest, robot i presses
with N_i = (c_i p_i - g_i) / w_i along the mean normal of its points: c_i is how far p_i = 1 mm of all its actuators
brings them towards the object, g_i their gap, w_i their compliance. Of the forces of the equal squeeze those are kept
that balance each other, the projection onto the null space of the grasp matrix (Murray, Li and Sastry, A Mathematical
Introduction to Robotic Manipulation, 1994, section 5.3)."""

from collections.abc import Sequence

import numpy as np

from cfem.equilibrium.contact.grasp import FreeObject
from cfem.equilibrium.contact.points import PointRobot, response
from cfem.equilibrium.system.actuation import displacement

LEAST = 0.1  # of the mean normal force: a squeeze that leaves a robot with less does without it


def balanced(fingers: Sequence[PointRobot], held: FreeObject, counts: Sequence[int], preload: float) -> np.ndarray:
    """Squeeze (n_a,) mm of `preload` on average over the robots, which have so many actuators each, shared so that
    normal forces balance on the object where it is. `preload` for all where they cannot, each robot with its part."""
    pushes, robots = [], []
    length = max(float(np.linalg.norm(finger.points - held.centre, axis=1).max()) for finger in fingers)
    for finger, n_a in zip(fingers, counts, strict=True):
        gap, frames = held.surface(finger.points)
        inwards = -frames[:, 0].mean(axis=0)
        arm = finger.points.mean(axis=0) - held.centre
        pushes.append(np.concatenate([inwards, np.cross(arm, inwards) / length]))
        still = np.zeros(3 * len(gap))
        rest, compliance = response(finger, displacement(np.zeros(n_a)), still, still)
        evenly = np.tile(inwards @ finger.turn, len(gap)) / len(gap)  # of a force of 1 N, along the mean normal
        robots.append((evenly @ rest.by_actuators.sum(axis=1), gap.mean(), evenly @ compliance @ evenly))
    closes, gaps, soft = (np.array(column) for column in zip(*robots, strict=True))
    equal = np.full(sum(counts), preload)
    force = (closes * preload - gaps) / soft
    G = np.array(pushes).T[: len(held.wrench)]
    kept = force - np.linalg.pinv(G, rcond=1e-6) @ (G @ force)
    if not kept.min() > LEAST * force.mean():
        return equal
    pulls, begins = kept * soft / closes, gaps / closes
    return np.repeat(begins + pulls * (preload - begins.mean()) / pulls.mean(), counts)
