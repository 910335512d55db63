"""What `control.yaml` says: which models follow which trajectories, against what."""

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, NonNegativeInt, PositiveInt, model_validator

from cfem.control.closed_loop_spec import LoopSpec
from cfem.core.spec import Spec
from cfem.core.units import Angle, Force, ForceVector, Length, LengthMatrix, LengthVector, Point
from cfem.robot.geometry import Turn

FE_BASED = "fe-based"  # name of the controller that has FE matrices for its model


class ArcSpec(Spec):
    """Goals on an arc of a circle, whether the robot can reach them or not. from_rest: so many more before them, on the
    straight line from where the effector rests."""

    kind: Literal["arc"]
    centre: LengthVector
    radius: Length
    start: Angle
    end: Angle
    plane: Literal["xy", "yz", "zx"]
    goals: PositiveInt
    from_rest: NonNegativeInt = 0


class HalfSphereSpec(Spec):
    """Goals on a spiral over the upper half of a sphere, from its top down to its equator, whether the robot can reach
    them or not. turns: about the z axis."""

    kind: Literal["half-sphere"]
    centre: LengthVector
    radius: Length
    turns: float = 3.0
    goals: PositiveInt


class GoalsSpec(Spec):
    """Goals one by one."""

    kind: Literal["goals"]
    points: LengthMatrix


class ImageSpec(Spec):
    """The image by FE of a closed curve in the pulling cube [0, 1]^n_a: an ellipse for two actuators.
    Reachable."""

    kind: Literal["image"]
    centre: list[float]
    radii: list[float]
    goals: PositiveInt

    @model_validator(mode="after")
    def _inside_the_cube(self):
        if len(self.centre) != len(self.radii):
            raise ValueError("centre and radii need one number an actuator each")
        if any(c - abs(r) < 0 or c + abs(r) > 1 for c, r in zip(self.centre, self.radii, strict=True)):
            raise ValueError("the curve leaves the pulling cube [0, 1]")
        return self


TrajectorySpec = Annotated[ArcSpec | HalfSphereSpec | GoalsSpec | ImageSpec, Field(discriminator="kind")]


class SearchSpec(Spec):
    """iterations: inverse steps a goal; tolerance: a smaller move of every actuator ends them; step: largest
    move in one; regularisation: what full course costs relative to missing by the robot's length; preload: course that
    it counts from, to which actuators tend where the effectors leave them the choice; damping: what a move by full
    course in one step costs, which keeps redundant actuators from wandering; weights: of effector rows."""

    iterations: PositiveInt = 20
    tolerance: Length = 1e-5
    step: Length = 5.0
    regularisation: float = Field(1e-10, ge=0)
    preload: Length = 0.0
    damping: float = Field(0.0, ge=0)
    weights: list[Annotated[float, Field(ge=0)]] | None = None
    largest_force: Force | None = None
    qp: Literal["daqp", "osqp"] = "daqp"


class ObjectSpec(Spec):
    """A rigid box that robots hold by their contact points. half_size: for pictures, and where its faces are; turns:
    whether it can turn, else it is guided; force: constant, its weight for one.

    law: of its contact with the robots in the plant. `bilateral` glues the points to it; under the others they open,
    and slide, `coulomb` with `friction`. Models go by glue whatever the law."""

    centre: Point
    half_size: Point
    turns: bool = True
    force: ForceVector | None = None
    law: Literal["bilateral", "signorini", "coulomb"] = "bilateral"
    friction: float = Field(0.0, ge=0)


class RobotSpec(Spec):
    """One of several equal robots: the scene's, turned by `rotate` about the origin and then moved by `translate`."""

    name: str = Field(pattern=r"^[A-Za-z0-9_-]+$")
    rotate: Turn | None = None
    translate: Point | None = None


class ControlSpec(Spec):
    """scene, mesh: the robot; models: export folders by name; out: artefact to make; plant: what the commands
    act on, `fem` or `model` (the first model grades itself: for trying out); runtime: of the models; fe_based:
    whether the same control also runs on FE matrices, to fe_tolerance; fewer_iterations: also follow with the
    first model and so few inverse steps a goal, to see what a shorter step costs; pictures: deformed shapes
    kept of each trajectory; reached: a goal counts as reachable where the search ends nearer than this. object: what
    the scene's contact points hold, whose centre then is what follows the goals; robots: that hold it, one where the
    scene stands unless given; updates: of the object's pose at each query of a learned model, as many as it takes to
    balance it unless given. design: values of the models' parameters by their names, '41 mm' or 0.47, of the robot that
    is controlled, the scene's own where left out; goals are told as for the scene's own robot, and move with where the
    effectors rest. loop: control over time instead, tick by tick, open or closed; `pipe` is a plant of it."""

    scene: Path
    mesh: Path
    models: dict[str, Path] = Field(min_length=1)
    out: Path
    plant: Literal["fem", "model", "pipe"] = "fem"
    runtime: Literal["arrays", "onnx"] = "arrays"
    fe_based: bool = True
    fe_tolerance: Length = 1e-3
    trajectories: dict[str, TrajectorySpec] = Field(min_length=1)
    search: SearchSpec = SearchSpec()
    reached: Length = 0.1
    fewer_iterations: list[PositiveInt] = Field(default=[])
    pictures: PositiveInt = 5
    object: ObjectSpec | None = None
    robots: list[RobotSpec] = Field(default=[RobotSpec(name="robot")], min_length=1)
    updates: PositiveInt | None = None
    design: dict[str, Any] = {}
    loop: LoopSpec | None = None

    @model_validator(mode="after")
    def _object_and_fe(self):
        if self.object and (self.plant == "model" or any(t.kind == "image" for t in self.trajectories.values())):
            raise ValueError("an object needs plant: fem and trajectories other than images")
        names = [one.name for one in self.robots]
        if len(set(names)) < len(names):
            raise ValueError(f"names of robots must differ, got {names}")
        return self

    @model_validator(mode="after")
    def _design_alone(self):
        if self.design and (self.object or self.loop or self.runtime == "onnx"):
            raise ValueError("design does not go with an object, a loop or runtime: onnx yet")
        return self

    @model_validator(mode="after")
    def _fe_needs_fe(self):
        if self.plant == "model" and self.fe_based and not self.loop:
            raise ValueError("fe_based needs plant: fem; with plant: model set it to false")
        if self.plant != "fem" and any(t.kind == "image" for t in self.trajectories.values()):
            raise ValueError("an image trajectory needs plant: fem")
        return self

    @model_validator(mode="after")
    def _loop_fits(self):
        loop = self.loop
        if (self.plant == "pipe") != (loop is not None and loop.device is not None):
            raise ValueError("plant: pipe needs loop.device, and loop.device plant: pipe")
        if loop is None:
            return self
        if self.object:
            raise ValueError("a loop takes one robot without an object")
        unknown = {one.model for one in loop.controllers.values()} - {None, FE_BASED, *self.models}
        if unknown:
            raise ValueError(f"loop.controllers: models {sorted(unknown)} are not among {sorted(self.models)}")
        if self.plant != "fem" and (loop.real.scene or loop.real.mesh or loop.real.wall):
            raise ValueError("loop.real.scene, loop.real.mesh and loop.real.wall need plant: fem")
        if self.plant != "model" and loop.real.stiffer != 1:
            raise ValueError("loop.real.stiffer needs plant: model; with plant: fem override the scene's material")
        return self
