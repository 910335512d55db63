"""A learned robot that touches anything with any part of its surface, at actuators that are held.

Signed distances and frames of obstacles at the patches' places, and the compliance of all patches that touch
(`cfem.predict.touchable`), make one linear contact problem (`cfem.contact`), which is solved exactly. It is posed again
where the patches have come to, until neither forces nor the patches that touch change. The forces of the actuators
follow from the energy of the loaded robot, Psi - w . s_0 - w . C_ss w / 2 (`cfem.predict.loaded`).

A step begins where the last one ended: on which side of an edge a patch has come to lie, and where friction holds it,
depends on the way."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np

from cfem.contact.modes import Mode
from cfem.contact.newton import modes_from, newton
from cfem.contact.obstacle import Obstacle
from cfem.contact.problem import ContactProblem, Law
from cfem.contact.several import frames, nearest
from cfem.contact.solve import ContactStatus, solve_contact
from cfem.predict.touchable import NONE, Touchable

ITERATIONS = 60
TOLERANCE = 1e-9  # of the length: largest change of a patch's place between the last two rounds
MOST = 30  # patches that may touch at once
NEAR, FLAT = 1e-5, 1e-6  # mm to points at which normals are compared; 1/mm: curvature of a flat obstacle
OVERLAP = 1e-6  # of the length: how far a patch may be within an obstacle


class TouchedStatus(Enum):
    """How it ended; the value is the sentence that the user reads."""

    CONVERGED = "converged"
    NO_MODE = "no combination of open, sticking and sliding patches is in equilibrium"
    ITERATIONS = "open, sticking and sliding patches keep changing: the iterations allowed were used up"
    MANY = f"more than {MOST} patches touch: take larger patches"


@dataclass(frozen=True)
class Touched:
    """One state. patches (c,): numbers of those that touch; forces (c, 3) N on them, normals (c, 3) of what they touch
    and places (c, 3) mm; everywhere (N, 3) mm: places of all patches; gaps (c,) mm; obstacles (c,): numbers of those
    that they touch; modes: of each patch; delta_e (n_e,) mm and lambda_a (n_a,) N of the touched robot; rows (k,) mm of
    the skin, from which `LearnedSkin.surface` draws it (without what is local); stuck (N, 3) mm where friction holds
    each patch, NaN where it does not."""

    status: TouchedStatus
    patches: np.ndarray
    forces: np.ndarray
    normals: np.ndarray
    places: np.ndarray
    everywhere: np.ndarray
    gaps: np.ndarray
    obstacles: np.ndarray
    modes: tuple[Mode, ...]
    delta_e: np.ndarray
    lambda_a: np.ndarray
    rows: np.ndarray
    stuck: np.ndarray
    iterations: int

    @property
    def converged(self) -> bool:
        return self.status is TouchedStatus.CONVERGED

    def pressed(self, count: int) -> np.ndarray:
        """(count,) N: how hard each obstacle is pressed, the sum of its normal forces."""
        return np.bincount(self.obstacles, (self.forces * self.normals).sum(axis=1), count).astype(float)


def touch_step(
    touchable: Touchable,
    delta_a: np.ndarray,
    obstacles: Sequence[Obstacle],
    law: Law = "coulomb",
    mu: float = 0.0,
    before: Touched | None = None,
) -> Touched:
    """Quasi-static step to delta_a (n_a,) mm from the state `before` (none: the free robot, friction holds nothing
    yet). Obstacles stand in the frame of the robot; mu: of friction, of all. Never raises for numerical failure."""
    delta_a = np.asarray(delta_a, float)
    held, count = touchable.held(delta_a), len(touchable.patches)
    stuck = np.full((count, 3), np.nan)
    chosen = np.zeros(0, dtype=np.int64) if before is None else before.patches
    forces = np.zeros((0, 3)) if before is None else before.forces
    places, mu = held.places(chosen, forces), mu if law == "coulomb" else 0.0
    if before is not None and mu:  # what did not touch slides from where it was
        stuck = np.where(np.isnan(before.stuck), before.everywhere, before.stuck)
    distance, which = nearest(obstacles, places)
    into, modes = np.zeros((0, 3, 3)), ()
    status, iteration = TouchedStatus.ITERATIONS, 0
    while iteration < ITERATIONS:
        iteration += 1
        touching = distance <= 0
        touching[chosen[forces.any(axis=1)]] = True
        last, chosen = _spread(chosen, forces, count), np.flatnonzero(touching)
        forces, modes = last[chosen], ()
        if not 0 < len(chosen) <= MOST:
            status = TouchedStatus.MANY if len(chosen) else TouchedStatus.CONVERGED
            break
        into = frames(obstacles, which[chosen], places[chosen])
        held_at = stuck[chosen] if mu else places[chosen]
        slip = places[chosen] - np.where(np.isnan(held_at), places[chosen], held_at)
        yields = held.compliance(chosen)
        bent = _bent(obstacles, which[chosen], places[chosen], into, forces, yields)
        answer = _pressed(bent, distance[chosen], into, slip, forces, mu)
        if answer is None and bent is not yields:
            bent, answer = yields, _pressed(yields, distance[chosen], into, slip, forces, mu)
        if answer is None:
            status = TouchedStatus.NO_MODE
            break
        modes, pressed = answer
        if bent is not yields:  # the forces turn with the surface where the patches have come to
            ahead = places[chosen] + (bent @ (pressed - forces).ravel()).reshape(-1, 3)
            there = frames(obstacles, which[chosen], ahead)
            pressed = ((into @ pressed[:, :, None])[:, None, :, 0] @ there)[:, 0]
            into = there
        forces = pressed
        moved = held.places(chosen, forces)
        if mu:
            fresh = chosen[np.isnan(stuck[chosen, 0])]  # a patch that touches for the first time sticks where it came
            stuck[fresh] = moved[fresh]
        change, places = np.abs(moved - places).max(), moved
        distance, which = nearest(obstacles, places)
        if change <= TOLERANCE * touchable.model.length and distance.min() >= -OVERLAP * touchable.model.length:
            status = TouchedStatus.CONVERGED
            break
    if mu:
        sticks = np.array([mode is Mode.STICK for mode in modes or (None,) * len(chosen)], dtype=bool)
        free = np.ones(count, dtype=bool)
        free[chosen[sticks]] = False
        stuck[free] = np.nan
        slides = chosen[~sticks & forces.any(axis=1)]
        stuck[slides] = places[slides]
    model, w = touchable.model, held.work(chosen, forces)
    base = model.at_displacement(delta_a)
    helped = 0.0
    if forces.any():
        helped = w @ model.skin.gradient(delta_a, NONE) + model.skin.compliance_work(delta_a, NONE, w) / 2
    return Touched(
        status,
        chosen,
        forces,
        into[:, 0],
        places[chosen],
        places,
        distance[chosen],
        which[chosen],
        modes,
        base.delta_e + held.C_es @ w,
        base.lambda_a - helped,
        held.rows + held.C_ss @ w,
        stuck,
        iteration,
    )


def _spread(chosen: np.ndarray, forces: np.ndarray, count: int) -> np.ndarray:
    found = np.zeros((count, 3))
    found[chosen] = forces
    return found


def _bent(
    obstacles: Sequence[Obstacle],
    which: np.ndarray,
    places: np.ndarray,
    into: np.ndarray,
    forces: np.ndarray,
    yields: np.ndarray,
) -> np.ndarray:
    """(3 c, 3 c) mm/N: the compliance with the turn of normal forces on curved obstacles, f = l n(x), in it:
    (C^-1 - B)^-1 with B = l dn/dx; `yields` itself where nothing is curved or the sum is not positive definite."""
    pushed = (forces * into[:, 0]).sum(axis=1)
    if not pushed.any():
        return yields
    h, c = NEAR, len(into)
    turns = np.stack([frames(obstacles, which, places + h * into[:, side])[:, 0] - into[:, 0] for side in (1, 2)], 1)
    if np.abs(turns).max() <= h * FLAT or np.abs(turns).max() > h / NEAR:  # flat, or an edge in between
        return yields
    B = np.zeros((c, 3, c, 3))
    bend = into[:, 1:].swapaxes(1, 2) @ turns / h * pushed[:, None, None]
    B[np.arange(c), :, np.arange(c)] = (bend + bend.swapaxes(1, 2)) / 2
    found = np.linalg.solve(np.eye(3 * c) - yields @ B.reshape(3 * c, 3 * c), yields)
    try:
        np.linalg.cholesky((found + found.T) / 2)
    except np.linalg.LinAlgError:
        return yields
    return found


def _pressed(
    compliance: np.ndarray, distance: np.ndarray, into: np.ndarray, slip: np.ndarray, forces: np.ndarray, mu: float
) -> tuple[tuple[Mode, ...], np.ndarray] | None:
    """Modes and forces (c, 3) N of patches with `compliance` (3 c, 3 c) mm/N at `distance` (c,) mm from what they meet,
    in its frames `into` (c, 3, 3); they have slipped by `slip` (c, 3) mm and carry `forces`."""
    n, shape = 3 * len(into), (len(into), 3, 3 * len(into))
    W = (into @ (into @ compliance.reshape(shape)).reshape(n, n).T.reshape(shape)).reshape(n, n)
    W = (W + W.T) / 2
    gap, known = (into @ slip[:, :, None])[:, :, 0], (into @ forces[:, :, None])[:, :, 0]
    gap[:, 0] = distance
    free = gap.ravel() - W @ known.ravel()
    found, _ = newton(W, free, mu, known)
    if found is not None:
        modes = modes_from(found, mu)
    else:
        answer = solve_contact(ContactProblem(W, free, mu=mu), "coulomb")
        if answer.status not in (ContactStatus.SOLVED, ContactStatus.SEVERAL):
            return None
        modes, found = answer.modes, answer.lam.reshape(-1, 3)
    return modes, (found[:, None] @ into)[:, 0]
