"""Measured against computed: one number a measurement, in units of its noise, with derivatives by the parameters."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from cfem.calibrate.measurements import Measurements
from cfem.core.errors import InputError
from cfem.parametric.differences import with_slopes
from cfem.parametric.family import Family, Varied
from cfem.parametric.states import States


@dataclass(frozen=True)
class Noise:
    """Standard deviations: of effectors (mm) and of what the actuators' dual was measured to (N or mm). known: stated
    by the user; else only their ratio counts, and their size is found from what the fit leaves."""

    effectors: float
    dual: float
    known: bool


def relative(measured: Measurements) -> Noise:
    """Where nothing is known: as if both were measured with the same precision relative to their largest change."""
    moved = measured.x_e - np.nanmean(measured.x_e, axis=0) if np.isfinite(measured.x_e).any() else measured.delta_e
    sizes = [np.nanmax(np.abs(one), initial=0.0) or 1.0 for one in (moved, measured.dual)]
    return Noise(*map(float, sizes), known=False)


@dataclass
class Residuals(Varied):
    """The residuals of a family's robots as a function of z, shares of the ranges of the parameters `free`; those not
    free stay as in p0 (n_p,).

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

    def states(self, z: np.ndarray) -> States:
        """(k, n_free) -> of every robot all m states, robot by robot."""
        m = len(self.measured)
        self.evaluations += len(z) * m
        return self.family.at(
            self.measured.kind, np.tile(self.measured.u, (len(z), 1)), np.repeat(self.p(z), m, axis=0)
        )

    def predictions(self, states: States) -> np.ndarray:
        """(k, n_r) in the order of `target`."""
        dual = states.lam if self.measured.kind == "displacement" else states.delta_a
        found = np.stack([np.hstack(parts) for parts in zip(states.x_e, states.delta_e, dual, strict=True)])
        return found.reshape(-1, self._mask.size)[:, self._mask.ravel()]

    def __call__(self, z: np.ndarray) -> np.ndarray:
        """(n_free,) -> (n_r,) in units of the noise."""
        return (self.predictions(self.states(z[None]))[0] - self.target) / self.sigma

    def with_jacobian(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(n_r,) and (n_r, n_free)."""
        found, slopes = with_slopes(lambda batch: self.predictions(self.states(batch)), z, self.family.stencil)
        return (found - self.target) / self.sigma, slopes / self.sigma[:, None]

    def of_other(self, target: np.ndarray) -> "Residuals":
        """As if other numbers (n_r,) had been measured."""
        other = replace(self)
        other.__dict__["target"] = target
        return other

    @cached_property
    def target(self) -> np.ndarray:
        """(n_r,) all numbers that were measured, state by state: positions, displacements, duals."""
        return self._all(self.measured.x_e, self.measured.delta_e, self.measured.dual)

    @cached_property
    def sigma(self) -> np.ndarray:
        """(n_r,)."""
        m = self.measured
        e, d = self.noise.effectors, self.noise.dual
        return self._all(np.full_like(m.x_e, e), np.full_like(m.delta_e, e), np.full_like(m.dual, d))

    @cached_property
    def labels(self) -> list[tuple[int, str]]:
        """(n_r) state and name of each residual."""
        rows = self.family.rows
        other = "force" if self.measured.kind == "displacement" else "displacement"
        names = [*rows.effectors, *(f"{name}.displacement" for name in rows.effectors)]
        names += [f"{name}.{other}" for name in rows.actuators]
        return [(int(i), names[j]) for i, j in zip(*np.nonzero(self._mask), strict=True)]

    def _all(self, *columns: np.ndarray) -> np.ndarray:
        return np.hstack(columns)[self._mask]

    @cached_property
    def _mask(self) -> np.ndarray:
        return np.isfinite(np.hstack([self.measured.x_e, self.measured.delta_e, self.measured.dual]))
