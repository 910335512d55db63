"""design.yaml: what a design is to be best at."""

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, PositiveInt, model_validator

from cfem.condensed.given import Value
from cfem.core.spec import Spec
from cfem.core.units import Angle, Force, Forces, LengthMatrix, LengthVector, Point
from cfem.export.spec import CSpec

Weight = Annotated[float, Field(ge=0)]


class DexteritySpec(Spec):
    """|angle - alpha|, alpha = arccos(tip_z / |rest|): how far the effector turns. rest: a point for all designs;
    where each rests unless given."""

    kind: Literal["dexterity"]
    effector: str | None = None
    axis: Literal["x", "y", "z"] = "z"
    angle: Angle = np.pi / 2
    rest: Point | None = None


class StrengthSpec(Spec):
    """|largest - |lambda_c||, lambda_c the force along `axis` that holds the effector at rest. rest: see dexterity."""

    kind: Literal["strength"]
    effector: str | None = None
    axis: Literal["x", "y", "z"] = "y"
    largest: Force = 91.0
    rest: Point | None = None


class FunctionSpec(Spec):
    """One's own: 'module:function' or 'file.py:function' of W (m, n, n), delta_free (m, n), p (m, n_p) -> (m,)."""

    kind: Literal["python"]
    function: str
    sense: Literal["minimise", "maximise"] = "minimise"


Objective = Annotated[DexteritySpec | StrengthSpec | FunctionSpec, Field(discriminator="kind")]


class ActuationSpec(Spec):
    """At which every design is judged."""

    displacement: LengthVector | None = None
    force: Forces | None = None

    @model_validator(mode="after")
    def _one(self) -> "ActuationSpec":
        if (self.displacement is None) == (self.force is None):
            raise ValueError("expected a displacement or a force, one of the two")
        return self


class ConstraintFunction(Spec):
    """As an objective of one's own, with bounds."""

    function: str
    at_least: float | None = None
    at_most: float | None = None

    @model_validator(mode="after")
    def _bounded(self) -> "ConstraintFunction":
        if self.at_least is None and self.at_most is None:
            raise ValueError("needs at_least or at_most")
        return self


class FrontSpec(Spec):
    """of: names of objectives; points: designs asked for between the ends."""

    of: list[str] = Field(min_length=2)
    points: PositiveInt = 23


class TaskSpec(Spec):
    """Goals that one design is to reach, each with an actuation of its own. relative_to: the frame, or where each
    design rests; force: on the effectors at all goals; weights: of effector rows."""

    goals: LengthMatrix
    relative_to: Literal["frame", "rest"] = "frame"
    force: Forces | None = None
    weights: list[Weight] | None = None
    starts: PositiveInt = 4


class DesignSpec(Spec):
    """model: folder of a model that takes parameters; scene, mesh: where designs rest, their volumes, and finite
    elements to verify by. vary: all parameters unless given; fixed: values of the others, the scene's unless given.
    blends: weights of normalised objectives, each blend with a best design of its own. constraints: inequalities of
    parameters (numbers in their units, mm and MPa) and of `volume` (mm^3), or functions; largest_force: of any
    actuator. grid: points along each parameter. verify: the best designs and the front's corners, or all of the front,
    by finite elements. cad: also write each best design as STEP, and as STL for printing; controller: and its
    controller in C."""

    model: Path
    out: Path
    scene: Path | None = None
    mesh: Path | None = None
    actuation: ActuationSpec | None = None
    vary: list[str] | None = Field(None, min_length=1)
    fixed: dict[str, Value] = {}
    objectives: dict[Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$")], Objective] = {}
    blends: dict[str, dict[str, Weight]] = {}
    front: FrontSpec | None = None
    task: TaskSpec | None = None
    constraints: dict[str, str | ConstraintFunction] = {}
    largest_force: Force | None = Field(None, gt=0)
    grid: PositiveInt | list[PositiveInt] = 8
    starts: PositiveInt = 3
    verify: Literal["fe", "fe-front", "no"] = "no"
    figures: bool = True
    cad: bool = False
    controller: CSpec | None = None

    @model_validator(mode="after")
    def _names(self) -> "DesignSpec":
        if not self.objectives and self.task is None:
            raise ValueError("needs objectives or a task")
        if self.objectives and self.actuation is None:
            raise ValueError("objectives need an actuation, at which designs are judged")
        asked = [("front.of", self.front.of)] if self.front else []
        asked += [(f"blends.{name}", list(weights)) for name, weights in self.blends.items()]
        for where, names in asked:
            unknown = [name for name in names if name not in self.objectives]
            if unknown:
                raise ValueError(f"{where}: no objective '{unknown[0]}', known are {', '.join(self.objectives)}")
        if self.verify != "no" and (self.scene is None or self.mesh is None):
            raise ValueError(f"verify: {self.verify} needs scene and mesh")
        if self.controller is not None and self.controller.parameters:
            raise ValueError("controller.parameters: each design has its own")
        return self
