"""Largest strain and stress of a body.

The largest value in a body sits at a re-entrant corner, where it grows without bound as the mesh is refined. So a mean
of high power over the volume is given,

    J = (int m^P dV / V)^(1/P),

which a small corner moves little, and which is smooth. m is the largest principal stretch less one, or von Mises'
stress."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cfem.core.errors import InputError
from cfem.equilibrium.system.evaluation import Evaluation
from cfem.equilibrium.system.problem import Problem
from cfem.mechanics.further_stress import add_stress
from cfem.mechanics.material.law import evaluate
from cfem.mechanics.solid import Solid, SolidResponse

# Laws whose pressure is a pressure: theta depends on J alone, and is left out of the deviator.
_BY_VOLUME = ("neo-hookean", "neo-hookean-log", "mooney-rivlin", "ogden", "yeoh")
_STEP = 1e-6
Side = tuple[Problem, Evaluation]
Points = tuple[Solid, np.ndarray]


@dataclass(frozen=True)
class Field(ABC):
    """A scalar at each point of the solids, and its mean J over the body."""

    power: float = 16.0

    @abstractmethod
    def at_points(self, part: Solid, D: np.ndarray) -> np.ndarray:
        """Values (k,) at displacement gradients D (k, 3, 3)."""

    @abstractmethod
    def slopes(self, part: Solid, D: np.ndarray) -> np.ndarray:
        """Derivatives (k, 3, 3) by the deformation gradient F = D + I."""

    def value(self, problem: Problem, evaluation: Evaluation) -> float:
        """Mean J of the field over the body."""
        parts = _points(problem, evaluation)
        values = [self.at_points(part, points.D) for part, points in parts]
        most = max(float(part_values.max()) for part_values in values)
        if most == 0.0:
            return 0.0
        volume = sum(float(part.weights.sum()) for part, _ in parts)
        powers = (part.weights.ravel() @ (m / most) ** self.power for (part, _), m in zip(parts, values, strict=True))
        return most * (sum(powers) / volume) ** (1 / self.power)

    def gradient(self, problem: Problem, evaluation: Evaluation) -> np.ndarray:
        """Gradient (n, 3) of J by the positions of the nodes."""
        mean, gradient = self.value(problem, evaluation), np.zeros_like(evaluation.x)
        if mean == 0.0:
            return gradient
        parts = _points(problem, evaluation)
        volume = sum(float(part.weights.sum()) for part, _ in parts)
        for part, points in parts:
            share = (self.at_points(part, points.D) / mean) ** (self.power - 1) / volume  # over each point's weight
            add_stress(part, points, share[:, None, None] * self.slopes(part, points.D), gradient)
        return gradient

    def changes(self, problem: Problem, evaluation: Evaluation) -> Callable[[Side, Side], float]:
        """Change of J (explicit.py) from the points' volumes and from m, whose power is differentiated by hand, as
        differences of J would lose the power's square to truncation."""
        mean, parts = self.value(problem, evaluation), _points(problem, evaluation)
        if mean == 0.0:
            return lambda behind, ahead: 0.0
        volume = sum(float(part.weights.sum()) for part, _ in parts)
        shares = [self.at_points(part, points.D) / mean for part, points in parts]
        between = [self.between(part, points.D) for part, points in parts]

        def change(behind: Side, ahead: Side) -> float:
            total = 0.0
            sides = zip(parts, shares, between, _points(*behind), _points(*ahead), strict=True)
            for (part, _), share, difference, (b, at_b), (a, at_a) in sides:
                grown = (a.weights - b.weights).ravel()
                total += mean / self.power * (grown @ (share**self.power - 1))
                total += part.weights.ravel() @ (share ** (self.power - 1) * difference((b, at_b.D), (a, at_a.D)))
            return float(total / volume)

        return change

    def between(self, part: Solid, D: np.ndarray) -> Callable[[Points, Points], np.ndarray]:
        """(k,) m of one less m of another, of solids that hardly differ from `part` at D (k, 3, 3)."""
        return lambda behind, ahead: self.at_points(*ahead) - self.at_points(*behind)

    def largest(self, problem: Problem, evaluation: Evaluation) -> float:
        """Largest value at any quadrature point."""
        return max(float(self.at_points(part, points.D).max()) for part, points in _points(problem, evaluation))


@dataclass(frozen=True)
class Strain(Field):
    """Largest principal stretch less one."""

    def at_points(self, part: Solid, D: np.ndarray) -> np.ndarray:
        F = D + np.eye(3)
        return np.maximum(np.sqrt(np.linalg.eigvalsh(F.swapaxes(1, 2) @ F)[:, 2]) - 1.0, 0.0)

    def between(self, part: Solid, D: np.ndarray) -> Callable[[Points, Points], np.ndarray]:
        slopes = self.slopes(part, D)
        return lambda behind, ahead: np.einsum("kij,kij->k", slopes, ahead[1] - behind[1])

    def slopes(self, part: Solid, D: np.ndarray) -> np.ndarray:
        """Derivatives (k, 3, 3) by F: n N^T, the directions of the largest stretch after and before."""
        F = D + np.eye(3)
        squares, axes = np.linalg.eigh(F.swapaxes(1, 2) @ F)
        N = axes[:, :, 2]
        return np.einsum("kij,kj,kl->kil", F, N, N) / np.sqrt(squares[:, 2])[:, None, None]


@dataclass(frozen=True)
class Stress(Field):
    """Von Mises' Cauchy stress, MPa."""

    def at_points(self, part: Solid, D: np.ndarray) -> np.ndarray:
        if part.law.name not in _BY_VOLUME:
            raise InputError(f"von Mises' stress of the law {part.law.name} is not implemented")
        F = D + np.eye(3)
        sigma = evaluate(part.law, D, part.parameters)[2] @ F.swapaxes(1, 2) / np.linalg.det(F)[:, None, None]
        deviator = sigma - np.trace(sigma, axis1=1, axis2=2)[:, None, None] / 3 * np.eye(3)
        return np.sqrt(1.5 * (deviator**2).sum(axis=(1, 2)))

    def slopes(self, part: Solid, D: np.ndarray) -> np.ndarray:
        """Derivatives (k, 3, 3) by F, by central differences."""
        slopes = np.empty_like(D)
        for i in range(3):
            for j in range(3):
                step = np.zeros((3, 3))
                step[i, j] = _STEP
                slopes[:, i, j] = (self.at_points(part, D + step) - self.at_points(part, D - step)) / (2 * _STEP)
        return slopes


def _points(problem: Problem, evaluation: Evaluation) -> list[tuple[Solid, SolidResponse]]:
    if problem.body.rod is not None:
        raise InputError("strain and stress are those of solids, not of a rod", do="use another mesh.element")
    return list(zip(problem.body.solids, evaluation.response.solids, strict=True))
