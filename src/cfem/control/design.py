"""One robot of a family: its FE model and the learned models at its parameters."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from cfem.condensed import Condensed, Rows
from cfem.condensed.parameters import Parameter, sampled
from cfem.core.errors import SpecError
from cfem.core.units import parse_quantity
from cfem.equilibrium.robot import Robot
from cfem.mechanics.mesh import Mesh
from cfem.predict.protocol import Predictor
from cfem.robot.spec import SceneSpec
from cfem.sample.family import RobotFamily
from cfem.sample.parameters import with_values


@dataclass(frozen=True)
class Bound:
    """`Model`: a predictor at parameters p (n_p,)."""

    predictor: Predictor
    p: np.ndarray

    @property
    def rows(self) -> Rows:
        return self.predictor.rows

    def at_displacement(self, delta_a: np.ndarray) -> Condensed:
        return self.predictor.at_displacement(delta_a, self.p)

    def inside(self, condensed: Condensed) -> bool:
        return self.predictor.inside(condensed, self.p)

    def distance(self, condensed: Condensed) -> float:
        return self.predictor.distance(condensed, self.p)


def parameter_values(parameters: tuple[Parameter, ...], design: Mapping[str, Any]) -> np.ndarray:
    """(n_p,) in the parameters' units: the scene's own but for those of the design. SpecError where a name or a value
    is none of theirs."""
    p = {one.name: one.reference for one in parameters}
    units = {one.name: one for one in parameters}
    for name, given in design.items():
        where = f"design.{name}"
        if name not in units:
            raise SpecError(f"no parameter of the models: they know {', '.join(units) or 'none'}", where=where)
        one = units[name]
        try:
            p[name] = float(given) if one.unit == "1" else parse_quantity(given, one.unit)
        except (TypeError, ValueError) as error:
            raise SpecError(str(error), where=where) from None
        if not one.low <= p[name] <= one.high:
            raise SpecError(f"{p[name]:g} {one.unit} is not between {one.low:g} and {one.high:g}", where=where)
    return np.array(list(p.values()))


def designed(
    scene: SceneSpec, mesh: Mesh, predictors: Mapping[str, Predictor], design: Mapping[str, Any]
) -> tuple[Robot, dict[str, Bound], np.ndarray]:
    """The FE robot of the design, the models bound to it, and how far its effectors rest (n_e,) mm from where the
    scene's own do. SpecError where the models differ in their parameters."""
    first, *others = predictors.values()
    parameters = first.parameters
    if any(one.parameters != parameters for one in others):
        raise SpecError("the models have different parameters", where="design")
    p = parameter_values(parameters, design)
    learned = [not one.exact for one in parameters]
    exact = [one.key for one in parameters if one.exact]
    scene = with_values(scene, exact, p[[one.exact for one in parameters]])
    family = RobotFamily(scene, mesh, sampled(parameters))
    robot = family.at(p[learned])
    return robot, {name: Bound(one, p) for name, one in predictors.items()}, robot.rest_e - family.robot.rest_e
