"""Steps of the condensed model, linearised about guesses of them, many at once.

The equations are those of `cfem.motion.step`: R(q, p, v, u) = M(q_m) v - p - dt/2 (dL/dq + Q) = 0 with
q_m = q + dt v / 2. About a guess of q, p, v and u, one Newton step gives v as an affine function of what precedes it,

    dR/dv (v - v_guess) = -R - dR/dq (q - q_guess) + (p - p_guess) + dt/2 (u - u_guess)

and with v the state after the step. Second derivatives of the mass and the slope of viscosity by place are left
out, as in `step`. Repeated, this is Newton's method; once a tick, with the last solution as the guess, it is the
real-time iteration (Diehl, Bock and Schloeder, SIAM J. Control Optim. 43, 2005)."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Literal

import numpy as np

from cfem.condensed.viscosity import Viscosity
from cfem.motion.model import MotionModel, MotionTerms

Kind = Literal["displacement", "force"]


@dataclass(frozen=True)
class MaterialShares:
    """Shares of the modulus and of the viscosity of the material that the model was learned from."""

    stiffness: float = 1.0
    viscosity: float = 1.0


@dataclass(frozen=True)
class Guess:
    """Motion of N steps, about which they are linearised."""

    state: np.ndarray  # (N, n_z): q, p and the memory of Prony terms before each
    v: np.ndarray  # (N, n_q) mean velocity during each
    u: np.ndarray  # (N, n_a) displacements at the end of each in mm, or forces during it in N


@dataclass(frozen=True)
class LinearisedSteps:
    """Linearisation z' = end + A (z - guess) + B (u - guess) of each of N steps.

    by_material: (N, n_z, 2) slopes by the logarithms of stiffness and viscosity
    lam: (N, n_a) N, forces of held actuators
    lam_by_z, lam_by_u: their slopes; all three None where forces are commanded"""

    end: np.ndarray
    A: np.ndarray
    B: np.ndarray
    by_material: np.ndarray
    lam: np.ndarray | None = None
    lam_by_z: np.ndarray | None = None
    lam_by_u: np.ndarray | None = None


def places(model: MotionModel, delta_a: np.ndarray, every: int = 1) -> MotionTerms:
    """Terms of a model along a horizon: all of `MotionTerms` with a first axis of N, at delta_a (N, n_a) mm. every:
    mass, viscosity and inner motions are asked at each so many, and interpolated between; of more than one, their
    slopes are those at the first. Energy and where the effectors rest are asked of all."""
    count = len(delta_a)
    if count == 1:
        only = vars(model.at(delta_a[0])) | {"inner": None}
        terms = {name: values[None] for name, values in only.items() if values is not None}
        return MotionTerms(inner=model.inner, **terms)
    part = model.static.parts(delta_a, delta_a[:, :0])
    knots = np.unique([*range(0, count, every), count - 1])
    terms = [model.learned(delta_a[k], slopes=k == 0) for k in knots]
    place = np.interp(np.arange(count), knots, np.arange(len(knots)))
    before = place.astype(int)
    after, share = np.minimum(before + 1, len(knots) - 1), place - before
    slopes = [name for name in terms[0] if name.startswith("d")]
    learned = {name: np.broadcast_to(terms[0][name], (count, *terms[0][name].shape)) for name in slopes}
    for name in terms[0].keys() - slopes:
        values = np.array([term[name] for term in terms])
        t = share.reshape(-1, *[1] * (values.ndim - 1))
        learned[name] = (1 - t) * values[before] + t * values[after]
    return MotionTerms(
        pull=part["gradient"],
        stiff=part["hessian"],
        e=part["effector"],
        J=part["effector_gradient"],
        inner=model.inner,
        **learned,
    )


def moved(place: MotionTerms, model: MotionModel, delta_a: np.ndarray) -> MotionTerms:
    """Terms with energy and where the effectors rest at delta_a (N, n_a) mm, and the inertia and inner motions of
    before."""
    part = model.static.parts(delta_a, delta_a[:, :0])
    e, J = part["effector"], part["effector_gradient"]
    return replace(place, pull=part["gradient"], stiff=part["hessian"], e=e, J=J)


def first_of(place: MotionTerms) -> MotionTerms:
    """Terms at the first place of `places`, with their first axis."""
    values_by_name = {term.name: getattr(place, term.name) for term in fields(MotionTerms) if term.name != "inner"}
    return replace(place, **{name: values[:1] for name, values in values_by_name.items() if values is not None})


def linear_steps(
    place: MotionTerms,
    losses: tuple[Viscosity, ...],
    guess: Guess,
    kind: Kind,
    dt: float,
    material: MaterialShares = MaterialShares(),
) -> LinearisedSteps:
    """Linearised steps from the guessed states. place: of `places` at the middle of each guessed step; dt: s."""
    s, c = material.stiffness, material.viscosity
    n, n_q = guess.v.shape
    n_a, n_z = guess.u.shape[1], guess.state.shape[1]
    q, p, v = guess.state[:, :n_q], guess.state[:, n_q : 2 * n_q], guess.v
    memory = guess.state[:, 2 * n_q :].reshape(n, -1, n_q)
    eta = (q + dt / 2 * v)[:, n_a:]
    by_turn = (place.dM @ v[:, None, :, None])[..., 0]  # (N, n_a, n_q)
    # forces, by what they come from
    elastic, inertial = np.empty((n, n_q)), np.zeros((n, n_q))
    elastic[:, :n_a] = -s * place.pull
    elastic[:, n_a:] = -s * _dot(place.inner, eta)
    inertial[:, :n_a] = _dot(by_turn, v) / 2
    viscous, by_rate, by_memory = _viscous(place, losses, v, memory, s * c, dt)
    force = elastic + inertial + viscous
    # slopes: of M v by the place, and of R by place and velocity
    turning = np.zeros((n, n_q, n_q))
    turning[:, :, :n_a] = by_turn.swapaxes(1, 2)
    by_place = turning.copy()
    by_place[:, :n_a, :n_a] += dt / 2 * s * place.stiff
    by_place[:, n_a:, n_a:] += dt / 2 * s * place.inner
    by_speed = place.M + dt / 2 * (by_rate + by_place)
    by_speed[:, :n_a] -= dt / 2 * by_turn
    # v - guess = X (known; z; u; material), columns of one right-hand side
    rest = _dot(place.M, v) - p - dt / 2 * force
    right = np.zeros((n, n_q, 1 + n_z + n_a + 2))
    by_z, by_u, by_s = slice(1, 1 + n_z), slice(1 + n_z, 1 + n_z + n_a), slice(1 + n_z + n_a, None)
    right[:, :, 0] = -rest
    right[:, :, 1 : 1 + n_q] = -by_place
    right[:, :, 1 + n_q : 1 + 2 * n_q] = np.eye(n_q)
    right[:, :, 1 + 2 * n_q : 1 + n_z] = dt / 2 * by_memory
    right[:, :, by_s] = dt / 2 * np.stack([elastic + viscous, viscous], axis=-1)
    X = np.zeros_like(right)
    if kind == "force":
        right[:, :n_a, 0] += dt / 2 * guess.u
        right[:, :n_a, by_u] = dt / 2 * np.eye(n_a)
        X = np.linalg.solve(by_speed, right)
    else:
        X[:, :n_a, 0] = (guess.u - q[:, :n_a]) / dt - v[:, :n_a]
        X[:, :n_a, 1 : 1 + n_a] = -np.eye(n_a) / dt
        X[:, :n_a, by_u] = np.eye(n_a) / dt
        left = right[:, n_a:] - by_speed[:, n_a:, :n_a] @ X[:, :n_a]
        X[:, n_a:] = np.linalg.solve(by_speed[:, n_a:, n_a:], left)
    out = _states_after(X, place.M, turning, guess, dt, _taus(losses))
    steps = out[:, :, 0], out[:, :, by_z], out[:, :, by_u], out[:, :, by_s]
    if kind == "force":
        return LinearisedSteps(*steps)
    lam = 2 / dt * (by_speed[:, :n_a] @ X - right[:, :n_a])  # what the rows of the actuators lack
    return LinearisedSteps(*steps, lam[:, :, 0], lam[:, :, by_z], lam[:, :, by_u])


def _states_after(
    X: np.ndarray, M: np.ndarray, turning: np.ndarray, guess: Guess, dt: float, taus: Sequence[float]
) -> np.ndarray:
    """States (N, n_z, columns of X) after the steps, from the change X of the guessed velocities; turning: slope of M v
    by the place."""
    n, n_q = guess.v.shape
    q, p = guess.state[:, :n_q], guess.state[:, n_q : 2 * n_q]
    memory = guess.state[:, 2 * n_q :].reshape(n, -1, n_q)
    # v and q_m, and what follows from them
    full = X.copy()
    full[:, :, 0] += guess.v
    moved = dt / 2 * X
    moved[:, :, 1 : 1 + n_q] += np.eye(n_q)
    impulse = M @ full + turning @ moved  # M v
    out = np.zeros((n, guess.state.shape[1], X.shape[2]))
    # q' = q + dt v
    out[:, :n_q] = dt * full
    out[:, :n_q, 0] += q
    out[:, :n_q, 1 : 1 + n_q] += np.eye(n_q)
    # p' = 2 M v - p
    out[:, n_q : 2 * n_q] = 2 * impulse
    out[:, n_q : 2 * n_q, 0] -= p
    out[:, n_q : 2 * n_q, 1 + n_q : 1 + 2 * n_q] -= np.eye(n_q)
    # strains of the Prony terms
    for term, tau in enumerate(taus):
        rows, half = slice((2 + term) * n_q, (3 + term) * n_q), dt / (2 * tau)
        out[:, rows] = dt * full / (1 + half)
        out[:, rows, 0] += (1 - half) / (1 + half) * memory[:, term]
        out[:, rows, 1 + rows.start : 1 + rows.stop] += (1 - half) / (1 + half) * np.eye(n_q)
    return out


def _viscous(
    place: MotionTerms, losses: tuple[Viscosity, ...], v: np.ndarray, memory: np.ndarray, size: float, dt: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Forces (N, n_q), minus their slope by v (N, n_q, n_q), and their slope by the memory (N, n_q, terms n_q)."""
    n, n_q = v.shape
    force, by_rate = np.zeros((n, n_q)), np.zeros((n, n_q, n_q))
    by_memory, term = np.zeros((n, n_q, memory.shape[1] * n_q)), 0
    for number, loss in enumerate(losses):
        F, rate, history = size * place.F[:, number], loss.relaxation, np.zeros((n, n_q))
        for share, tau in loss.prony:
            half = dt / (2 * tau)
            rate += share * dt / 2 / (1 + half)
            history += share * memory[:, term] / (1 + half)
            by_memory[:, :, term * n_q : (term + 1) * n_q] = -share / (1 + half) * F
            term += 1
        force -= _dot(F, rate * v + history)
        by_rate += rate * F
    return force, by_rate, by_memory


def _taus(losses: tuple[Viscosity, ...]) -> list[float]:
    return [tau for loss in losses for _, tau in loss.prony]


def _dot(matrices: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    return (matrices @ vectors[..., None])[..., 0]
