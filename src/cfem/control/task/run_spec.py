"""Spec that all runs of `cfem control` share: robot, models, where the result goes, and how goals are searched for.

A kind of run adds keys of its own (`cfem.control.spec`), or narrows those that stand here."""

import math
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, PositiveInt

from cfem.control.task.goals.trajectory_spec import GoalsSpec, TrajectorySpec
from cfem.core.actuator_units import Displacement, Effort
from cfem.core.names import Name
from cfem.core.spec import Spec
from cfem.core.units import Angle, Length
from cfem.predict.loads.spec import LoadSpec

FE_BASED = "fe-based"  # name of the controller that has FE matrices for its model


class SearchSpec(Spec):
    """How the inverse steps approach a goal."""

    iterations: PositiveInt = 20
    """Largest number of inverse steps per goal. Where they miss it, a learned model searches again from eight places
    all over the reach, with as many steps each; not with 1, the paper's."""
    tolerance: Displacement | None = None
    """The steps end when every actuator moves by less. 5e-7 of each actuator's stroke unless given."""
    step: Displacement | None = None
    """Largest move of an actuator in one step. A quarter of each actuator's stroke unless given."""
    regularisation: float = Field(1e-10, ge=0)
    """Cost of a full stroke relative to missing the goal by the robot's length."""
    preload: Displacement = 0.0
    """Displacement to which actuators tend where the effectors leave them the choice."""
    damping: float = Field(0.0, ge=0)
    """Cost of a full stroke in one step. It keeps redundant actuators from wandering."""
    weights: list[Annotated[float, Field(ge=0)]] | None = None
    """Weight of each effector row. Of an object three, or six with its rotation about x, y and z, which counts as the
    way by which it moves a corner of the object. 0 leaves a row free."""
    largest_force: Effort | None = None
    """Largest force of any actuator."""
    cautious: bool = False
    """Whether bounds on effector rows, such as margins to slip, count before a step has met them. Such a search is
    slower, and leaves them less."""
    qp: Literal["active_set", "osqp"] = "active_set"
    """Solver of the quadratic program."""


class RunSpec(Spec):
    """A run of `cfem control` of any kind."""

    scene: Path
    """The robot's scene.yaml."""
    mesh: Path
    """Folder of its mesh."""
    models: dict[Name, Path] = Field(min_length=1)
    """Export folders by name."""
    out: Path
    """Folder for the result."""
    plant: Literal["fem"] = "fem"
    """What the commands act on: fem, the finite-element robot."""
    runtime: Literal["arrays", "onnx"] = "arrays"
    """Runtime of the models."""


class TrackingSpec(RunSpec):
    """A run that follows goals."""

    trajectories: dict[Name, TrajectorySpec] = Field(min_length=1)
    """Goals to follow, by name."""
    search: SearchSpec = SearchSpec()
    """How the inverse steps approach a goal."""

    def check(self) -> None:
        self._something_counts()
        self._only_what_the_robot_has()

    def _something_counts(self) -> None:
        weights = self.search.weights
        if weights is not None and not any(weights):
            what = "search.weights are all 0, so that nothing would be controlled: give one a positive number"
            raise ValueError(what)

    def _only_what_the_robot_has(self) -> None:
        """ValueError where goals state an orientation or a table, which objects alone have, or an image without FE."""
        for name, trajectory in self.trajectories.items():
            if isinstance(trajectory, GoalsSpec):
                trajectory.demand_object(name, turns=False, table=False)
            if trajectory.kind == "image" and self.plant != "fem":
                raise ValueError("an image trajectory needs plant: fem")


class LoadedSpec(TrackingSpec):
    """A run in which constant loads may act on the robot."""

    loads: dict[Name, LoadSpec] = {}
    """Constant loads that the samples did not carry, by the name of the effector, or any name with `at` on a patch of
    the surface: a payload or a push. The model takes them without new samples, and the FE robot carries them. Goals
    stay where they are."""


class FamilySpec(LoadedSpec):
    """A run with one robot of a family that differs in parameters."""

    design: dict[str, Any] = {}
    """Values of the models' parameters by name, '41 mm' or 0.47, of the robot that is controlled. The scene's own where
    left out. Goals move with where the effectors rest."""

    def check(self) -> None:
        super().check()
        if self.design and self.runtime == "onnx":
            raise ValueError("design does not go with runtime: onnx yet")
        if self.loads and (self.design or self.runtime == "onnx"):
            raise ValueError("loads do not go with a design or runtime: onnx yet")


class PlannedSpec(TrackingSpec):
    """Goals that are planned one by one, without a clock, and carried out by the plant."""

    fe_based: bool = False
    """Whether the same control also runs on FE matrices, for comparison. It takes several FE solves per goal."""
    fe_tolerance: Displacement | None = None
    """Tolerance of that control on FE matrices. 5e-5 of each actuator's stroke unless given."""
    reached: Length = Field(0.1, gt=0)
    """A goal is reached where the robot ends nearer than this, with the forces on obstacles that are wanted within 5 %
    of them. It is out of reach where the search by the model ends farther away, and the optimality conditions show that
    no move within the bounds brings the effectors nearer."""
    reached_rotation: Angle = Field(math.radians(0.1), gt=0)
    """A goal that states an orientation is reached where that error is smaller, too."""
    fewer_iterations: list[PositiveInt] = Field(default=[])
    """Also follow with the first model and these numbers of inverse steps per goal, to see what fewer steps cost."""
    pictures: PositiveInt = 60
    """Largest number of deformed shapes kept of each trajectory."""
