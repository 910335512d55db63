"""From what the spec asks to the problem and the task that are solved."""

from pathlib import Path
from typing import Any

import numpy as np

from cfem.condensed import Rows
from cfem.condensed.given import demand_known, vector
from cfem.core.errors import SpecError
from cfem.core.spec import load_spec
from cfem.design.expression import inequality, names_in
from cfem.design.objectives import Dexterity, Objective, OwnFunction, Strength, load_function, position_rows
from cfem.design.problem import Constraint, Problem
from cfem.design.spec import DesignSpec, DexteritySpec, FunctionSpec
from cfem.design.task import Task
from cfem.design.volume import Volume
from cfem.parametric.family import Family
from cfem.parametric.states import States
from cfem.robot.spec import SceneSpec


def free_parameters(spec: DesignSpec, parameters: Any) -> tuple[list[int], np.ndarray]:
    """Numbers of the parameters that vary, values (n_p,) of all."""
    names = [one.name for one in parameters]
    wanted = spec.vary if spec.vary is not None else [name for name in names if name not in spec.fixed]
    demand_known(parameters, wanted, "vary")
    p0 = vector(parameters, spec.fixed, "fixed")
    both = sorted(set(wanted) & set(spec.fixed))
    if both or not wanted:
        raise SpecError(
            f"{both} are listed both to vary and as fixed"
            if both
            else "all parameters are fixed, so there is nothing to vary",
            where="vary",
        )
    return [names.index(name) for name in wanted], p0


def problem_of(spec: DesignSpec, family: Family, scene: Path | None, base: Path) -> tuple[Problem, Volume | None]:
    """The problem, and the volume where a constraint speaks of it."""
    free, p0 = free_parameters(spec, family.parameters)
    volume = _volume(spec, family, scene)
    kind, u = (
        ("force", spec.actuation.force)
        if spec.actuation.displacement is None
        else ("displacement", spec.actuation.displacement)
    )
    if len(u) != family.rows.n_a:
        raise SpecError(f"has {len(u)} numbers, and the robot {family.rows.n_a} actuators", where=f"actuation.{kind}")
    objectives = {name: _objective(name, one, family.rows, base) for name, one in spec.objectives.items()}
    constraints = {name: _constraint(name, one, family, volume, base) for name, one in spec.constraints.items()}
    if spec.largest_force is not None:
        largest = spec.largest_force
        for i, name in enumerate(family.rows.actuators):
            constraints[f"force of {name}"] = lambda states, i=i: largest - np.abs(states.lam[:, i])
    return Problem(family, kind, np.asarray(u, float), free, p0, objectives, constraints), volume


def _volume(spec: DesignSpec, family: Family, scene: Path | None) -> Volume | None:
    texts = [one for one in spec.constraints.values() if isinstance(one, str)]
    if not any("volume" in names_in(text) for text in texts):
        return None
    if scene is None:
        raise SpecError("a constraint on the volume needs the key `scene`", where="scene")
    return Volume(load_spec(scene, SceneSpec), family.parameters)


def _objective(name: str, one: Any, rows: Rows, base: Path) -> Objective:
    where = f"objectives.{name}"
    if isinstance(one, FunctionSpec):
        sign = 1.0 if one.sense == "minimise" else -1.0
        return OwnFunction(where, load_function(one.function, base, where), sign)
    which, along = position_rows(rows, one.effector, where), "xyz".index(one.axis)
    rest = None if one.rest is None else np.asarray(one.rest)
    if isinstance(one, DexteritySpec):
        return Dexterity(which, along, one.angle, rest)
    return Strength(which, along, one.largest, rest)


def _constraint(name: str, one: Any, family: Family, volume: Volume | None, base: Path) -> Constraint:
    where = f"constraints.{name}"
    parameters = [parameter.name for parameter in family.parameters]
    if isinstance(one, str):
        slack = inequality(one, [*parameters, *(["volume"] if volume else [])], where)

        def holds(states: States) -> np.ndarray:
            values = dict(zip(parameters, states.p.T, strict=True))
            return np.broadcast_to(slack(values | ({"volume": volume(states.p)} if volume else {})), (len(states),))

        return holds
    own = OwnFunction(where, load_function(one.function, base, where))

    def bounded(states: States) -> np.ndarray:
        found = own(states)
        slacks = [found - one.at_least] if one.at_least is not None else []
        slacks += [one.at_most - found] if one.at_most is not None else []
        return np.min(slacks, axis=0)

    return bounded


def task_of(spec: DesignSpec, rows: Rows) -> Task:
    """SpecError where a list is not of the effectors' rows."""
    task = spec.task
    goals = np.asarray(task.goals)
    weights = np.ones(rows.n_e) if task.weights is None else np.array(task.weights)
    force = np.zeros(rows.n_e) if task.force is None else np.asarray(task.force, float)
    for where, given in (("goals", goals[0]), ("weights", weights), ("force", force)):
        if len(given) != rows.n_e:
            raise SpecError(f"has {len(given)} numbers, and the robot {rows.n_e} effector rows", where=f"task.{where}")
    return Task(goals, task.relative_to == "rest", weights, np.tile(force, (len(goals), 1)))
