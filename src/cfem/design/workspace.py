"""Objectives over all that a robot's actuators do, or at one place: numbers, the smaller the better.

An objective over several actuations has `kind` and `actuations` (k, n_a), and is called with m k states, the k of each
design one after the other. e are the effectors' rows that matter, J = de / d delta_a = W_ea W_aa^-1 at constant loads,
C = W_ee - W_ea W_aa^-1 W_ae the compliance with the actuators held."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import permutations, product
from math import factorial
from typing import Any, ClassVar

import numpy as np

from cfem.parametric.family import Kind
from cfem.parametric.states import States


def actuation_grid(reach: np.ndarray, points: int) -> np.ndarray:
    """Grid (points^n_a, n_a) over the box of reaches (n_a, 2), the last actuator fastest."""
    return np.array(list(product(*(np.linspace(low, high, points) for low, high in reach))))


@dataclass(frozen=True)
class WorkspaceMeasure:
    """Minus the measure of the places that the effector goes to: a length (mm) of one actuator, an area (mm^2) of two,
    a volume (mm^3) of three. The box of actuations is cut into simplices (Kuhn), whose images are added up: what is
    passed twice counts twice."""

    rows: np.ndarray
    actuations: np.ndarray
    points: int
    kind: Kind = "displacement"
    sign: ClassVar[float] = -1.0

    @property
    def unit(self) -> str:
        return ("mm", "mm^2", "mm^3")[self.actuations.shape[1] - 1]

    def __call__(self, states: States) -> np.ndarray:
        k = len(self.actuations)
        n = self.actuations.shape[1]
        x = states.x_e[:, self.rows].reshape(-1, k, len(self.rows))
        corners = x[:, simplices(self.points, n)]  # (m, s, n + 1, 3)
        edges = corners[:, :, 1:] - corners[:, :, :1]
        gram = edges @ edges.swapaxes(2, 3)
        return -np.sqrt(np.maximum(np.linalg.det(gram), 0.0)).sum(axis=1) / factorial(n)


@dataclass(frozen=True)
class Manipulability:
    """Minus the mean over the actuations of the smallest singular value of J (mm a mm, mm a mm^3 of chambers): how far
    the effector goes, in the direction in which it goes least, for a unit of actuation."""

    rows: np.ndarray
    actuations: np.ndarray
    kind: Kind = "displacement"
    sign: ClassVar[float] = -1.0
    unit: ClassVar[str] = "mm per unit of actuation"

    def __call__(self, states: States) -> np.ndarray:
        a = states.rows.a
        W_ae = states.W[:, a][:, :, self.rows]
        J = np.linalg.solve(states.W[:, a, a], W_ae).swapaxes(1, 2)
        least = np.linalg.svd(J, compute_uv=False)[:, -1]
        return -least.reshape(-1, len(self.actuations)).mean(axis=1)


@dataclass(frozen=True)
class Stiffness:
    """Minus the force (N) that moves the effector by 1 mm in `direction` (3,), sideways free, the actuators held:
    1 / d^T C d. Over several actuations, the smallest; `actuations` None: at that of the design."""

    rows: np.ndarray
    direction: np.ndarray
    actuations: np.ndarray | None = None
    kind: Kind = "displacement"
    sign: ClassVar[float] = -1.0
    unit: ClassVar[str] = "N/mm"

    def __call__(self, states: States) -> np.ndarray:
        C = states.locked_compliance[:, self.rows[:, None], self.rows]
        stiff = 1 / np.einsum("i,mij,j->m", self.direction, C, self.direction)
        k = 1 if self.actuations is None else len(self.actuations)
        return -stiff.reshape(-1, k).min(axis=1)


@dataclass(frozen=True)
class Force:
    """Minus the force (N) along `direction` (3,) that the effector gives where it is held at `goal` (3,) mm, the
    actuators where they are, to first order: C^-1 (x_e - goal) along the direction."""

    rows: np.ndarray
    direction: np.ndarray
    goal: np.ndarray
    sign: ClassVar[float] = -1.0
    unit: ClassVar[str] = "N"
    inverts: ClassVar[bool] = True  # the compliance of its rows, actuators locked

    def __call__(self, states: States) -> np.ndarray:
        C = states.locked_compliance[:, self.rows[:, None], self.rows]
        missing = states.x_e[:, self.rows] - self.goal
        return -np.linalg.solve(C, missing[..., None])[..., 0] @ self.direction


@dataclass(frozen=True)
class OfBody:
    """A number of the whole body by name, times `sign`; volume: what gives it, where the states have none."""

    name: str
    sign: float = 1.0
    volume: Callable[[np.ndarray], np.ndarray] | None = None

    @property
    def unit(self) -> str:
        return {"volume": "mm^3", "mass": "t", "strain": "", "stress": "MPa"}.get(self.name, "Hz")

    def __call__(self, states: States) -> np.ndarray:
        return self.sign * (states.numbers[self.name] if self.volume is None else self.volume(states.p))


def simplices(points: int, n: int) -> np.ndarray:
    """Simplices (s, n + 1) into which the cells of an `actuation_grid` of `points` along each of n axes are cut, by the
    numbers of their corners."""
    strides = points ** np.arange(n - 1, -1, -1)
    corners = np.array(list(product(range(points - 1), repeat=n))) @ strides
    paths = [np.concatenate([[0], np.cumsum(strides[list(order)])]) for order in permutations(range(n))]
    return (corners[:, None, None] + np.array(paths)).reshape(-1, n + 1)


@dataclass(frozen=True)
class Robust:
    """A statistic of a number over robots whose parameters differ: its mean or a quantile. Called with the (m, s)
    values of the number."""

    number: Any  # the objective or constraint that scatters
    offsets: np.ndarray  # (s, n_p) of the parameters
    low: np.ndarray  # (n_p,) ends of their ranges
    high: np.ndarray
    share: float | None  # of the quantile, None for the mean
    deviation: np.ndarray  # (n_p,) standard deviations of the parameters

    @property
    def unit(self) -> str:
        return getattr(self.number, "unit", "")

    @property
    def sign(self) -> float:
        return getattr(self.number, "sign", 1.0)

    def parameters(self, p: np.ndarray) -> np.ndarray:
        """Parameters (m s, n_p) of m designs (m, n_p) with their s offsets, those of a design one after the other."""
        return np.clip(p[:, None] + self.offsets, self.low, self.high).reshape(-1, p.shape[1])

    def __call__(self, numbers: np.ndarray) -> np.ndarray:
        return numbers.mean(axis=1) if self.share is None else np.quantile(numbers, self.share, axis=1)


def normal_offsets(deviation: np.ndarray, count: int) -> np.ndarray:
    """Offsets (count, n_p) with a normal distribution of standard deviations (n_p,), from Halton's points, so that
    their statistics hardly scatter and are the same every time."""
    from scipy.stats import norm, qmc

    used = np.flatnonzero(deviation)
    offsets = np.zeros((count, len(deviation)))
    offsets[:, used] = norm.ppf(qmc.Halton(len(used), scramble=False).random(count + 1)[1:]) * deviation[used]
    return offsets
