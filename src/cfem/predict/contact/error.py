"""The error of the contact of a learned robot among rigid obstacles, calibrated on finite elements that touch the same.

Most of the error of a force comes from the place of the surface before anything touches it. Where this place is wrong
by eps, and an obstacle presses the surface in by d, the force is wrong by the share eps / d. The error of a state is
factor L^power, as `cfem.condensed.model_error` has it of the place in the domain, with

    L = n^2 (1 + (eps / d) / FLOOR)

of n obstacles that touch; eps and d are means over the touching points, by their forces. The square was chosen on one
robot, where bounds hold at as many places with one obstacle as with several. On another they hold at 89 % of the places
with several (docs/figures/model-error.md)."""

from dataclasses import dataclass

import numpy as np

from cfem.condensed.model_error import ContactError
from cfem.contact.pairs import Pressing
from cfem.predict.contact.step.state import ContactState
from cfem.predict.contact.surface.surface_model import NONE, SurfaceModel

FLOOR = 1e-3  # of force and motion: what is off besides
TINY = np.finfo(float).tiny


@dataclass(frozen=True)
class ContactBounds:
    """Bounds of the error of one contact state, infinite where it is not trusted, or more touches than in calibration.

    force: N, of the force by any of the obstacles; tip: mm, of how forces move all effector points together"""

    force: float
    tip: float


def contact_error(stated: ContactError, touched: SurfaceModel, state: ContactState) -> ContactBounds:
    """Bounds of a robot's error at a state among rigid obstacles; touched: the robot's model."""
    force, moved = sizes(touched, state)
    count = len(touching(state))
    if not state.converged or not state.trusted or count > stated.most:
        return ContactBounds(np.inf, np.inf)
    L = np.array(measure(np.array(stated.off), state))
    return ContactBounds(float(stated.force.at(L)) * force, float(stated.tip.at(L)) * moved)


def measure(off: np.ndarray, state: ContactState) -> float:
    """L of the bounds, 1 at least; off (N,) mm as `ContactError` has it."""
    pressing, force = state.pressing, np.linalg.norm(forces_of(state, touching(state)), axis=1).sum()
    if not force or not pressing.sum() > 0:
        return 1.0
    eps = float(pressing @ off[state.pairs.points] / pressing.sum())
    travel = max(2 * state.stored / force, TINY)  # the forces have done their work on this way
    return len(touching(state)) ** 2 * (1 + eps / travel / FLOOR)


def sizes(touched: SurfaceModel, state: ContactState) -> tuple[float, float]:
    """N, the sum of the forces of all obstacles, each as a vector, and mm by which each of them moves the effector
    points, added up too: where obstacles press against each other, errors are not as small as what is left."""
    met, model = touching(state), touched.model
    forces, points = forces_of(state, met), ~np.array(model.rows.turns)
    C_es = model.skin.compliance(state.deltas[0], NONE)[0][points]
    each = [
        C_es @ np.einsum("pik,pi->k", touched.U[state.pairs.points[mine]], state.push[mine])
        for mine in (state.among(0, number) for number in met)
    ]
    apart, together = sum(map(np.linalg.norm, each)), np.linalg.norm(sum(each))
    moved = float(np.linalg.norm(state.moved[0][points]))
    return float(np.linalg.norm(forces, axis=1).sum()), moved * float(apart / together if together > 0 else 1.0)


def touching(state: Pressing) -> list[int]:
    """Numbers of the obstacles that press the first robot, the body 0, as `pairs` have them."""
    mine = (state.bodies[state.pairs.points] == 0) & state.push.any(axis=1)
    return np.unique(state.pairs.partners[mine]).tolist()


def forces_of(state: Pressing, met: list[int]) -> np.ndarray:
    """(o, 3) N on the first robot by the bodies and obstacles `met`."""
    pushed = [state.push[state.among(0, number)].sum(axis=0) for number in met]
    return np.array(pushed).reshape(-1, 3)
