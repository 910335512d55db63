"""Problem and task that are solved, made from the spec."""

from pathlib import Path
from typing import Any

import numpy as np

from cfem.condensed import Rows
from cfem.condensed.parameters import Parameter, demand_known, number_in, vector
from cfem.core.errors import SpecError
from cfem.core.spec import load_spec
from cfem.design.expression import inequality, names_in
from cfem.design.fe import FeProblem
from cfem.design.objective_spec import (
    BodySpec,
    DexteritySpec,
    ForceSpec,
    FrequencySpec,
    FunctionSpec,
    ManipulabilitySpec,
    ReachSpec,
    RobustSpec,
    StiffnessSpec,
)
from cfem.design.objectives import Dexterity, Objective, OwnFunction, Strength, load_function, position_rows
from cfem.design.problem import Constraint, DesignProblem
from cfem.design.spec import DesignSpec
from cfem.design.task import Task
from cfem.design.volume import Volume
from cfem.design.workspace import (
    Force,
    Manipulability,
    OfBody,
    Robust,
    Stiffness,
    WorkspaceMeasure,
    actuation_grid,
    normal_offsets,
)
from cfem.parametric.differentiable import Differentiable
from cfem.parametric.family import Family
from cfem.parametric.states import States
from cfem.robot.spec import SceneSpec

MOST_STATES = 400  # of one design


def free_parameters(spec: DesignSpec, parameters: Any) -> tuple[list[int], np.ndarray]:
    """Numbers of the parameters that vary, and values (n_p,) of all."""
    names = [parameter.name for parameter in parameters]
    wanted = spec.vary if spec.vary is not None else [name for name in names if name not in spec.fixed]
    demand_known(parameters, wanted, "vary")
    p0 = vector(parameters, spec.fixed, "fixed")
    twice = sorted(set(wanted) & set(spec.fixed))
    if twice or not wanted:
        raise SpecError(
            f"{twice} are listed both to vary and as fixed"
            if twice
            else "all parameters are fixed, so there is nothing to vary",
            where="vary",
        )
    return [names.index(name) for name in wanted], p0


def problem_of(spec: DesignSpec, family: Family, scene: Path | None, base: Path) -> tuple[DesignProblem, Volume | None]:
    """Problem of the spec, and the volume where a constraint speaks of it."""
    free, p0 = free_parameters(spec, family.parameters)
    volume = _volume(spec, family, scene)
    kind, u = (
        ("force", spec.actuation.force)
        if spec.actuation.displacement is None
        else ("displacement", spec.actuation.displacement)
    )
    if len(u) != family.rows.n_a:
        raise SpecError(
            f"has {len(u)} numbers, and the robot {family.rows.n_a} actuators",
            where=f"actuation.{kind}",
            do="give one number per actuator",
        )
    named = spec.objectives
    plain = {
        k: _objective(k, objective, family, volume, base)
        for k, objective in named.items()
        if not isinstance(objective, RobustSpec)
    }
    objectives = {k: plain[k] if k in plain else _robust(k, objective, family, plain) for k, objective in named.items()}
    constraints = {
        name: _constraint(name, constraint, family, volume, base) for name, constraint in spec.constraints.items()
    }
    if spec.largest_force is not None:
        largest = spec.largest_force
        for i, name in enumerate(family.rows.actuators):
            constraints[f"force of {name}"] = lambda states, i=i: largest - np.abs(states.lam[:, i])
    problem_class = FeProblem if spec.by == "fe" else DesignProblem
    return problem_class(family, kind, np.asarray(u, float), free, p0, objectives, constraints), volume


def _volume(spec: DesignSpec, family: Family, scene: Path | None) -> Volume | None:
    """Volume of the body, None where nothing asks for it."""
    texts = [constraint for constraint in spec.constraints.values() if isinstance(constraint, str)]
    of_bodies = [objective for objective in spec.objectives.values() if isinstance(objective, BodySpec)]
    if spec.by == "fe" or not (of_bodies or any("volume" in names_in(text) for text in texts)):
        return None
    if scene is None:
        raise SpecError("the volume needs the key `scene`", where="scene", do="name the scene.yaml")
    return Volume(load_spec(scene, SceneSpec), family.parameters)


def _objective(name: str, spec: Any, family: Family, volume: Volume | None, base: Path) -> Objective:
    """Objective of its spec."""
    where, rows = f"objectives.{name}", family.rows
    if isinstance(spec, FunctionSpec):
        sign = 1.0 if spec.sense == "minimise" else -1.0
        return OwnFunction(where, load_function(spec.function, base, where), sign, spec.unit)
    if isinstance(spec, BodySpec):
        return OfBody(spec.kind, volume=volume)
    if isinstance(spec, FrequencySpec):
        return OfBody(spec.number, -1.0)
    effector_rows = position_rows(rows, spec.effector, where)
    if isinstance(spec, ReachSpec | ManipulabilitySpec | StiffnessSpec | ForceSpec):
        return _of_workspace(spec, effector_rows, family, where)
    along = "xyz".index(spec.axis)
    rest = None if spec.rest is None else np.asarray(spec.rest)
    if isinstance(spec, DexteritySpec):
        return Dexterity(effector_rows, along, spec.angle, rest)
    return Strength(effector_rows, along, spec.largest, rest)


def _of_workspace(spec: Any, effector_rows: np.ndarray, family: Family, where: str) -> Objective:
    """Objective over the workspace, or at one actuation."""
    direction = np.asarray(getattr(spec, "direction", [1.0, 0.0, 0.0]), float)
    direction /= np.linalg.norm(direction)
    if isinstance(spec, ForceSpec):
        return Force(effector_rows, direction, np.asarray(spec.goal))
    if isinstance(spec, StiffnessSpec) and spec.points is None:
        return Stiffness(effector_rows, direction)
    if spec.points**family.rows.n_a > MOST_STATES:
        what = f"{spec.points} actuations along each of {family.rows.n_a} reaches are more than {MOST_STATES} states"
        raise SpecError(what, where=f"{where}.points", do="use fewer")
    actuations = actuation_grid(family.reach, spec.points)
    if isinstance(spec, StiffnessSpec):
        return Stiffness(effector_rows, direction, actuations)
    if isinstance(spec, ManipulabilitySpec):
        return Manipulability(effector_rows, actuations)
    if family.rows.n_a > len(effector_rows):
        raise SpecError(
            "kind: workspace is for robots with one to three actuators", where=where, do="use kind: manipulability"
        )
    return WorkspaceMeasure(effector_rows, actuations, spec.points)


def _robust(name: str, spec: RobustSpec, family: Family, plain: dict[str, Objective]) -> Robust:
    """Robust objective, over scattered parameters."""
    where, parameters = f"objectives.{name}.scatter", family.parameters
    demand_known(parameters, spec.scatter, where)
    deviation = np.array(
        [
            _deviation(parameter, spec.scatter.get(parameter.name, 0), f"{where}.{parameter.name}")
            for parameter in parameters
        ]
    )
    low, high = np.array([(parameter.low, parameter.high) for parameter in parameters]).T
    share = None if spec.statistic == "mean" else spec.share
    return Robust(plain[spec.of], normal_offsets(deviation, spec.robots), low, high, share, deviation)


def _deviation(parameter: Parameter, given: Any, where: str) -> float:
    """Standard deviation of a parameter, 0 unless given."""
    if given == 0:
        return 0.0
    value = number_in(parameter.unit, given, where)
    if not value > 0:
        raise SpecError("a standard deviation must be greater than 0", where=where)
    return value


def _constraint(name: str, spec: Any, family: Family, volume: Volume | None, base: Path) -> Constraint:
    """Constraint of its spec, satisfied from 0 on."""
    where = f"constraints.{name}"
    parameters = [parameter.name for parameter in family.parameters]
    if isinstance(spec, str):
        exact = isinstance(family, Differentiable)
        slack = inequality(spec, [*parameters, *(["volume"] if volume or exact else [])], where)

        def holds(states: States) -> np.ndarray:
            values = dict(zip(parameters, states.p.T, strict=True))
            if exact:
                values["volume"] = states.numbers["volume"]
            elif volume:
                values["volume"] = volume(states.p)
            return np.broadcast_to(slack(values), (len(states),))

        return holds
    function = OwnFunction(where, load_function(spec.function, base, where))

    def bounded(states: States) -> np.ndarray:
        values = function(states)
        slacks = [values - spec.at_least] if spec.at_least is not None else []
        slacks += [spec.at_most - values] if spec.at_most is not None else []
        return np.min(slacks, axis=0)

    return bounded


def task_of(spec: DesignSpec, rows: Rows) -> Task:
    """Task of a design's spec. SpecError where a list is not of the effectors' rows."""
    task = spec.task
    goals = np.asarray(task.goals)
    weights = np.ones(rows.n_e) if task.weights is None else np.array(task.weights)
    force = np.zeros(rows.n_e) if task.force is None else np.asarray(task.force, float)
    for where, given in (("goals", goals[0]), ("weights", weights), ("force", force)):
        if len(given) != rows.n_e:
            raise SpecError(
                f"has {len(given)} numbers, and the robot {rows.n_e} effector rows",
                where=f"task.{where}",
                do="give one number per effector row",
            )
    return Task(goals, task.relative_to == "rest", weights, np.tile(force, (len(goals), 1)))
