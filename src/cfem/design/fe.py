"""A design problem by finite elements, without a model: what is asked of a design is differentiated by its own numbers
(W, delta_free, ...), of which there are few, and those by the parameters with one adjoint solve a number."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.stats import norm, qmc

from cfem.condensed.parameters import from_shares, shares
from cfem.core.errors import NumericalError
from cfem.design.optimisers.search import Grid, judged
from cfem.design.problem import DesignProblem, Scores
from cfem.design.workspace import Robust
from cfem.parametric.differences import Stencil
from cfem.parametric.differentiable import Outputs, chain, stacked
from cfem.parametric.states import States

# Of functions of a state's numbers, in shares of their sizes: short, as a nearly singular compliance may be inverted.
_STENCIL = Stencil(4, 1e-5)
_SIDEWAYS = 5e-3  # of a range: half of what two gradients differ by, for a Hessian along one direction


@dataclass
class FeProblem(DesignProblem):
    """Designs judged by finite elements. failed: those that could not be solved, which count as worse than any
    other."""

    failed: int = field(default=0, init=False)
    _worst: np.ndarray | None = field(default=None, init=False)

    def with_slopes(self, z: np.ndarray, stencil: Stencil | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Objectives and constraints in one row (n_f + n_g,) at z (n,), and their derivatives (n_f + n_g, n)."""
        try:
            values, slopes = self._with_slopes(z)
        except NumericalError:
            self.failed += 1
            if self._worst is None:
                raise
            n_f = len(self.objectives)
            size = 1.0 + np.abs(self._worst)
            return np.concatenate([(self._worst + size)[:n_f], -size[n_f:]]), np.zeros((len(self._worst), len(z)))
        self._worst = values if self._worst is None else np.maximum(self._worst, values)
        return values, slopes

    def _with_slopes(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Objectives and constraints of a design z (n,), with their derivatives."""
        p = self.p(z[None])[0]
        numbers = {**self.objectives, **self.constraints}
        robust = {name: number for name, number in numbers.items() if isinstance(number, Robust)}
        values, slopes = np.zeros(len(numbers)), np.zeros((len(numbers), len(z)))
        plain = {name: number for name, number in numbers.items() if name not in robust}
        places = {name: i for i, name in enumerate(numbers)}
        self.evaluations += 1
        plain_places = [places[name] for name in plain]
        values[plain_places], slopes[plain_places] = self._gradients(list(plain.values()), p, self.free)
        for name, number in robust.items():
            values[places[name]], slopes[places[name]] = self._robust(number, p)
        return values, slopes

    def _gradients(self, numbers: list[Any], p: np.ndarray, free: Sequence[int]) -> tuple[np.ndarray, np.ndarray]:
        """Values (r,) at p (n_p,), and derivatives (r, n) by the shares of the parameters `free`."""
        spread = self._spread(p, free)
        values, slopes = np.zeros(len(numbers)), np.zeros((len(numbers), len(free)))
        at_the_actuation = [i for i, number in enumerate(numbers) if getattr(number, "actuations", None) is None]
        if at_the_actuation:
            direct: list[np.ndarray] = []

            def rows_at(state: States) -> tuple[np.ndarray, list[Outputs]]:
                rows, outputs, by_p = partials(_rows([numbers[i] for i in at_the_actuation]), state, spread)
                direct.append(by_p)
                return rows, [outputs_of_row[0] for outputs_of_row in outputs]

            _, values[at_the_actuation], slopes[at_the_actuation] = self.family.gradient(
                self.kind, self.u, p, free, rows_at
            )
            slopes[at_the_actuation] += direct[0]
        for i in sorted(set(range(len(numbers))) - set(at_the_actuation)):
            values[i], slopes[i] = self._over(numbers[i], p, free, spread)
        return values, slopes

    def _over(self, number: Any, p: np.ndarray, free: Sequence[int], spread: np.ndarray) -> tuple[float, np.ndarray]:
        """Value and derivatives (free,) of an objective at the design p, over the states of its actuations."""
        states_and_slopes = [self.family.jacobian(number.kind, u, p, free) for u in number.actuations]
        states = stacked([state for state, _ in states_and_slopes])
        rows, outputs, by_p = partials(_rows([number]), states, spread)
        slope = sum(chain(output, by) for output, (_, by) in zip(outputs[0], states_and_slopes, strict=True))
        return float(rows[0]), slope + by_p[0]

    def _robust(self, robust: Robust, p: np.ndarray) -> tuple[float, np.ndarray]:
        """Quantile to first order in the scatter: J + q s, s^2 = sum_i (t_i dJ/dz_i)^2, q the normal quantile and t_i
        the scatter in shares of the range at p. Its derivative holds the Hessian of J along (t_i^2 dJ/dz_i): that is a
        difference of two more gradients, whatever the number of parameters that scatter."""
        free = list(dict.fromkeys([*self.free, *np.flatnonzero(robust.deviation)]))
        values, slopes = self._gradients([robust.number], p, free)
        value, g = float(values[0]), slopes[0]
        t, bent = self._scatter(robust, p, free)
        s = float(np.linalg.norm(t * g))
        quantile = float(norm.ppf(robust.share))
        if s == 0.0:
            return value, g[: len(self.free)]
        along = t * t * g
        direction = along / np.abs(along).max()
        z = shares(self.family.parameters, p)
        sides = []
        for sign in (1, -1):
            moved = z.copy()
            moved[free] += sign * _SIDEWAYS * direction
            sides.append(self._gradients([robust.number], from_shares(self.family.parameters, moved), free)[1][0])
        hessian = (sides[0] - sides[1]) / (2 * _SIDEWAYS) * np.abs(along).max()
        slope = g + quantile * (hessian + g * g * t * bent) / s
        return value + quantile * s, slope[: len(self.free)]

    def _scatter(self, robust: Robust, p: np.ndarray, free: Sequence[int]) -> tuple[np.ndarray, np.ndarray]:
        """Standard deviations (n,) in shares of the ranges at p, and their derivatives by the shares."""
        z, h = shares(self.family.parameters, p), 1e-4

        def deviations(moved: np.ndarray) -> np.ndarray:
            values = from_shares(self.family.parameters, moved)
            ahead, behind = (shares(self.family.parameters, values + sign * 1e-6 * values) for sign in (1, -1))
            return robust.deviation * (ahead - behind) / np.where(values != 0, 2e-6 * values, 1.0)

        low, high = np.array([(parameter.low, parameter.high) for parameter in self.family.parameters]).T
        linear = np.array([parameter.coordinate == "linear" for parameter in self.family.parameters])
        flat = robust.deviation / (high - low)
        t = np.where(linear, flat, deviations(z))
        bent = np.where(linear, 0.0, (deviations(z + h) - deviations(z - h)) / (2 * h))
        return t[list(free)], bent[list(free)]

    def _number(self, objective: Any, states: States) -> np.ndarray:
        """Values (m,) of an objective or a constraint."""
        if isinstance(objective, Robust):
            return np.array([self._quantile(objective, p) for p in states.p])
        return super()._number(objective, states)

    def _quantile(self, robust: Robust, p: np.ndarray) -> float:
        free = list(np.flatnonzero(robust.deviation))
        values, slopes = self._gradients([robust.number], p, free)
        return float(values[0] + norm.ppf(robust.share) * np.linalg.norm(self._scatter(robust, p, free)[0] * slopes[0]))

    def _spread(self, p: np.ndarray, free: Sequence[int]) -> np.ndarray:
        """Derivative (n, n_p) dp/dz of the parameters `free`."""
        z, h = shares(self.family.parameters, p), 1e-6
        unit = np.eye(len(p))[list(free)]
        ahead, behind = (from_shares(self.family.parameters, z + sign * h * unit) for sign in (1, -1))
        return (ahead - behind) / (2 * h)

    def screen(self, count: int, start: np.ndarray) -> Grid:
        """Grid of the start and Halton's points of the ranges; those that cannot be solved are left out."""
        n = len(self.free)
        wanted = [start, *qmc.Halton(n, scramble=False).random(count)[1:]][:count]
        z, scores = [], []
        for design in wanted:
            try:
                scores.append(self(design[None]))
                z.append(design)
            except NumericalError as error:
                self.failed, last = self.failed + 1, error
        if not z:
            raise NumericalError(f"finite elements solve none of the {count} designs tried first: {last}")
        all_scores = Scores(*(np.concatenate(part) for part in zip(*scores, strict=True)))
        self._worst = np.hstack(all_scores).max(axis=0)
        return judged(self, (), np.array(z), all_scores)

    def slope_error(self, z: np.ndarray) -> float:
        """Largest difference between the slopes along (1, ..., 1) and those by differences of solves, of fourth order,
        relative to each row's."""
        direction, step = np.ones(len(z)) / np.sqrt(len(z)), 2e-3
        _, slopes = self._with_slopes(z)
        ends = [np.hstack(self((z + k * step * direction)[None]))[0] for k in (2, 1, -1, -2)]
        plain = (8 * (ends[1] - ends[2]) - (ends[0] - ends[3])) / (12 * step)
        size = np.linalg.norm(slopes, axis=1)
        return float((np.abs(slopes @ direction - plain) / np.where(size > 0, size, 1.0)).max(initial=0.0))


Rows = Callable[[States], np.ndarray]


def _rows(numbers: list[Callable[[States], np.ndarray]]) -> Rows:
    return lambda states: np.stack([number(states) for number in numbers], axis=1)


def partials(rows: Rows, states: States, spread: np.ndarray) -> tuple[np.ndarray, list[list[Outputs]], np.ndarray]:
    """Values (r,) of one design's k states, with their derivatives: by the outputs of each state, for each row; and by
    z (r, n) through p itself, spread (n, n_p) = dp/dz. rows: of designs (M, k states each, one after the other) -> (M,
    r)."""
    shape = _Shape(states)
    y, size = shape.packed(states), shape.sizes(states)
    points = _STENCIL.points(np.zeros(y.size + len(spread)))
    moved = y.ravel() + points[:, : y.size] * size.ravel()
    p = (states.p[None] + points[:, None, y.size :] @ spread).reshape(-1, states.p.shape[1])
    values = rows(shape.unpacked(moved.reshape(-1, y.shape[1]), p))
    slopes = _STENCIL.slopes(values)  # (r, those of the outputs and of z)
    by_y = slopes[:, : y.size].reshape(-1, *y.shape) / size
    outputs = [[shape.outputs(slope) for slope in row] for row in by_y]
    return values[0], outputs, slopes[:, y.size :]


class _Shape:
    """Layout of the numbers of a state in one row."""

    def __init__(self, states: States):
        self.rows, self.names = states.rows, sorted(states.numbers or {})
        n = self.rows.n
        self.i, self.j = np.triu_indices(n)
        self.ends = np.cumsum([len(self.i), n, states.lam.shape[1], states.rest_e.shape[1]])

    def packed(self, states: States) -> np.ndarray:
        """Numbers of m states, one row each."""
        numbers = [states.numbers[name][:, None] for name in self.names]
        return np.hstack([states.W[:, self.i, self.j], states.delta_free, states.lam, states.rest_e, *numbers])

    def sizes(self, states: States) -> np.ndarray:
        """Size of each number, of which a step is a share."""
        diagonal = np.sqrt(np.abs(np.diagonal(states.W, axis1=1, axis2=2)))
        W = diagonal[:, self.i] * diagonal[:, self.j]
        length = np.maximum(np.abs(states.delta).max(axis=1), 1e-3)[:, None]
        force = np.maximum(np.abs(states.lam).max(axis=1), 1e-9)[:, None]
        numbers = [np.maximum(np.abs(states.numbers[name]), 1e-12)[:, None] for name in self.names]
        given = ((length, states.delta_free), (force, states.lam), (length, states.rest_e))
        sizes = [np.broadcast_to(value, like.shape) for value, like in given]
        return np.hstack([np.maximum(W, 1e-12 * W.max()), *sizes, *numbers])

    def unpacked(self, y: np.ndarray, p: np.ndarray) -> States:
        W, free, lam, rest, numbers = np.split(y, self.ends, axis=1)
        full = np.zeros((len(y), self.rows.n, self.rows.n))
        full[:, self.i, self.j] = W
        full[:, self.j, self.i] = W
        return States(self.rows, full, free, lam, p, rest, dict(zip(self.names, numbers.T, strict=True)))

    def outputs(self, y: np.ndarray) -> Outputs:
        W, free, lam, rest, numbers = np.split(y, self.ends)
        full = np.zeros((self.rows.n, self.rows.n))
        full[self.i, self.j] += W / 2
        full[self.j, self.i] += W / 2
        return Outputs(full, free, lam, rest, dict(zip(self.names, numbers, strict=True)))
