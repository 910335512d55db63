"""One interface to robots that differ in p: a learned model with parameters, or finite elements rebuilt for each p."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Literal, Protocol

import numpy as np

from cfem.condensed import Condensed, Rows
from cfem.condensed.parameters import Parameter, from_shares, references, shares
from cfem.core.errors import InputError, NumericalError
from cfem.parametric.differences import Stencil
from cfem.parametric.states import States
from cfem.predict.protocol import Predictor
from cfem.predict.series.state_error import extrapolation, reaction_sizes

Kind = Literal["displacement", "force"]
_SOLVED = 1e-9  # share of the largest answer to which finite elements are solved


class Family(Protocol):
    """A family of robots. stencil: how its responses are differenced by the parameters' coordinates, in shares of their
    ranges."""

    rows: Rows
    actuator_units: tuple[tuple[str, str], ...]
    parameters: tuple[Parameter, ...]
    reach: np.ndarray
    length: float
    stencil: Stencil

    def at(self, kind: Kind, u: np.ndarray, p: np.ndarray) -> States:
        """States of robots p (m, n_p) whose actuators stand at u (m, n_a) mm, or pull by u N. NumericalError where
        there is none."""
        ...

    def false_change(self, kind: Kind, states: States) -> tuple[np.ndarray, np.ndarray] | None:
        """Largest changes that errors of the family alone may give its answers where a parameter goes through its
        range: of the effectors (m, n_e), and of what is not commanded of the actuators (m, n_a). None where its errors
        are not known. states: of commands of this kind."""
        ...


class LearnedFamily:
    """Robots as a model has learned them. rest: p (m, n_p) -> where their effectors rest (m, n_e) mm; all where the
    model's own do unless given. InputError where the model has no parameters, or shapes whose rest is not given."""

    def __init__(self, predictor: Predictor, rest: Callable[[np.ndarray], np.ndarray] | None = None):
        """Takes over the predictor's rows, ranges and parameters."""
        if not predictor.parameters:
            do = "sample with `parameters:` and train again"
            raise InputError("the model has no parameters: it knows one robot only", do=do)
        if rest is None and any(parameter.moves_body for parameter in predictor.parameters):
            do = "give the scene in the spec"
            raise InputError("the model is of several shapes, and does not say where each one's effectors rest", do=do)
        self.predictor = predictor
        self.rest = rest or (lambda p: np.broadcast_to(predictor.rest_e, (len(p), predictor.rows.n_e)))
        self.rows, self.parameters = predictor.rows, predictor.parameters
        self.reach, self.length = predictor.reach, predictor.length
        self.actuator_units = predictor.actuator_units
        # a network in float32 is rough at 1e-7: a longer step and a lower order
        self.stencil = Stencil(4, 0.05) if predictor.meta["kind"] == "mlp" else Stencil(6, 0.01)

    def at(self, kind: Kind, u: np.ndarray, p: np.ndarray) -> States:
        """States with these displacements or forces u of robots p (m, n_p), all at once where the model is of that
        form. NumericalError far outside what it was trained on."""
        model, p = self.predictor, np.asarray(p, float)
        u = np.broadcast_to(u, (len(p), self.rows.n_a))
        state = model.at_displacement(u, p) if kind == "displacement" else model.at_force(u, p)
        return States(self.rows, state.W, state.delta_free, state.lam, p, self.rest(p))

    def false_change(self, kind: Kind, states: States) -> tuple[np.ndarray, np.ndarray] | None:
        """Twice the model's stated error, at either end of the range; None where it states none. Of an orientation that
        of a point at the robot's length, and outside the domain at least what is stated of all inside."""
        stated = self.predictor.model_error
        if stated is None:
            return None
        L = extrapolation(self.predictor, states, states.p)
        least = np.where(self.predictor.inside(states, states.p), 0.0, 1.0)
        tip, dual = (np.maximum(bound.at(L), least * bound.everywhere) for bound in (stated.tip, stated.actuators))
        dual = dual[:, None] * reaction_sizes(self.predictor, stated.command, states.p)
        effectors = tip[:, None] / np.where(self.rows.turns, self.length, 1.0)
        if kind != stated.command:  # what was commanded in the samples is found from its dual here
            reaction = _largest(states.W_aa if kind == "force" else np.linalg.inv(states.W_aa), dual)
            effectors = effectors + _largest(states.effector_jacobian, reaction if kind == "force" else dual)
            dual = reaction
        return 2 * effectors, 2 * dual

    def knows_stiffness(self, states: States, rows: np.ndarray) -> np.ndarray:
        """Mask (m,) of states in which the error that the model states of W is less than the smallest part of what its
        inverse over rows (k,) is of: the locked compliance of effectors. True where it states none."""
        if self.predictor.model_error is None:
            return np.ones(len(states), dtype=bool)
        error = self.predictor.error(states, states.p).W[:, rows[:, None], rows]
        size = np.sqrt(np.einsum("mii->mi", states.W[:, rows[:, None], rows]))
        scale = size[:, :, None] * size[:, None, :]
        least = np.linalg.eigvalsh(states.locked_compliance[:, rows[:, None], rows] / scale)[:, 0]
        return (error / scale).max(axis=(1, 2)) < least

    def outside(self, states: States) -> list[int]:
        """Numbers of the states that are unlike those that the model was trained on."""
        return np.flatnonzero(~self.predictor.inside(states, states.p)).tolist()


class FiniteElementFamily:
    """Robots as finite elements, solved one by one, each from the nearest solved before. Exact parameters scale the
    answer of their reference (`Parameter.exact`).

    solves: how many there were; folder: of the scene, so that designs to which its mesh does not stretch get meshes of
    their own (meshes.py); refused without"""

    stencil = Stencil(2, 1e-3)

    def __init__(self, scene: Any, mesh: Any, parameters: Sequence[Parameter], folder: Path | None = None):
        """Prepares the meshes of the scene's designs."""
        from cfem.parametric.meshes import Meshes

        self.parameters = tuple(parameters)
        self.meshes = Meshes(scene, mesh, self.parameters, folder)
        robot = self.robot
        if robot.rows.n_c:
            raise InputError("a scene with contact points cannot be calibrated or designed yet", where=robot.name)
        self.rows, self.reach, self.length = robot.rows, robot.reach, robot.length
        self.actuator_units = robot.actuator_units
        self._exact = np.array([parameter.exact for parameter in self.parameters], dtype=bool)
        self._reference = references(self.parameters)
        self._built: dict[bytes, tuple[Any, Any]] = {}
        self._solved: list[tuple[np.ndarray, Any, np.ndarray, Any]] = []
        self.solves = 0

    def at(self, kind: Kind, u: np.ndarray, p: np.ndarray, push: np.ndarray | None = None) -> States:
        """States with these displacements or forces u of robots p (m, n_p), solved one by one. push: (n_e,) N dead
        loads on the effectors."""
        p = np.asarray(p, float)
        u = np.broadcast_to(u, (len(p), self.rows.n_a))
        softer = np.prod((self._reference / p)[:, self._exact], axis=1)
        answers, rest = [], []
        for prescribed, design, soft in zip(u, p, softer, strict=True):
            pushed = None if push is None else push * soft
            answer, problem = self.solve(
                kind, prescribed * soft if kind == "force" else prescribed, design[~self._exact], pushed
            )
            answers.append(answer.condensed)
            rest.append(problem.robot.rest_e)
        state, soft = Condensed.batch(answers), softer[:, None]
        return States(self.rows, state.W * soft[..., None], state.delta_free, state.lam / soft, p, np.array(rest))

    def false_change(self, kind: Kind, states: States) -> tuple[np.ndarray, np.ndarray]:
        """Changes that differences of answers may give that are solved to a tolerance."""
        dual = states.lam if kind == "displacement" else states.delta_a
        largest = [np.abs(answers).max(axis=0, initial=0.0) for answers in (states.delta_e, dual)]
        effectors, reactions = (np.tile(_SOLVED * self.stencil.roughness * size, (len(states), 1)) for size in largest)
        return effectors, reactions

    @property
    def nodes(self) -> np.ndarray:
        """Nodes (n, 3) mm in the state that was solved last."""
        return self._solved[-1][1].x

    @property
    def robot(self) -> Any:
        """Robot of the scene as it stands."""
        return self.meshes.main.robot

    def solve(
        self, kind: Kind, u: np.ndarray, p: np.ndarray, push: np.ndarray | None = None, keep: bool = False
    ) -> tuple[Any, Any]:
        """The equilibrium and its problem; p without exact parameters; keep: as `equilibrium.solve` has it."""
        from cfem.equilibrium.solve import Wanted, solve
        from cfem.equilibrium.system import actuation
        from cfem.equilibrium.system.problem import Problem
        from cfem.equilibrium.system.solution import State
        from cfem.plant.fem_plant import pushed

        family, problem = self._problem(p)
        if push is not None:
            problem = Problem(pushed(problem.robot, push), like=problem)
        X = problem.rest
        place = self._place(kind, u, p)
        start = None
        alike = [known for known in self._solved if known[3] is family]
        if alike:
            _, state, X_there, _ = min(alike, key=lambda known: float(np.abs(known[0] - place).max()))
            start = State(X + (state.x - X_there), state.pressure, state.lam)
        equilibrium = solve(problem, getattr(actuation, kind)(u), start, slack=False, wanted=Wanted(keep=keep))
        self.solves += 1
        if not equilibrium.converged:
            named = {parameter.name: float(value) for parameter, value in zip(self._learned, p, strict=True)}
            raise NumericalError(f"finite elements at {named}, {kind} {u.tolist()}: {equilibrium.status.value}")
        self._solved = [*self._solved[-60:], (place, equilibrium.state, X, family)]
        return equilibrium, problem

    def _problem(self, p: np.ndarray) -> tuple[Any, Any]:
        """The family of robots on one mesh, and the problem."""
        from cfem.equilibrium.system.problem import Problem

        key = p.tobytes()
        if key not in self._built:
            family, robot = self.meshes.of(p)
            same = (problem for built_family, problem in self._built.values() if built_family is family)
            like = next(same, None) if family.alike else None
            if len(self._built) > 8:
                self._built.pop(list(self._built)[1])
            self._built[key] = family, Problem(robot, like=like)
        return self._built[key]

    def jumps(self, kind: Kind, u: np.ndarray) -> list[dict[str, Any]]:
        """Records of each mesh of a design's own: p of the design, cells; and at the edge of what the scene's mesh
        stretches to, by how much W (Frobenius norm, rows and columns in units of the roots of W's diagonal) and the
        effectors' places on either mesh differ, None where the other mesh does not stretch to there."""
        names = [parameter.name for parameter in self.meshes.parameters]
        records = []
        for remeshed in self.meshes.own:
            record = {"p": dict(zip(names, remeshed.p.tolist(), strict=True)), "cells": remeshed.cells}
            try:
                records.append(record | self._jump(remeshed, kind, u))
            except NumericalError:
                records.append(record | {"W_share": None, "effector_distance": None})
        return records

    def _jump(self, remeshed: Any, kind: Kind, u: np.ndarray) -> dict[str, float]:
        """Differences of W and of the effectors' places between both meshes at the edge."""
        from cfem.equilibrium.solve import solve
        from cfem.equilibrium.system import actuation
        from cfem.equilibrium.system.problem import Problem

        edge, answers = self.meshes.edge(remeshed), []
        for family in (self.meshes.main, remeshed.family):
            robot = family.at(edge)
            equilibrium = solve(Problem(robot), getattr(actuation, kind)(u), slack=False)
            if not equilibrium.converged:
                raise NumericalError(f"no equilibrium at the edge: {equilibrium.status.value}")
            answers.append((equilibrium.condensed.W, robot.rest_e + equilibrium.delta_e))
        (W, x), (W_remeshed, x_remeshed) = answers
        size = np.sqrt(np.abs(np.diag(W)))
        scaled, true = (W_remeshed - W) / np.outer(size, size), W / np.outer(size, size)
        apart = float(np.linalg.norm(scaled) / np.linalg.norm(true))
        return {"W_share": apart, "effector_distance": float(np.linalg.norm(x_remeshed - x))}

    @property
    def _learned(self) -> list[Parameter]:
        return [parameter for parameter in self.parameters if not parameter.exact]

    def _place(self, kind: Kind, u: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Actuation and design in shares of their ranges."""
        scale = np.abs(self.reach).max(axis=1) if kind == "displacement" else max(float(np.abs(u).max()), 1e-12)
        return np.concatenate([u / scale, shares(self._learned, p)])


def _largest(slopes: np.ndarray, errors: np.ndarray) -> np.ndarray:
    """Largest changes (m, k) by errors (m, n) of either sign, through slopes (m, k, n)."""
    return (np.abs(slopes) @ errors[..., None])[..., 0]


class Varied:
    """Problems over some of a family's parameters: values p0 (n_p,) of all, and which of them are `free`; z (..., n)
    are their shares of the ranges."""

    family: Family
    p0: np.ndarray
    free: Sequence[int]

    @property
    def parameters(self) -> list[Parameter]:
        """Parameters that are free."""
        return [self.family.parameters[i] for i in self.free]

    def p(self, z: np.ndarray) -> np.ndarray:
        """Parameters (..., n_p) at shares z (..., n) of the free ones."""
        out = np.broadcast_to(self.p0, (*z.shape[:-1], len(self.p0))).copy()
        out[..., list(self.free)] = from_shares(self.parameters, z)
        return out

    def z(self, p: np.ndarray) -> np.ndarray:
        """Shares (..., n) of the free parameters in p (..., n_p)."""
        return shares(self.parameters, np.asarray(p)[..., list(self.free)])
