"""Measured against computed: one number a measurement, in units of its noise, with derivatives by the parameters."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from cfem.core.errors import InputError
from cfem.identify.columns import DUAL
from cfem.identify.fit.free_parameter import FreeParameter, share_of_range
from cfem.identify.robot.measurements import Measurements
from cfem.parametric.differences import with_slopes
from cfem.parametric.family import Family, Varied
from cfem.parametric.states import States


@dataclass(frozen=True)
class Noise:
    """Standard deviations of the measured numbers.

    effectors: mm
    dual:      of the actuators' dual, N or mm
    known:     whether the user stated them; else only their ratio counts, and their size is estimated from the fit"""

    effectors: float
    dual: float
    known: bool


def relative_noise(measured: Measurements) -> Noise:
    """The noise where nothing is known: effectors and duals measured with one precision relative to their largest
    change."""
    seen = np.isfinite(measured.x_e)
    mean = np.where(seen, measured.x_e, 0.0).sum(axis=0) / np.maximum(seen.sum(axis=0), 1)
    moved = measured.x_e - mean if seen.any() else measured.delta_e
    sizes = [np.nanmax(np.abs(change), initial=0.0) or 1.0 for change in (moved, measured.dual)]
    return Noise(*map(float, sizes), known=False)


@dataclass
class RobotResiduals(Varied):
    """The residuals of a family's robots as a function of z, shares of the ranges of the parameters `free`.

    family:   robots that differ in parameters
    measured: m states
    noise:    of the measured numbers
    p0:       (n_p,) values of the parameters that are not free
    free:     numbers of the parameters that vary
    evaluations: of single robots and states so far"""

    family: Family
    measured: Measurements
    noise: Noise
    p0: np.ndarray
    free: Sequence[int]
    evaluations: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        if not len(self.target):
            raise InputError(
                "holds no measurement of the rows that `use` names", do="compare `use` with the columns of the table"
            )

    @property
    def unknowns(self) -> list[FreeParameter]:
        """The free parameters, with z as their share of the range."""
        return [share_of_range(parameter) for parameter in self.parameters]

    def states(self, z: np.ndarray) -> States:
        """States, all m of every robot z (k, n_free), robot by robot."""
        m = len(self.measured)
        self.evaluations += len(z) * m
        return self.family.at(
            self.measured.kind, np.tile(self.measured.u, (len(z), 1)), np.repeat(self.p(z), m, axis=0)
        )

    def predictions(self, states: States) -> np.ndarray:
        """Computed numbers (k, n_r) of k robots, in the order of `target`."""
        dual = states.lam if self.measured.kind == "displacement" else states.delta_a
        computed = np.hstack([states.x_e, states.delta_e, dual])
        return computed.reshape(-1, self._mask.size)[:, self._mask.ravel()]

    def __call__(self, z: np.ndarray, with_jacobian: bool = True) -> tuple[np.ndarray, np.ndarray]:
        """Residuals (n_r,) in units of the noise and Jacobian (n_r, n_free) at z (n_free,): one batch of states serves
        both."""
        computed, slopes = with_slopes(lambda batch: self.predictions(self.states(batch)), z, self.family.stencil)
        return (computed - self.target) / self.sigma, slopes / self.sigma[:, None]

    def with_error(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
        """Residuals and Jacobian at z (n_free,), and by how much (n_r,) errors of the family alone may change each
        residual, in units of the noise, where a parameter goes through its range; None where they are not known. One
        batch of states serves all."""
        batches: list[States] = []

        def answers(points: np.ndarray) -> np.ndarray:
            batches.append(self.states(points))
            return self.predictions(batches[0])

        computed, slopes = with_slopes(answers, z, self.family.stencil)
        residuals, jacobian = (computed - self.target) / self.sigma, slopes / self.sigma[:, None]
        changes = self.family.false_change(self.measured.kind, batches[0].first(len(self.measured)))
        if changes is None:
            return residuals, jacobian, None
        effectors, dual = changes
        return residuals, jacobian, np.hstack([effectors, effectors, dual])[self._mask] / self.sigma

    def with_target(self, target: np.ndarray) -> "RobotResiduals":
        """The problem with other measured numbers (n_r,)."""
        problem = replace(self)
        problem.__dict__["target"] = target
        return problem

    @cached_property
    def target(self) -> np.ndarray:
        """Measured numbers (n_r,), state by state: positions, displacements, duals."""
        return self.measured.all[self._mask]

    @cached_property
    def sigma(self) -> np.ndarray:
        """Standard deviations (n_r,) of the residuals."""
        m, n_e = self.measured.x_e.shape
        deviations = np.repeat([self.noise.effectors, self.noise.dual], [2 * n_e, self.measured.dual.shape[1]])
        return np.tile(deviations, (m, 1))[self._mask]

    @cached_property
    def labels(self) -> list[tuple[int, str]]:
        """States and names (n_r) of the residuals."""
        rows = self.family.rows
        names = [*rows.effectors, *(f"{name}.displacement" for name in rows.effectors)]
        names += [f"{name}.{DUAL[self.measured.kind]}" for name in rows.actuators]
        return [(int(state), names[column]) for state, column in np.argwhere(self._mask)]

    def numbers_of(self, name: str) -> np.ndarray:
        """Numbers of the residuals of one name."""
        return np.array([i for i, (_, label) in enumerate(self.labels) if label == name])

    @cached_property
    def names(self) -> list[str]:
        """Names that residuals have, each once."""
        return list(dict.fromkeys(name for _, name in self.labels))

    @cached_property
    def _mask(self) -> np.ndarray:
        return np.isfinite(self.measured.all)
