"""design.yaml: what a design is to be best at."""

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, PositiveInt, field_validator

from cfem.condensed.parameters import Value
from cfem.core.actuator_units import Displacements, Effort, Efforts
from cfem.core.spec import Spec
from cfem.core.units import Forces, LengthMatrix
from cfem.design.objective_spec import BodySpec, FrequencySpec, Objective, RobustSpec
from cfem.export.spec import CSpec
from cfem.sample.spec import ParameterSpec

Weight = Annotated[float, Field(ge=0)]


class ActuationSpec(Spec):
    """The actuation at which every design is judged: displacements or forces."""

    displacement: Displacements | None = None
    """Displacement of each actuator."""
    force: Efforts | None = None
    """Force of each actuator."""

    def check(self) -> None:
        if (self.displacement is None) == (self.force is None):
            raise ValueError("expected a displacement or a force, one of the two")


class ConstraintFunction(Spec):
    """Your own function, as for an objective, with bounds."""

    function: str
    """'module:function' or 'file.py:function'."""
    at_least: float | None = None
    """Smallest allowed value."""
    at_most: float | None = None
    """Largest allowed value."""

    def check(self) -> None:
        if self.at_least is None and self.at_most is None:
            raise ValueError("needs at_least or at_most")


class FrontSpec(Spec):
    """The trade-off between objectives."""

    of: list[str] = Field(min_length=2)
    """Names of the objectives."""
    points: PositiveInt = 23
    """Number of designs between the ends."""


class TaskSpec(Spec):
    """Goals that one design has to reach, each with its own actuation."""

    goals: LengthMatrix
    """Goals of the effectors, one row per goal."""
    relative_to: Literal["frame", "rest"] = "frame"
    """What goals are measured from: the frame, or where each design rests."""
    force: Forces | None = None
    """Force on the effectors at all goals."""
    weights: list[Weight] | None = None
    """Weight of each effector row."""
    starts: PositiveInt = 4
    """Number of starts of the search."""
    policy: Path | None = None
    """A trained policy that is told the design, .onnx: which design it does best with is searched for as well."""


class RefineSpec(Spec):
    """By finite elements, whose values and gradients correct the model, to an optimum of their own."""

    starts: PositiveInt = 2
    """Designs of the model from which each search starts, the best first."""
    solves: int = Field(20, ge=2)
    """Largest number of finite-element solves with gradients, from each start."""
    radius: float = Field(0.2, gt=0, le=1)
    """First step at most, as a share of each parameter's range."""
    tolerance: float = Field(1e-3, gt=0)
    """Of the first-order conditions: slope that is left, as a share of the objective's spread, for a whole range of a
    parameter."""


class Scattered(Spec):
    """Designs that lie evenly scattered, for more parameters than a grid can have."""

    designs: int = Field(ge=2, le=1_000_000)
    """Number of designs."""


class DesignSpec(Spec):
    """Which designs to look for, what they are judged by, and how they are checked."""

    by: Literal["model", "fe"] = "model"
    """What judges designs: a model; or finite elements, one solve a design, with gradients by all parameters."""
    model: Path | None = None
    """Folder of a model that takes parameters. Needed where a model judges designs."""
    parameters: dict[str, ParameterSpec] = {}
    """Numbers of the scene that vary, by a name, where finite elements judge designs."""
    out: Path
    """Folder for the result."""
    scene: Path | None = None
    """Scene: where designs rest, their volumes, and the finite elements to verify with."""
    mesh: Path | None = None
    """Mesh of the scene."""
    actuation: ActuationSpec | None = None
    """Actuation at which every design is judged."""
    vary: list[str] | None = Field(None, min_length=1)
    """Parameters to vary. All unless given."""
    fixed: dict[str, Value] = {}
    """Values of the other parameters. The scene's unless given."""
    objectives: dict[Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$")], Objective] = {}
    """What is to be best, by a name."""
    blends: dict[str, dict[str, Weight]] = {}
    """Weights of normalised objectives. Each blend has its own best design."""
    front: FrontSpec | None = None
    """Trade-off between objectives."""
    task: TaskSpec | None = None
    """Goals that one design has to reach."""
    constraints: dict[str, str | ConstraintFunction] = {}
    """Inequalities of parameters (numbers in mm and MPa) and of `volume` (mm^3), or functions."""
    largest_force: Effort | None = Field(None, gt=0)
    """Largest force of any actuator."""
    grid: PositiveInt | list[PositiveInt] | Scattered = 8
    """Points along each parameter, or a number of scattered designs: `{designs: 10000}`."""
    sensitivity: PositiveInt | None = None
    """Which parameter matters: shares of the variance of each objective, from so many times (parameters + 2) designs. A
    power of two, such as 1024."""
    starts: PositiveInt = 3
    """Number of starts of the gradient search."""
    screen: PositiveInt = 8
    """Designs from which finite elements choose the starts."""
    verify: Literal["fe", "fe-front", "no"] = "no"
    """What to check with finite elements: fe, the best designs and the corners of the front; fe-front, all of the
    front."""
    refine: RefineSpec | None = None
    """Search on from the best designs with finite elements, which correct the model, until they have an optimum."""
    figures: bool = True
    """Whether to draw figures."""
    page: bool = False
    """Whether to write the front as a page to explore, front.html: click a design and see it move, by finite
    elements."""
    cad: bool = False
    """Whether to write each best design as STEP, and as STL for printing."""
    controller: CSpec | None = None
    """Write the controller of each best design in C."""

    @field_validator("sensitivity")
    @classmethod
    def _power(cls, designs: int | None) -> int | None:
        if designs is not None and designs & (designs - 1):
            raise ValueError(f"must be a power of two, such as 1024, got {designs}")
        return designs

    def check(self) -> None:
        """Checks that the fields go together."""
        if not self.objectives and self.task is None:
            raise ValueError("needs objectives or a task")
        if self.objectives and self.actuation is None:
            raise ValueError("objectives need an actuation, at which designs are judged")
        references = [("front.of", self.front.of)] if self.front else []
        robust = {name: objective for name, objective in self.objectives.items() if isinstance(objective, RobustSpec)}
        references += [(f"objectives.{name}.of", [objective.of]) for name, objective in robust.items()]
        nested = next((name for name, objective in robust.items() if objective.of in robust), None)
        if nested:
            raise ValueError(f"objectives.{nested}.of: names a robust objective itself")
        references += [(f"blends.{name}", list(weights)) for name, weights in self.blends.items()]
        for where, names in references:
            unknown = [name for name in names if name not in self.objectives]
            if unknown:
                raise ValueError(f"{where}: no objective '{unknown[0]}', known are {', '.join(self.objectives)}")
        needs = "by: fe" if self.by == "fe" else f"verify: {self.verify}" if self.verify != "no" else "refine:"
        if self.by_finite_elements and (self.scene is None or self.mesh is None):
            raise ValueError(f"{needs} needs scene and mesh")
        if self.page and (self.front is None or self.verify == "no"):
            raise ValueError("page: needs a front, and verify: fe or fe-front, whose finite elements it shows")
        self._judged()
        self._scattered()
        if self.controller is not None and self.controller.parameters:
            raise ValueError("controller.parameters: each design has its own")

    @property
    def by_finite_elements(self) -> bool:
        """True if anything is solved by finite elements."""
        return self.verify != "no" or self.by == "fe" or self.refine is not None

    def _scattered(self) -> None:
        """Finite elements take the scatter to first order."""
        if self.by != "fe" and self.refine is None:
            return
        for name, objective in self.objectives.items():
            if isinstance(objective, RobustSpec) and objective.statistic == "mean":
                raise ValueError(
                    f"objectives.{name}: finite elements take scatter to first order, to which the mean is "
                    f"'{objective.of}' itself; ask for a quantile"
                )

    def _judged(self) -> None:
        """Checks what a model, or finite elements, need."""
        if self.by == "model":
            if self.model is None:
                raise ValueError("model: needed where a model judges designs (or say by: fe)")
            if self.parameters:
                raise ValueError("parameters: the model has its own; they go with by: fe")
            number = next((name for name, objective in self.objectives.items() if _of_body(objective)), None)
            if number is not None:
                raise ValueError(f"objectives.{number}: needs by: fe")
            if self.refine is not None and not self.objectives:
                raise ValueError("refine: needs objectives")
            return
        if self.model is not None:
            raise ValueError("model: goes with by: model")
        if not self.parameters:
            raise ValueError("parameters: by: fe needs the numbers that vary")
        for name in ("task", "controller", "sensitivity", "refine"):
            if getattr(self, name) is not None:
                raise ValueError(f"{name}: needs a model")
        if self.verify != "no":
            raise ValueError("verify: finite elements judge every design already")


def _of_body(objective: Any) -> bool:
    return isinstance(objective, FrequencySpec) or (isinstance(objective, BodySpec) and objective.kind != "volume")
