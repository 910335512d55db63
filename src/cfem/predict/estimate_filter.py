"""Estimates over time: an iterated extended Kalman filter (Bell and Cathey, IEEE Trans. Automatic Control 38, 1993).

Each tick is the least-squares problem of `Estimator`, in which the last estimate, carried forward, is what is known
before. Carried forward means: the actuators move as they are told, and slip a little beside; a load keeps its value for
a while and its size for ever (Gauss-Markov process, Gelb, *Applied Optimal Estimation*, 1974, section 3.8),

    delta_a' = delta_a + (u' - u) + slip     w' = rho w + sqrt(1 - rho^2) largest e     rho = exp(-1 / ticks)

so that directions that no marker sees stay as uncertain as they were at first, and no more. Where forces u are
commanded, actuators move as the model yields to them and to the loads,

    delta_a' = delta_a + W_aa (u' - u) + W_aw (w' - w) + slip

so that a push shows in where they go. The robot is at rest at each tick, to the accuracy of its model: motion faster
than that is not modelled (cfem.motion.marker_filter).

A frame that does not fit what is known before it is rejected (`cfem.predict.gate`). After a run of these, and of frames
without an estimate, everything before is forgotten."""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from cfem.core.errors import InputError
from cfem.predict.estimate import Estimator
from cfem.predict.estimate_answer import Estimate
from cfem.predict.estimate_fit import EstimateStatus, Known
from cfem.predict.gate import Gate, GateSpec, Verdict

SLIP, OFFSET = 5e-4, 0.05  # of the reach, where a spec states none
YIELD = 0.1  # of a motion under commanded forces: by how much the model may be wrong


class Filter:
    """slip: mm by which an actuator may move in a tick beside its command (or at all, without commands), standard
    deviation; ticks: for how many a load lasts; offset: mm, standard deviation of where the actuators stand from the
    first command; gate: of frames that do not fit."""

    def __init__(
        self, estimator: Estimator, slip: float, ticks: float, offset: float = 1.0, gate: GateSpec | None = None
    ):
        if slip <= 0 or ticks <= 0 or offset <= 0:
            raise InputError("slip, the ticks for which a load lasts and the offset must be positive")
        self.estimator, self.slip, self.ticks, self.offset = estimator, slip, ticks, offset
        self.keeps, self.gate = float(np.exp(-1.0 / ticks)), Gate.of(gate or GateSpec())
        self.last: Estimate | None = None
        self._u: np.ndarray | None = None
        self._driven: np.ndarray | None = None

    def tick(
        self,
        measured: ArrayLike,
        sensed: ArrayLike | None = None,
        commanded: ArrayLike | None = None,
        forces: ArrayLike | None = None,
        driven: ArrayLike | None = None,
    ) -> Estimate:
        """measured, sensed, forces: as for `Estimator.estimate`; commanded (n_a,) mm, or driven (n_a,) N by which they
        are commanded, None where nobody knows. Never raises for what the numbers are; an estimate that was rejected or
        did not converge is not carried forward."""
        u = None if commanded is None else np.asarray(commanded, float)
        by = None if driven is None else np.asarray(driven, float)
        known = self._first(u) if self.last is None else self._forward(self.last, u, by)
        found = self.estimator.with_known(measured, sensed, forces, known, known.mean)
        verdict = Verdict.ACCEPTED if self.last is None else self.gate.judge(*found.judged)
        if verdict is Verdict.REJECTED:
            return replace(found, status=EstimateStatus.REJECTED) if found.converged else found
        if verdict is Verdict.RESTART:
            known, self.last = self._first(u), None
            found = self.estimator.with_known(measured, sensed, forces, known, known.mean)
        if found.status is EstimateStatus.CONVERGED and np.isfinite(found.covariance).all():
            self.last, self._u, self._driven = found, u, by
        return found

    def _first(self, u: np.ndarray | None) -> Known:
        before = self.estimator.before
        if u is None:
            return before
        n_a = len(u)
        root = np.vstack([before.root, np.eye(n_a, len(before.mean)) / self.offset])
        return Known(np.concatenate([u, before.mean[n_a:]]), root)

    def _forward(self, last: Estimate, u: np.ndarray | None, driven: np.ndarray | None) -> Known:
        n_a, n_w = len(last.delta_a), len(last.loads)
        moved = np.zeros(n_a) if u is None or self._u is None else u - self._u
        yields = np.zeros((n_a, n_w))  # of the actuators to loads
        slip = self.slip**2 * np.eye(n_a)
        if driven is not None and self._driven is not None:
            at = self.estimator.response(last.delta_a)
            yields = at.actuators
            moved = at.here.W_aa @ (driven - self._driven)
            slip += YIELD**2 * np.outer(moved, moved)
        mean = np.concatenate([last.delta_a + moved - (1 - self.keeps) * yields @ last.loads, self.keeps * last.loads])
        F = np.diag(np.r_[np.ones(n_a), np.full(n_w, self.keeps)])
        F[:n_a, n_a:] = (self.keeps - 1) * yields
        by_load = np.vstack([yields, np.eye(n_w)])
        covariance = F @ last.covariance @ F.T
        covariance += (1 - self.keeps**2) * by_load @ self.estimator.load_covariance @ by_load.T
        covariance[:n_a, :n_a] += slip
        size = np.sqrt(np.diag(covariance))  # scaled, so that the factor does not depend on units
        lower = np.linalg.cholesky(covariance / np.outer(size, size) + 1e-12 * np.eye(len(size)))
        return Known(mean, np.linalg.solve(lower, np.diag(1 / size)))
