"""Finite elements with derivatives by design parameters: no differences of whole solves.

Everything is by z, the parameters' shares of their ranges. What a state gives: W, delta_free, lambda, where the
effectors rest, and numbers of the whole body."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from cfem.condensed.parameters import Parameter, range_coordinates, shares
from cfem.core.errors import InputError
from cfem.parametric.family import FiniteElementFamily, Kind
from cfem.parametric.states import States

FIELDS = ("strain", "stress")
VIBRATIONS = ("frequency", "free frequency")  # Hz, the lowest; actuators held, or pulling with constant forces
_STEP = 2e-5  # of each range, by which robots on either side differ
_NOISE = 1e-9  # of what cancels in a number that depends on displacements, not on W


@dataclass(frozen=True)
class Outputs:
    """Derivatives of a number by what one state gives: W (n, n) symmetric, free (n,), lam (n_a,), rest (n_e,), numbers
    by name. Or of what the state gives by parameters, whose axis is then the last."""

    W: np.ndarray
    free: np.ndarray
    lam: np.ndarray
    rest: np.ndarray
    numbers: Mapping[str, np.ndarray]


class Differentiable(FiniteElementFamily):
    """fields: names of numbers that are computed from the deformed body, of FIELDS or VIBRATIONS, beside `volume`
    (mm^3) and, where the scene has densities, `mass` (t). Every parameter is varied, Young's modulus of a homogeneous
    robot too."""

    def __init__(
        self,
        scene: Any,
        mesh: Any,
        parameters: Sequence[Parameter],
        fields: Sequence[str] = (),
        folder: Path | None = None,
    ):
        super().__init__(scene, mesh, [replace(one, exact=False) for one in parameters], folder)
        from cfem.equilibrium.fields import Strain, Stress

        rubbing = next((one for one in self.robot.actuators if getattr(one, "friction", 0.0)), None)
        if rubbing is not None:
            what = "gradients of a robot whose cables rub in their guides are not implemented"
            raise InputError(what, where="by: fe", do="set friction to 0, or use a model")
        self.fields = {name: {"strain": Strain(), "stress": Stress()}[name] for name in fields if name in FIELDS}
        self.vibrations = {name: name == "frequency" for name in fields if name in VIBRATIONS}  # actuators held?

    @property
    def mass_unknown(self) -> bool:
        """Whether a material has no density."""
        return self.robot.density is None

    def at(self, kind: Kind, u: np.ndarray, p: np.ndarray, push: np.ndarray | None = None) -> States:
        if push is not None:
            return super().at(kind, u, p, push)
        u = np.broadcast_to(u, (len(p), self.rows.n_a))
        each = [self._state(one, *self.solve(kind, ask, one, keep=True)) for ask, one in zip(u, p, strict=True)]
        return stacked([state for state, _ in each])

    def _state(self, p: np.ndarray, found: Any, problem: Any) -> tuple[States, dict[str, Any]]:
        """One state, the numbers of the body beside it; and its vibrations."""
        from cfem.equilibrium.motion.inertia import mass_of
        from cfem.equilibrium.motion.vibration import lowest

        c, vibrations = found.condensed, {}
        if self.vibrations:
            mass = mass_of(problem.robot)
            vibrations = {name: lowest(found.linear, mass, held) for name, held in self.vibrations.items()}
        numbers = body_numbers(problem.robot)
        numbers |= {name: field.value(problem, found.linear.at) for name, field in self.fields.items()}
        numbers |= {name: one.frequency for name, one in vibrations.items()}
        given = {name: np.array([value]) for name, value in numbers.items()}
        rest = problem.robot.rest_e[None]
        return States(self.rows, p[None], c.W[None], c.delta_free[None], c.lam[None], rest, given), vibrations

    def gradient(
        self,
        kind: Kind,
        u: np.ndarray,
        p: np.ndarray,
        free: Sequence[int],
        slopes: Callable[[States], tuple[np.ndarray, Sequence[Outputs]]],
    ) -> tuple[States, np.ndarray, np.ndarray]:
        """One state at p (n_p,); r numbers of it with their derivatives by its outputs, as `slopes` gives them; and
        their derivatives (r, n) by the shares of the parameters `free`, what depends on p itself left out. One
        equilibrium, no factorisation beside."""
        from cfem.equilibrium.derivatives.adjoint import Weights, gradients

        found, problem = self.solve(kind, u, p, keep=True)
        state, vibrations = self._state(p, found, problem)
        values, asked = slopes(state)
        if problem.robot.rigid or problem.body.rod is not None:
            if self.fields or self.vibrations:
                what = "strain, stress and frequency of a robot with rigid groups have no derivatives yet"
                raise InputError(what, where="by: fe")
            return state, values, self._chained(found, problem, p, free, asked)
        W, lam, act = found.condensed.W, found.condensed.lam, self.rows.active
        weights = []
        for one in asked:
            G = one.W.copy()
            G[:, act] -= np.outer(one.free, lam)
            G[np.abs(G) <= _NOISE * np.maximum(np.abs(one.W), np.abs(one.W - G))] = 0.0
            l = one.lam - W[:, act].T @ one.free
            of = tuple((float(one.numbers[name]), field) for name, field in self.fields.items())
            forms = tuple((each.share * float(one.numbers[name]), each.columns) for name, each in vibrations.items())
            weights.append(Weights((G + G.T) / 2, one.free, l, one.rest, of, forms))
        sides, still = self._sides(problem, p, free)
        found = gradients(found.linear, weights, sides).dJ
        return state, values, found + np.array([sum(one.numbers[k] * still[k] for k in still) for one in asked])

    def jacobian(self, kind: Kind, u: np.ndarray, p: np.ndarray, free: Sequence[int]) -> tuple[States, Outputs]:
        """One state at p, and the derivatives of its outputs by the shares of the parameters `free`."""
        found, problem = self.solve(kind, u, p, keep=True)
        return self._state(p, found, problem)[0], self._outputs(found, problem, p, free)

    def _outputs(self, found: Any, problem: Any, p: np.ndarray, free: Sequence[int]) -> Outputs:
        from cfem.equilibrium.derivatives.jacobian import jacobian

        sides, still = self._sides(problem, p, free)
        by = jacobian(found.linear, sides)
        W, lam, act = found.condensed.W, found.condensed.lam, self.rows.active
        delta_free = by.delta - np.einsum("ijq,j->iq", by.W[:, act], lam) - W[:, act] @ by.lam
        return Outputs(by.W, delta_free, by.lam, by.rest_e, still)

    def _chained(
        self, found: Any, problem: Any, p: np.ndarray, free: Sequence[int], asked: Sequence[Outputs]
    ) -> np.ndarray:
        by = self._outputs(found, problem, p, free)
        return np.array([chain(one, by) for one in asked])

    def _sides(self, problem: Any, p: np.ndarray, free: Sequence[int]) -> tuple[list[Any], dict[str, np.ndarray]]:
        """Of each parameter in `free`, by its share; and the derivatives of volume and mass."""
        from cfem.equilibrium.derivatives.parameter_slopes import Sides
        from cfem.equilibrium.problem import Problem

        family, _ = self._problem(p)
        low, high = range_coordinates(self.parameters)
        sides, still = [], {name: np.zeros(len(free)) for name in body_numbers(problem.robot)}
        for number, i in enumerate(free):
            behind, ahead, width = family.around(p, i, _STEP, problem.robot)
            width /= high[i] - low[i]
            sides.append(Sides(*(Problem(one, like=problem) for one in (behind, ahead)), width))
            there = [body_numbers(one) for one in (behind, ahead)]
            for name, slope in still.items():
                slope[number] = (there[1][name] - there[0][name]) / width
        return sides, still

    def _place(self, kind: Kind, u: np.ndarray, p: np.ndarray) -> np.ndarray:
        return np.concatenate([super()._place(kind, u, p)[: self.rows.n_a], shares(self.parameters, p)])


def body_numbers(robot: Any) -> dict[str, float]:
    """Of the body at rest."""
    volumes = robot.body.mesh.volumes
    found = {"volume": float(volumes.sum())}
    if robot.density is not None:
        found["mass"] = float(np.sum(robot.density * volumes))
    return found


def chain(number: Outputs, by: Outputs) -> np.ndarray:
    """(n,): derivatives by parameters of a number of the outputs, from those of the outputs."""
    found = np.tensordot(number.W, by.W, 2) + number.free @ by.free + number.lam @ by.lam + number.rest @ by.rest
    return found + sum((number.numbers[name] * slope for name, slope in by.numbers.items()), np.zeros_like(found))


def stacked(states: Sequence[States]) -> States:
    """Many states as one value."""
    arrays = (
        np.concatenate([getattr(one, name) for one in states]) for name in ("p", "W", "delta_free", "lam", "rest_e")
    )
    names = states[0].numbers or {}
    return States(
        states[0].rows, *arrays, {name: np.concatenate([one.numbers[name] for one in states]) for name in names}
    )
