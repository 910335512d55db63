"""One step in time of the condensed model: the implicit midpoint rule of its Lagrangian.

With v the mean velocity of the step, q_m = q + dt v / 2 and the forces Q at q_m,

    p' = p + dt (dL/dq + Q)        M(q_m) v = p + dt/2 (dL/dq + Q)        q' = q + dt v

(Marsden and West, Acta Numerica 10, 2001): symplectic, so that without viscosity the energy does not drift, and of
second order. Where displacements of actuators are commanded, their v is known and their forces follow.

Newton's method starts from v carried on as it changed in the step before. It ends where the change that would come
next is below the tolerance, by the rate at which the changes have fallen; what is told of the step is carried on from
the last evaluation to first order in the last change."""

from dataclasses import dataclass

import numpy as np

from cfem.core.errors import NumericalError
from cfem.motion.model import MotionModel
from cfem.motion.payload import Payload

_ITERATIONS = 30
_DIFFERENCE = 1e-4  # mm: how the payload's inertia turns, by differences


@dataclass(frozen=True)
class Motion:
    """t: s; q (n_q,) mm and amplitudes; p (n_q,): momenta; v (n_q,): mean velocity of the last step; memory
    (terms, n_q): of the Prony terms of all materials; lam (n_a,): the actuators' forces in the last step; gain (n_q,):
    the change of v in the last step, a second; None where it is not known."""

    t: float
    q: np.ndarray
    p: np.ndarray
    v: np.ndarray
    memory: np.ndarray
    lam: np.ndarray
    gain: np.ndarray | None = None


@dataclass(frozen=True)
class Command:
    """Of one step: displacement (n_a,) mm at its end, or force (n_a,) N during it; push: (n_e,) N on the effectors;
    slack: (n_a,) cables that are not held at their displacement and carry nothing, none unless given."""

    displacement: np.ndarray | None = None
    force: np.ndarray | None = None
    push: np.ndarray | None = None
    slack: np.ndarray | None = None


def at_rest(model: MotionModel, delta_a: np.ndarray, payload: Payload | None = None) -> Motion:
    """Standing still with the actuators held at delta_a (n_a,) mm, under the payload's weight."""
    delta_a = np.asarray(delta_a, float)
    place, n_a = model.at(delta_a), model.n_a
    q, lam = np.concatenate([delta_a, np.zeros(model.n_r)]), place.pull.copy()
    if payload is not None:
        q[n_a:] = np.linalg.solve(place.inner, payload.rows_of(place.H).T @ payload.weight)
        lam = lam - (payload.rows_of(place.slopes(q[n_a:])).T @ payload.weight)[:n_a]
    terms = sum(len(one.prony) for one in model.losses)
    none = np.zeros(model.n_q)
    return Motion(0.0, q, none, none, np.zeros((terms, model.n_q)), lam)


def effectors(model: MotionModel, motion: Motion) -> np.ndarray:
    """(n_e,) mm from rest."""
    return model.at(motion.q[: model.n_a]).effectors(motion.q[model.n_a :])


def energy(model: MotionModel, motion: Motion, payload: Payload | None = None) -> float:
    """N mm: kinetic and potential, the payload's weight included."""
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
    motion: Motion,
    command: Command,
    dt: float,
    payload: Payload | None = None,
    tolerance: float = 1e-8,
) -> Motion:
    """After dt seconds, to a relative `tolerance` of its motion. NumericalError where its equations are not solved."""
    n_a, held = model.n_a, np.zeros(model.n_q, dtype=bool)
    held[:n_a] = command.displacement is not None
    if command.slack is not None:
        held[:n_a] &= ~command.slack
    free, v = np.flatnonzero(~held), motion.v.copy()
    if motion.gain is not None:
        v += dt * motion.gain
    if held.any():
        v[held] = (command.displacement[held[:n_a]] - motion.q[held]) / dt
    size, before = 1 / model.scale, np.inf
    least = 1e-6 / dt * size.max()  # a motion of a nanometre, or its share of an amplitude, needs no digits
    for _ in range(_ITERATIONS):
        force, M, slope, turning = _terms(model, motion, command, v, dt, payload)
        Mv = M @ v
        rest, slope = dt / 2 * force + motion.p - Mv, slope + M
        change = np.zeros(model.n_q)
        change[free] = np.linalg.solve(slope[free[:, None], free] if held.any() else slope, rest[free])
        v += change
        moved = float(np.abs(change * size).max(initial=0.0))
        if not np.isfinite(moved):
            break
        # how a payload's inertia turns is not in the slope
        rate = 1.0 if payload is not None or before == np.inf else min(moved / before, 1.0)
        before = moved
        if moved * rate <= tolerance * max(float(np.abs(v * size).max()), least):
            Mv += M @ change + turning @ change[:n_a]
            lam = np.zeros(n_a) if command.force is None else np.array(command.force, float)
            lam[held[:n_a]] = (2 / dt * (slope @ change - rest))[held]
            q, p, gain = motion.q + dt * v, 2 * Mv - motion.p, (v - motion.v) / dt
            return Motion(motion.t + dt, q, p, v, _remembered(model, motion, v, dt), lam, gain)
    raise NumericalError(f"the step of {dt:g} s at {motion.t:g} s is not found", do="take shorter steps")


def _terms(
    model: MotionModel, motion: Motion, command: Command, v: np.ndarray, dt: float, payload: Payload | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """dL/dq + Q (n_q,) at the middle of the step, but for the forces that hold actuators; M; the slope by v of M v -
    dt/2 Q but for M, second derivatives of M left out; and (n_q, n_a) that of M v at constant v by v of the
    actuators."""
    n_a = model.n_a
    middle = motion.q + dt / 2 * v
    place, eta = model.at(middle[:n_a]), middle[n_a:]
    M = place.M
    by_turn = place.dM @ v  # (n_a, n_q)
    force = np.empty(model.n_q)
    force[:n_a] = by_turn @ v / 2 - place.pull
    force[n_a:] = -place.inner @ eta
    if command.force is not None:
        force[:n_a] += command.force
    if command.push is not None:
        force += place.slopes(eta).T @ command.push
    turning = dt / 2 * by_turn.T
    slope = np.zeros_like(M)
    slope[:n_a, :n_a], slope[n_a:, n_a:] = dt**2 / 4 * place.stiff, dt**2 / 4 * place.inner
    slope[:, :n_a] += turning
    slope[:n_a] -= turning.T
    term = 0
    for loss, F in zip(model.losses, place.F, strict=True):
        by_rate, history = loss.relaxation, np.zeros(model.n_q)
        for share, tau in loss.prony:
            half = dt / (2 * tau)
            by_rate += share * dt / 2 / (1 + half)
            history += share * motion.memory[term] / (1 + half)
            term += 1
        force -= F @ (by_rate * v + history)
        slope += dt / 2 * by_rate * F
    if payload is not None:
        J, speed = payload.rows_of(place.slopes(eta)), max(float(np.abs(v).max()), 1e-12)
        ahead = middle + _DIFFERENCE / speed * v
        there = payload.rows_of(model.at(ahead[:n_a]).slopes(ahead[n_a:]))
        bending = (there - J) * (speed / _DIFFERENCE)
        M = M + payload.mass * J.T @ J
        force += payload.mass * bending.T @ (J @ v) + J.T @ payload.weight
    return force, M, slope, turning


def _remembered(model: MotionModel, motion: Motion, v: np.ndarray, dt: float) -> np.ndarray:
    """(terms, n_q) dh/dt = v - h / tau, at the middle of the step."""
    memory = motion.memory.copy()
    taus = [tau for loss in model.losses for _, tau in loss.prony]
    for index, tau in enumerate(taus):
        half = dt / (2 * tau)
        memory[index] = ((1 - half) * memory[index] + dt * v) / (1 + half)
    return memory
