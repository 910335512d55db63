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
    """Derivatives of a number by what one state gives, or of what the state gives by parameters, whose axis is then the
    last.

    W: (n, n) symmetric
    free: (n,)
    lam: (n_a,)
    rest: (n_e,)
    numbers: by name"""

    W: np.ndarray
    free: np.ndarray
    lam: np.ndarray
    rest: np.ndarray
    numbers: Mapping[str, np.ndarray]


class Differentiable(FiniteElementFamily):
    """Family of finite elements with derivatives by its parameters. fields: names of numbers that are computed from the
    deformed body, of FIELDS or VIBRATIONS, beside `volume` (mm^3) and, where the scene has densities, `mass` (t). Every
    parameter is varied, Young's modulus of a homogeneous robot too."""

    def __init__(
        self,
        scene: Any,
        mesh: Any,
        parameters: Sequence[Parameter],
        fields: Sequence[str] = (),
        folder: Path | None = None,
    ):
        """Builds the family with every parameter varied. InputError where a cable rubs in its guides."""
        super().__init__(scene, mesh, [replace(parameter, exact=False) for parameter in parameters], folder)
        from cfem.equilibrium.fields import Strain, Stress

        rubbing = next((actuator for actuator in self.robot.actuators if getattr(actuator, "friction", 0.0)), None)
        if rubbing is not None:
            what = "gradients of a robot whose cables rub in their guides are not implemented"
            raise InputError(what, where="by: fe", do="set friction to 0, or use a model")
        self.fields = {name: {"strain": Strain(), "stress": Stress()}[name] for name in fields if name in FIELDS}
        self.vibrations = {name: name == "frequency" for name in fields if name in VIBRATIONS}  # actuators held?

    @property
    def mass_unknown(self) -> bool:
        """True where a material has no density."""
        return self.robot.density is None

    def at(self, kind: Kind, u: np.ndarray, p: np.ndarray, push: np.ndarray | None = None) -> States:
        if push is not None:
            return super().at(kind, u, p, push)
        u = np.broadcast_to(u, (len(p), self.rows.n_a))
        solved = [
            self._state(design, *self.solve(kind, ask, design, keep=True)) for ask, design in zip(u, p, strict=True)
        ]
        return stacked([state for state, _ in solved])

    def _state(self, p: np.ndarray, equilibrium: Any, problem: Any) -> tuple[States, dict[str, Any]]:
        """State, with the numbers of the body beside it; and its vibrations."""
        from cfem.equilibrium.motion.inertia import mass_of
        from cfem.equilibrium.motion.vibration import lowest

        c, vibrations = equilibrium.condensed, {}
        if self.vibrations:
            mass = mass_of(problem.robot)
            vibrations = {name: lowest(equilibrium.linear, mass, held) for name, held in self.vibrations.items()}
        numbers = body_numbers(problem.robot)
        numbers |= {name: field.value(problem, equilibrium.linear.at) for name, field in self.fields.items()}
        numbers |= {name: vibration.frequency for name, vibration in vibrations.items()}
        given = {name: np.array([value]) for name, value in numbers.items()}
        rest = problem.robot.rest_e[None]
        return States(self.rows, c.W[None], c.delta_free[None], c.lam[None], p[None], rest, given), vibrations

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

        equilibrium, problem = self.solve(kind, u, p, keep=True)
        state, vibrations = self._state(p, equilibrium, problem)
        values, asked = slopes(state)
        if problem.robot.rigid or problem.body.rod is not None:
            if self.fields or self.vibrations:
                what = "strain, stress and frequency of a robot with rigid groups have no derivatives yet"
                raise InputError(what, where="by: fe")
            return state, values, self._chained(equilibrium, problem, p, free, asked)
        W, lam, act = equilibrium.condensed.W, equilibrium.condensed.lam, self.rows.active
        weights = []
        for weights_of in asked:
            G = weights_of.W.copy()
            G[:, act] -= np.outer(weights_of.free, lam)
            G[np.abs(G) <= _NOISE * np.maximum(np.abs(weights_of.W), np.abs(weights_of.W - G))] = 0.0
            l = weights_of.lam - W[:, act].T @ weights_of.free
            field_weights = tuple((float(weights_of.numbers[name]), field) for name, field in self.fields.items())
            forms = tuple(
                (form.share * float(weights_of.numbers[name]), form.columns) for name, form in vibrations.items()
            )
            weights.append(Weights((G + G.T) / 2, weights_of.free, l, weights_of.rest, field_weights, forms))
        sides, body_slopes = self._sides(problem, p, free)
        equilibrium = gradients(equilibrium.linear, weights, sides).dJ
        return (
            state,
            values,
            equilibrium
            + np.array([sum(weights_of.numbers[k] * body_slopes[k] for k in body_slopes) for weights_of in asked]),
        )

    def jacobian(self, kind: Kind, u: np.ndarray, p: np.ndarray, free: Sequence[int]) -> tuple[States, Outputs]:
        """State at p, and the derivatives of its outputs by the shares of the parameters `free`."""
        equilibrium, problem = self.solve(kind, u, p, keep=True)
        return self._state(p, equilibrium, problem)[0], self._outputs(equilibrium, problem, p, free)

    def _outputs(self, equilibrium: Any, problem: Any, p: np.ndarray, free: Sequence[int]) -> Outputs:
        from cfem.equilibrium.derivatives.jacobian import jacobian

        sides, body_slopes = self._sides(problem, p, free)
        by = jacobian(equilibrium.linear, sides)
        W, lam, act = equilibrium.condensed.W, equilibrium.condensed.lam, self.rows.active
        delta_free = by.delta - np.einsum("ijq,j->iq", by.W[:, act], lam) - W[:, act] @ by.lam
        return Outputs(by.W, delta_free, by.lam, by.rest_e, body_slopes)

    def _chained(
        self, equilibrium: Any, problem: Any, p: np.ndarray, free: Sequence[int], asked: Sequence[Outputs]
    ) -> np.ndarray:
        by = self._outputs(equilibrium, problem, p, free)
        return np.array([chain(number, by) for number in asked])

    def _sides(self, problem: Any, p: np.ndarray, free: Sequence[int]) -> tuple[list[Any], dict[str, np.ndarray]]:
        """Robots on either side in each parameter of `free`, by its share; and the derivatives of volume and mass."""
        from cfem.equilibrium.derivatives.parameter_slopes import Sides
        from cfem.equilibrium.system.problem import Problem

        family, _ = self._problem(p)
        low, high = range_coordinates(self.parameters)
        sides, body_slopes = [], {name: np.zeros(len(free)) for name in body_numbers(problem.robot)}
        for number, i in enumerate(free):
            behind, ahead, width = family.around(p, i, _STEP, problem.robot)
            width /= high[i] - low[i]
            sides.append(Sides(*(Problem(robot, like=problem) for robot in (behind, ahead)), width))
            beside = [body_numbers(robot) for robot in (behind, ahead)]
            for name, slope in body_slopes.items():
                slope[number] = (beside[1][name] - beside[0][name]) / width
        return sides, body_slopes

    def _place(self, kind: Kind, u: np.ndarray, p: np.ndarray) -> np.ndarray:
        return np.concatenate([super()._place(kind, u, p)[: self.rows.n_a], shares(self.parameters, p)])


def body_numbers(robot: Any) -> dict[str, float]:
    """Volume, and mass where it is known, of the body at rest."""
    volumes = robot.body.mesh.volumes
    numbers = {"volume": float(volumes.sum())}
    if robot.density is not None:
        numbers["mass"] = float(np.sum(robot.density * volumes))
    return numbers


def chain(number: Outputs, by: Outputs) -> np.ndarray:
    """Derivatives (n,) by parameters of a number of the outputs, from those of the outputs."""
    slopes = np.tensordot(number.W, by.W, 2) + number.free @ by.free + number.lam @ by.lam + number.rest @ by.rest
    return slopes + sum((number.numbers[name] * slope for name, slope in by.numbers.items()), np.zeros_like(slopes))


def stacked(states: Sequence[States]) -> States:
    """Many states as one value."""
    arrays = (
        np.concatenate([getattr(state, name) for state in states]) for name in ("W", "delta_free", "lam", "p", "rest_e")
    )
    names = states[0].numbers or {}
    return States(
        states[0].rows, *arrays, {name: np.concatenate([state.numbers[name] for state in states]) for name in names}
    )
