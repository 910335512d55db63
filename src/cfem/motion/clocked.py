"""The condensed model that moves, in steps of a control tick.

Commands move evenly over a tick to their new value: a force acts with its mean over the tick, a displacement is there
at its end. Steps of the midpoint rule are as long as a tick; they slow a vibration of angular frequency w to
2/dt atan(w dt/2). Mass and viscosity are scaled so that the lowest natural frequency comes out right (prewarping, as in
Tustin's method; Franklin, Powell and Workman, Digital Control of Dynamic Systems, 1998, section 6.1)."""

from dataclasses import dataclass, replace

import numpy as np

from cfem.condensed import Condensed
from cfem.motion.linear import Guess, Kind, LinearisedSteps, MaterialShares, linear_steps, moved, places
from cfem.motion.model import MotionModel, MotionTerms
from cfem.motion.modes import natural_modes, prewarp
from cfem.motion.step import at_rest

_ITERATIONS, _SETTLED = 4, 1e-4


@dataclass(frozen=True)
class ClockedState:
    """State of a robot at a tick."""

    z: np.ndarray  # (n_z,): q, p and the memory of Prony terms
    v: np.ndarray  # (n_q,) mean velocity of the last tick
    u: np.ndarray  # (n_a,) command that has been reached


class Clocked:
    """Condensed model in steps of a control tick. n_z: size of a state; dt: s of a tick; kind: what is commanded."""

    def __init__(self, model: MotionModel, kind: Kind, dt: float, about: np.ndarray):
        """Sets the model's steps. about (n_a,) mm: where the lowest natural frequency is taken."""
        self.model, self.kind, self.dt = model, kind, dt
        self.n_a, self.n_q = model.n_a, model.n_q
        self.n_z = (2 + sum(len(loss.prony) for loss in model.losses)) * model.n_q
        self.frequency = float(natural_modes(model, about, kind == "displacement", 1).frequency[0])
        self._warp = prewarp(self.frequency, dt)

    def at_rest(self, condensed: Condensed) -> ClockedState:
        """State at rest under a state of the static model."""
        return self.standing(
            condensed.delta_a, condensed.delta_a if self.kind == "displacement" else condensed.lambda_a
        )

    def standing(self, delta_a: np.ndarray, u: np.ndarray) -> ClockedState:
        """State at rest at delta_a (n_a,) mm under the command u (n_a,)."""
        motion = at_rest(self.model, delta_a)
        z = np.concatenate([motion.q, motion.p, motion.memory.ravel()])
        return ClockedState(z, motion.v, np.array(u, float))

    def acting(self, before: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Actuation that acts in a step, from commands (..., n_a) reached at its beginning and at its end."""
        return (before + u) / 2 if self.kind == "force" else u

    def linear(self, guess: Guess, material: MaterialShares, every: int = 1) -> tuple[LinearisedSteps, MotionTerms]:
        """The steps about their guesses, and what the model says at their middle; every: see
        `cfem.motion.linear.places`."""
        middle = guess.state[:, : self.n_a] + self.dt / 2 * guess.v[:, : self.n_a]
        place, losses = places(self.model, middle, every), self.model.losses
        return linear_steps(self.warped(place), losses, guess, self.kind, self.dt, material), place

    def step(
        self, state: ClockedState, u: np.ndarray, material: MaterialShares, place: MotionTerms | None = None
    ) -> tuple[ClockedState, LinearisedSteps, MotionTerms]:
        """State after a tick in which the command moves to u (n_a,), its last linearisation, and what the model says at
        its middle; place: whose inertia and inner motions are taken, None: those where the last velocity leads to."""
        z, v, actuation, size = state.z, state.v.copy(), self.acting(state.u, u), self.model.scale
        if self.kind == "displacement":
            v[: self.n_a] = (actuation - z[: self.n_a]) / self.dt
        for _ in range(_ITERATIONS):
            middle = (z[: self.n_a] + self.dt / 2 * v[: self.n_a])[None]
            place = places(self.model, middle) if place is None else moved(place, self.model, middle)
            guess = Guess(z[None], v[None], actuation[None])
            steps = linear_steps(self.warped(place), self.model.losses, guess, self.kind, self.dt, material)
            before, v = v, (steps.end[0, : self.n_q] - z[: self.n_q]) / self.dt
            if np.abs((v - before) / size).max() <= _SETTLED * max(float(np.abs(v / size).max()), 1.0):
                break
        return ClockedState(steps.end[0], v, np.asarray(u, float)), steps, place

    def effectors(self, z: np.ndarray, near: MotionTerms | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Displacements (N, n_e) mm of the effectors at states (N, n_z), and their slopes (N, n_e, n_z) but for that of
        E by the place; near: of places nearby, whose inner motions are taken, None: of the states themselves."""
        delta_a, eta = z[:, : self.n_a], z[:, self.n_a : self.n_q]
        near = places(self.model, delta_a) if near is None else near
        part = self.model.static.parts(delta_a, delta_a[:, :0])
        C = np.zeros((len(z), near.H.shape[1], self.n_z))
        C[:, :, : self.n_a] = part["effector_gradient"]
        C[:, :, : self.n_a] += np.einsum("kaei,ki->kea", near.dH, eta)
        bent = 0.0 if near.E is None else np.einsum("keij,kj->kei", near.E, eta)
        C[:, :, self.n_a : self.n_q] = near.H + bent
        return part["effector"] + np.einsum("kei,ki->ke", near.H + bent / 2, eta), C

    def warped(self, place: MotionTerms) -> MotionTerms:
        """Terms with mass and viscosity scaled, so that steps of a tick have the lowest natural frequency right."""
        g = self._warp
        return replace(place, M=g**2 * place.M, dM=g**2 * place.dM, F=g * place.F)
