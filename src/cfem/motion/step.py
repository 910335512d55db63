"""One step in time of the condensed model: the implicit midpoint rule of its Lagrangian.

With v the mean velocity of the step, q_m = q + dt v / 2 and the forces Q at q_m,

    p' = p + dt (dL/dq + Q)        M(q_m) v = p + dt/2 (dL/dq + Q)        q' = q + dt v

(Marsden and West, Acta Numerica 10, 2001): symplectic, so that without viscosity the energy does not drift, and of
second order. Where displacements of actuators are commanded, their v is known and their forces follow.

What is learned is asked once, at the middle that v leads to if it goes on changing as in the step before
(expansion.py), and once more where the middle turns out to be elsewhere."""

from dataclasses import dataclass

import numpy as np

from cfem.core.errors import NumericalError
from cfem.motion.expansion import NEAR, Expansion, expansion
from cfem.motion.model import MotionModel
from cfem.motion.payload import Payload

_EXPANSIONS = 30
_DIFFERENCE = 1e-4  # mm: how the payload's inertia turns, by differences


@dataclass(frozen=True)
class CondensedMotion:
    """State of a learned robot in motion.

    t: s
    q: (n_q,) mm and amplitudes
    p: (n_q,) momenta
    v: (n_q,) mean velocity of the last step
    memory: (terms, n_q) of the Prony terms of all materials
    lam: (n_a,) forces of the actuators in the last step
    gain: (n_q,) change of v in the last step, a second; None where it is not known"""

    t: float
    q: np.ndarray
    p: np.ndarray
    v: np.ndarray
    memory: np.ndarray
    lam: np.ndarray
    gain: np.ndarray | None = None


@dataclass(frozen=True)
class MotionCommand:
    """Command of one step: displacements or forces of the actuators."""

    displacement: np.ndarray | None = None  # (n_a,) mm at its end
    force: np.ndarray | None = None  # (n_a,) N during it
    push: np.ndarray | None = None  # (n_e,) N on the effectors
    slack: np.ndarray | None = None  # (n_a,) cables that are not held and carry nothing, none unless given


def at_rest(model: MotionModel, delta_a: np.ndarray, payload: Payload | None = None) -> CondensedMotion:
    """Motion that stands still with the actuators held at delta_a (n_a,) mm, under the payload's weight."""
    delta_a = np.asarray(delta_a, float)
    place, n_a = model.at(delta_a), model.n_a
    q, lam = np.concatenate([delta_a, np.zeros(model.n_r)]), place.pull.copy()
    if payload is not None:
        stiffness = place.inner
        if place.E is not None:
            stiffness = stiffness - np.tensordot(payload.weight, payload.rows_of(place.E), axes=1)
        q[n_a:] = np.linalg.solve(stiffness, payload.rows_of(place.H).T @ payload.weight)
        lam = lam - (payload.rows_of(place.slopes(q[n_a:])).T @ payload.weight)[:n_a]
    terms = sum(len(loss.prony) for loss in model.losses)
    none = np.zeros(model.n_q)
    return CondensedMotion(0.0, q, none, none, np.zeros((terms, model.n_q)), lam)


def effectors(model: MotionModel, motion: CondensedMotion) -> np.ndarray:
    """Displacements (n_e,) mm of the effectors."""
    return model.at(motion.q[: model.n_a]).effectors(motion.q[model.n_a :])


def energy(model: MotionModel, motion: CondensedMotion, payload: Payload | None = None) -> float:
    """Energy N mm, kinetic and potential, the payload's weight included."""
    n_a = model.n_a
    place, eta = model.at(motion.q[:n_a]), motion.q[n_a:]
    M = place.M
    stored = float(model.static.parts(motion.q[:n_a], motion.q[:0])["energy"][0]) + float(eta @ place.inner @ eta) / 2
    if payload is not None:
        J = payload.rows_of(place.slopes(eta))
        M = M + payload.mass * J.T @ J
        stored -= float(payload.weight @ payload.rows_of(place.effectors(eta)))
    return stored + float(motion.p @ np.linalg.solve(M, motion.p)) / 2


def step(
    model: MotionModel,
    motion: CondensedMotion,
    command: MotionCommand,
    dt: float,
    payload: Payload | None = None,
    tolerance: float = 1e-8,
) -> CondensedMotion:
    """Motion after dt seconds, to a relative `tolerance`. NumericalError where its equations are not solved."""
    n_a, held = model.n_a, np.zeros(model.n_q, dtype=bool)
    held[:n_a] = command.displacement is not None
    if command.slack is not None:
        held[:n_a] &= ~command.slack
    free, v = np.flatnonzero(~held), motion.v.copy()
    if motion.gain is not None:
        v += dt * motion.gain
    if held.any():
        v[held] = (command.displacement[held[:n_a]] - motion.q[held]) / dt
    force = np.zeros(n_a) if command.force is None else np.array(command.force, float)
    carried = payload is not None or command.push is not None
    for _ in range(_EXPANSIONS):
        near = expansion(model, motion.q, motion.p, v, dt, motion.memory)
        near.known[:n_a] += force
        if carried:
            _carry(near, model, motion.q + dt / 2 * v, v, payload, command.push)
        solved = near.solved(v, free, tolerance)
        if solved is None:
            break
        change, v = solved.v - v, solved.v
        settled = not carried or np.abs(change / model.scale).max() <= tolerance * near.size(v)
        if settled and model.half_widths(dt / 2 * change[:n_a]) <= NEAR:
            lam = force
            lam[held[:n_a]] = -2 / dt * solved.rest[held]
            q, p, gain = motion.q + dt * v, 2 * solved.impulse - motion.p, (v - motion.v) / dt
            return CondensedMotion(motion.t + dt, q, p, v, _remembered(model, motion, v, dt), lam, gain)
    raise NumericalError(f"the step of {dt:g} s at {motion.t:g} s is not found", do="take shorter steps")


def _carry(
    near: Expansion, model: MotionModel, middle: np.ndarray, v: np.ndarray, payload: Payload | None, push: np.ndarray
) -> None:
    """Adds to the expansion what acts on the effectors at the middle of the step."""
    n_a = model.n_a
    slopes = model.at(middle[:n_a]).slopes(middle[n_a:])
    if push is not None:
        near.known += slopes.T @ push
    if payload is not None:
        J, speed = payload.rows_of(slopes), max(float(np.abs(v).max()), 1e-12)
        ahead = middle + _DIFFERENCE / speed * v
        slopes_ahead = payload.rows_of(model.at(ahead[:n_a]).slopes(ahead[n_a:]))
        bending = (slopes_ahead - J) * (speed / _DIFFERENCE)
        near.M += payload.mass * J.T @ J
        near.known += payload.mass * bending.T @ (J @ v) + J.T @ payload.weight


def _remembered(model: MotionModel, motion: CondensedMotion, v: np.ndarray, dt: float) -> np.ndarray:
    """Rates (terms, n_q) dh/dt = v - h / tau of the memory, at the middle of the step."""
    memory = motion.memory.copy()
    taus = [tau for loss in model.losses for _, tau in loss.prony]
    for index, tau in enumerate(taus):
        half = dt / (2 * tau)
        memory[index] = ((1 - half) * memory[index] + dt * v) / (1 + half)
    return memory
