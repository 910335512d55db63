"""A batch of robots that move, with inertia and viscosity: what the moving environments act on."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from cfem.condensed.packing import packed_indices
from cfem.core.errors import InputError
from cfem.gym.robots import Robots
from cfem.motion.model import MotionModel, layout
from cfem.motion.modes import natural_modes, prewarp
from cfem.predict.series.derivatives import input_derivatives
from cfem.predict.series.energy import layout as static_layout


@dataclass
class MovingStates:
    """States of B robots in motion, robots last, in C's order: the kernel is compiled anew for any other.

    q, p, v, gain: (n_q, B) as of `cfem.motion.step.CondensedMotion` in coordinates q / scale
    lam, held: (n_a, B) alike
    u: (n_a, B) the command that has been reached, N or mm
    stiffness, viscosity: (B,) times those of the model
    tip: (B, n_e) mm from rest
    outside: (B,) how far the actuators are from the middle of the learned box, in half widths
    failed: steps of robots that were not solved in the last tick"""

    q: np.ndarray
    p: np.ndarray
    v: np.ndarray
    gain: np.ndarray
    lam: np.ndarray
    held: np.ndarray
    u: np.ndarray
    stiffness: np.ndarray
    viscosity: np.ndarray
    tip: np.ndarray
    outside: np.ndarray
    failed: int = 0

    def put(self, robots: np.ndarray, others: "MovingStates") -> None:
        """Puts the states of others, k of them, in the places `robots` (k,)."""
        for name in ("q", "p", "v", "gain", "lam", "held", "u", "stiffness", "viscosity", "outside"):
            getattr(self, name)[..., robots] = getattr(others, name)
        self.tip[robots] = others.tip


class MovingRobots:
    """A batch of robots that move. Mass and viscosity are scaled so that steps of the tick's length have the lowest
    natural frequency right (`cfem.motion.clocked` says how)."""

    def __init__(
        self, model: MotionModel, kind: str = "force", tick: float = 0.01, substeps: int = 1, tolerance: float = 1e-2
    ):
        """Batch of robots of a learned motion. InputError for models of other kinds, and for Prony terms.

        kind: what is commanded, force or displacement
        tick: s
        substeps: of a tick
        tolerance: of a step, share of its velocities, of which the error is about the square"""
        self.static = Robots(model.static)
        from cfem.gym.moving_step import ticks

        if any(loss.prony for loss in model.losses):
            raise InputError(
                "batches of moving robots do not support Prony terms", do="use a material with relaxation alone"
            )
        self.model, self.kind, self.forces = model, kind, kind == "force"
        self.tick, self.substeps, self._tolerance, self._ticks = tick, substeps, tolerance, ticks
        about = model.static.domain.states[0, : model.n_a]
        self.frequency = float(natural_modes(model, about, not self.forces, 1).frequency[0])
        self._learned, self._effectors = learned(model, prewarp(self.frequency, tick / substeps))
        self._scale = model.scale[: model.n_a, None]
        self._small = 1e-6 * float((self.static.largest_force * self._scale[:, 0]).max())

    def standing(self, u: np.ndarray, stiffness: np.ndarray, viscosity: np.ndarray) -> MovingStates:
        """States at rest under commands u (B, n_a). InputError where there is no such equilibrium."""
        model, count = self.model, len(u)
        start = self.static.start(count)
        start.delta_a[:] = model.static.domain.states[0, : model.n_a]
        states = self.static.move(start, u / stiffness[:, None] if self.forces else u, forces=self.forces)
        if states.failed:
            raise InputError(f"{states.failed} of {count} robots find no equilibrium under their first command")
        q = np.zeros((model.n_q, count))
        q[: model.n_a] = states.delta_a.T / self._scale
        held = np.zeros((model.n_a, count))
        if not self.forces:
            held[:] = (states.delta_a <= u + 1e-9).T if self.static.pulls else 1.0
        none, lam = np.zeros_like(q), np.multiply(states.lambda_a.T * stiffness, self._scale, order="C")
        out = np.zeros(count)
        return MovingStates(
            q,
            none,
            none.copy(),
            none.copy(),
            lam,
            held,
            np.array(u.T, order="C"),
            stiffness.copy(),
            viscosity.copy(),
            states.tip.copy(),
            out,
        )

    def move(self, states: MovingStates, u: np.ndarray) -> None:
        """Moves `states` by a tick in which commands go evenly to u (B, n_a)."""
        from cfem.gym.moving_kernel import Lanes

        factor = self._scale if self.forces else 1 / self._scale
        lanes = Lanes(
            states.q, states.p, states.v, states.gain, states.u, states.lam, states.held, states.stiffness,
            states.viscosity,
        )  # fmt: skip
        begin, end, tip = states.u * factor, np.ascontiguousarray(u.T) * factor, np.empty(states.tip.shape[::-1])
        states.failed = self._ticks(
            self._learned, self._effectors, lanes, begin, end, self.forces, self.static.pulls,
            self.tick / self.substeps, self.substeps, self._small, self._tolerance, tip, states.outside,
        )  # fmt: skip
        states.u, states.tip = np.array(u.T, order="C"), np.ascontiguousarray(tip.T)

    def displacements_of(self, states: MovingStates) -> np.ndarray:
        """Displacements (B, n_a) mm of the actuators now."""
        return (states.q[: self.model.n_a] * self._scale).T

    def forces_of(self, states: MovingStates) -> np.ndarray:
        """Forces (B, n_a) N of the actuators in the last step."""
        return (states.lam / self._scale).T


def learned(model: MotionModel, warp: float) -> tuple[Any, Any]:
    """Series of the loops, in coordinates q / scale, with warp^2 times the mass and warp times the viscosity."""
    from cfem.gym.lanes import LaneSeries
    from cfem.gym.moving_kernel import LearnedMotion
    from cfem.gym.moving_step import Effectors

    n_a, n_e, n_r, scale = model.n_a, model.rows.n_e, model.n_r, model.scale
    static, static_slices = model.static.arrays, static_layout(model.n_a, n_e)
    arrays, slices = model.arrays, layout(model.n_q, n_r, n_e, len(model.losses))
    first, second = packed_indices(n_a)
    pull, stiff = (static["series"][static_slices[name]] for name in ("gradient", "hessian"))
    forces = np.concatenate([pull * scale[:n_a, None], stiff * (scale[first] * scale[second])[:, None]])
    root, lost = warp * arrays["series"][slices["M"]], np.sqrt(warp) * arrays["series"][slices["H"].stop :]
    slopes = input_derivatives(arrays["indices"], arrays["to_box"], n_a)
    inertia = [root, *(scale[a] * (slopes[a] @ root.T).T for a in range(n_a)), lost]
    bends = [_scaled(arrays["series"][slices["H"]], n_e, scale[n_a:])]
    if "curve" in arrays:
        first, second = packed_indices(n_r)
        bends.append(_scaled(arrays["curve"], n_e, scale[n_a:][first] * scale[n_a:][second]))

    def series(part: dict[str, np.ndarray], rows: np.ndarray) -> LaneSeries:
        return LaneSeries.of(part["to_box"] * scale[:n_a], part["offset"], part["indices"], rows)

    relaxation = np.array([loss.relaxation for loss in model.losses])
    kappa, smallest = model.stiffness * scale[n_a:] ** 2, 1e-6 / float(scale.min())
    return (
        LearnedMotion(
            series(static, forces), series(arrays, np.concatenate(inertia)), relaxation, kappa, model.n_q, smallest
        ),
        Effectors(
            series(static, static["series"][static_slices["effector"]]),
            series(arrays, np.concatenate(bends)),
            "curve" in arrays,
        ),
    )


def _scaled(rows: np.ndarray, n_e: int, factors: np.ndarray) -> np.ndarray:
    """Rows of each effector times the factors."""
    return (rows.reshape(n_e, len(factors), -1) * factors[:, None]).reshape(len(rows), -1)
