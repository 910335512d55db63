"""The error of the contact of a learned robot among rigid obstacles, calibrated on finite elements that touch the same.

Where a touching point i lies, the model knows up to about

    g_i = eps_i + w(m_i)        w(m) = FLOOR m (1 + m / (BENT length))

along the force on it. eps_i is how far the free surface is off. m_i is the way by which the obstacles move the point,
each by its own forces, added up: where obstacles press against each other, they move it little together, while errors
of what each does remain. Obstacles do not yield, so that forces make up for g by A^-1 g, with A the compliance between
the touching points along their forces. With obstacles on both sides of the robot A^-1 is large: 1 % of the motion by
each may be 30 % of the forces. The bound of a force is a factor times the largest that g makes of it. That of the tip
is a factor times what these forces do to it and the largest w. One obstacle and several have factors of their own
(`cfem.surrogate.contact_error`)."""

from dataclasses import dataclass

import numpy as np

from cfem.condensed.model_error import ContactError
from cfem.contact.pairs import Pressing
from cfem.predict.contact.forces.loaded_robots import LoadedRobots
from cfem.predict.contact.step.state import ContactState
from cfem.predict.contact.surface.surface_model import SurfaceModel

FLOOR, BENT = 1e-3, 0.01  # share of a motion that is not known, and the motion, of the length, that doubles it
STIFFEST = 1e6  # times the least stiffness of the touching points


@dataclass(frozen=True)
class ContactBounds:
    """Bounds of the error of one contact state, infinite where it is not trusted, or more touches than in calibration.

    force: N, of the force by any of the obstacles; tip: mm, of how forces move all effector points together"""

    force: float
    tip: float


def contact_error(stated: ContactError, touched: SurfaceModel, state: ContactState) -> ContactBounds:
    """Bounds of a robot's error at a state among rigid obstacles; touched: the robot's model."""
    count = len(touching(state))
    if not count and state.converged and state.trusted:
        return ContactBounds(0.0, 0.0)
    factors = stated.of(count)
    if factors is None or not state.converged or not state.trusted:
        return ContactBounds(np.inf, np.inf)
    force, tip = expected_error(np.array(stated.off), touched, state)
    return ContactBounds(factors.force * force, factors.tip * tip)


def expected_error(off: np.ndarray, touched: SurfaceModel, state: ContactState) -> tuple[float, float]:
    """N and mm, of the force by any obstacle and of the tip, that errors are in proportion to; off (N,) mm as
    `ContactError` has it. The state is of the robot in its own frame, and touches something."""
    pressed = np.flatnonzero((state.bodies[state.pairs.points] == 0) & state.push.any(axis=1))
    pressed = pressed[np.argsort(state.pairs.points[pressed])]
    points, push = state.pairs.points[pressed], state.push[pressed]
    size = np.linalg.norm(push, axis=1)
    along = push / size[:, None]
    by_obstacle = (state.pairs.partners[pressed, None] == np.array(touching(state))).astype(float)
    A, to_tip = _compliance(touched, state, points, along)
    motion = np.abs((A * size) @ by_obstacle).sum(axis=1)
    unknown = FLOOR * motion * (1 + motion / (BENT * touched.model.length))
    misplaced = off[points] * np.abs((along * state.pairs.frames[pressed, 0]).sum(axis=1))
    forces = _stiffness(A) @ ((misplaced + unknown)[:, None] * by_obstacle)  # (c, o) by what is off at each obstacle
    on_obstacles = np.einsum("ip,io,ik->pok", by_obstacle, forces, along)
    of_tip = np.linalg.norm(to_tip @ forces, axis=0).sum() + unknown.max()
    return float(np.linalg.norm(on_obstacles, axis=2).sum(axis=1).max()), float(of_tip)


def _compliance(
    touched: SurfaceModel, state: ContactState, points: np.ndarray, along: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(c, c) and (n, c) mm/N: of points (c,) and of the effector points to forces along directions (c, 3) on these
    points."""
    robots = LoadedRobots.of(touched, state.deltas[0])
    robots.know(points, np.zeros_like(state.forces))
    C, held = robots.compliance(under_forces=False).reshape(len(points), 3, -1, 3), robots.held[0]
    of_tip = np.einsum("ek,iak->eia", held.C_es, touched.U[points])
    of_tip += touched.tip(points, touched.turns(held.rows, points), held.basis)
    seen = of_tip[~np.array(touched.model.rows.turns)]
    return np.einsum("ia,iajb,jb->ij", along, C, along), np.einsum("eia,ia->ei", seen, along)


def _stiffness(A: np.ndarray) -> np.ndarray:
    """Inverse (c, c) N/mm of a compliance, `STIFFEST` at most."""
    sizes, axes = np.linalg.eigh(A)
    return (axes / np.maximum(sizes, sizes.max() / STIFFEST)) @ axes.T


def touching(state: Pressing) -> list[int]:
    """Numbers of the obstacles that press the first robot, the body 0, as `pairs` have them."""
    mine = (state.bodies[state.pairs.points] == 0) & state.push.any(axis=1)
    return np.unique(state.pairs.partners[mine]).tolist()


def forces_of(state: Pressing, met: list[int]) -> np.ndarray:
    """(o, 3) N on the first robot by the bodies and obstacles `met`."""
    pushed = [state.push[state.among(0, number)].sum(axis=0) for number in met]
    return np.array(pushed).reshape(-1, 3)
