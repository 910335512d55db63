"""A batch of robots of one model, in equilibrium under their commands: what the environments act on."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise
from typing import Any

import numpy as np

from cfem.condensed.packing import packed_indices, unpacking
from cfem.condensed.parameters import coordinates, values
from cfem.condensed.strokes import STEP, stroke
from cfem.core.errors import InputError
from cfem.core.optional import demand
from cfem.predict.kinds.spectral import SpectralPredictor
from cfem.predict.protocol import Predictor
from cfem.predict.series.derivatives import input_derivatives
from cfem.predict.series.energy import layout


@dataclass
class RobotStates:
    """States of B robots at rest.

    delta_a, lambda_a: (B, n_a) mm and N
    hessian: (B, n_a (n_a + 1) / 2) of the energy, packed, at the reference of exact parameters, 0 where it is unknown
    tip: (B, n_e) mm from rest
    compliance: (B, n_e, n_e) mm/N of the effectors at locked actuators, 0 where it was not asked for
    failed: number of robots that found no equilibrium in the last step"""

    delta_a: np.ndarray
    lambda_a: np.ndarray
    hessian: np.ndarray
    tip: np.ndarray
    compliance: np.ndarray
    failed: int


class Robots:
    """A batch of robots at rest."""

    def __init__(self, model: Predictor, needs: tuple[str, ...] = (), loaded: Sequence[int] = ()):
        """Batch of robots of a model. InputError for one that is not spectral of form displacement.

        needs: further series: effector_compliance for the compliance
        loaded: effector rows on which there may be loads"""
        demand("numba", where="cfem.gym")
        if not isinstance(model, SpectralPredictor) or model.form != "displacement":
            kind, form = model.meta.get("kind"), model.form
            what = f"environments need a spectral model of form displacement, got kind '{kind}' of form '{form}'"
            raise InputError(what, do="train with `model: {kind: spectral}`")
        from cfem.gym.kernel import equilibria
        from cfem.gym.lanes import LaneSeries

        self.model, self._equilibria, self._loaded = model, equilibria, list(loaded)
        n_a, n_e = model.rows.n_a, model.rows.n_e
        if loaded and max(loaded) >= n_e:
            raise InputError("a payload needs an effector with rows x, y and z", do="use a scene with such an effector")
        parts, series = layout(n_a, n_e), model.arrays["series"]
        rows = {name: series[parts[name]] for name in ("gradient", "hessian", "effector", *needs)}
        if loaded:
            by = input_derivatives(model.arrays["indices"], model.arrays["to_box"], n_a)
            chosen = rows["effector"][self._loaded]
            rows["slopes"] = np.stack([(by[i] @ chosen.T).T for i in range(n_a)], axis=1).reshape(len(loaded) * n_a, -1)
            pairs = list(zip(*packed_indices(n_a), strict=True))
            bends = [(by[j] @ (by[i] @ chosen.T)).T for i, j in pairs]
            rows["bends"] = np.stack(bends, axis=1).reshape(len(loaded) * len(pairs), -1)
            columns = unpacking(n_e)[:, self._loaded]
            rows["yields"] = series[parts["effector_compliance"]][columns.ravel()]
        ends = [0, *accumulate(map(len, rows.values()))]
        self._place = {name: slice(*pair) for name, pair in zip(rows, pairwise(ends), strict=True)}
        self._outputs = ends[-1]
        joined = np.concatenate(list(rows.values()))
        self.series = LaneSeries.of(model.arrays["to_box"], model.arrays["offset"], model.arrays["indices"], joined)
        self._unpack = unpacking(n_e)
        high = model.domain.lambda_a[1]
        self.pulls = bool(model.pulls.all())
        self.largest_force = high.copy()
        scale = np.abs(model.domain.lambda_a).max(axis=0)
        self._tolerance = 1e-6 * np.where(scale > 0, scale, scale.max())
        self.reference = np.array([parameter.reference for parameter in model.parameters])

    def start(self, count: int) -> RobotStates:
        """States of robots at rest, as far as the model knows it."""
        n_a, n_e = self.model.rows.n_a, self.model.rows.n_e
        sizes = ((n_a,), (n_a,), (n_a * (n_a + 1) // 2,), (n_e,), (n_e, n_e))
        return RobotStates(*(np.zeros((count, *size)) for size in sizes), 0)

    def move(
        self,
        states: RobotStates,
        u: np.ndarray,
        p: np.ndarray | None = None,
        forces: bool = False,
        loads: np.ndarray | None = None,
    ) -> RobotStates:
        """States under commands u (B, n_a), displacements in mm or forces in N, parameters p (B, n_p): the scene's
        unless given, and loads (B, k) N on the loaded effector rows. Loads count to the first order: they move the
        effectors by their compliance at locked actuators, and change the actuators' forces by the gradient of where the
        effectors are."""
        model, count, place = self.model, len(u), self._place
        softer, q = np.ones(count), np.zeros((count, 0))
        if model.parameters:
            p = np.broadcast_to(self.reference, (count, len(self.reference))) if p is None else p
            softer[:], q = model.softer(p), np.ascontiguousarray(model.q(p))
        out = np.empty((count, self._outputs))
        out[:, place["gradient"]], out[:, place["hessian"]] = states.lambda_a * softer[:, None], states.hessian
        delta = states.delta_a.copy()
        failed = self._equilibria(
            np.ascontiguousarray(u, float),
            np.zeros((0, 0)) if loads is None else np.ascontiguousarray(loads, float),
            self._law(forces),
            delta,
            states.hessian[:, 0] > 0,
            q,
            softer,
            self.series,
            out,
        )
        C, tip = states.compliance, out[:, place["effector"]]
        if "effector_compliance" in place:
            C = out[:, place["effector_compliance"]][:, self._unpack] * softer[:, None, None]
        if loads is not None:
            yields, k = out[:, place["yields"]], len(self._loaded)
            tip = tip + sum(yields[:, r::k] * (loads[:, r] * softer)[:, None] for r in range(k))
        return RobotStates(
            delta, out[:, place["gradient"]] / softer[:, None], out[:, place["hessian"]], tip, C, int(failed)
        )

    def _law(self, forces: bool) -> Any:
        from cfem.gym.kernel import CommandLaw

        first = self._place["slopes"].start if self._loaded else 0
        return CommandLaw(forces, self.pulls, STEP * stroke(self.model.reach), self._tolerance, first)

    def random_parameters(self, rng: np.random.Generator, count: int) -> np.ndarray:
        """Parameters (count, n_p), uniform in the coordinates in which the model is smooth."""
        parameters = self.model.parameters
        if not parameters:
            return np.zeros((count, 0))
        low, high = (
            coordinates(parameters, np.array([getattr(parameter, end) for parameter in parameters]))
            for end in ("low", "high")
        )
        return values(parameters, low + (high - low) * rng.random((count, len(parameters))))

    def feasible(self, rng: np.random.Generator, p: np.ndarray) -> RobotStates:
        """State of each robot p (B, n_p), within its reach, under random forces up to FEASIBLE of the largest of the
        training. InputError where one has none."""
        kept, unplaced = self.start(len(p)), np.arange(len(p))
        for _ in range(60):
            start = self.start(len(unplaced))
            start.delta_a[:] = self.model.domain.states[0, : start.delta_a.shape[1]]
            u = rng.uniform(0.0 if self.pulls else -FEASIBLE, FEASIBLE, start.delta_a.shape)
            states = self.move(start, self.forces(u, p[unplaced]), p[unplaced], forces=True)
            good = self.within_reach(states)
            for name in FIELDS:
                getattr(kept, name)[unplaced[good]] = getattr(states, name)[good]
            unplaced = unplaced[~good]
            if not len(unplaced):
                return kept
        raise InputError("the model's states under forces do not lie within the reach of its actuators")

    def within_reach(self, states: RobotStates) -> np.ndarray:
        """Mask (B,) of robots whose actuators stand within their reach."""
        low, high = self.model.reach.T
        return ((states.delta_a >= low) & (states.delta_a <= high)).all(axis=1) & np.isfinite(states.tip).all(axis=1)

    def forces(self, shares: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Forces (B, n_a) N: shares (B, n_a) of the largest of the training, of each robot's stiffness."""
        return shares * self.largest_force / (self.model.softer(p)[:, None] if p.shape[1] else 1.0)


FIELDS = ("delta_a", "lambda_a", "hessian", "tip", "compliance")
FEASIBLE = 0.7  # of the largest forces of the training, under which first states are drawn
