"""What `control.yaml` says: which models follow which trajectories, against what."""

import math
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, PositiveInt

from cfem.control.closed_loop_spec import LoopSpec
from cfem.control.crawling.spec import GaitSpec
from cfem.control.trajectory_spec import TrajectorySpec
from cfem.core.actuator_units import Displacement, Effort
from cfem.core.names import Name
from cfem.core.spec import Spec
from cfem.core.units import Angle, ForceVector, Length, Point
from cfem.predict.load_spec import LoadSpec
from cfem.predict.obstacle_spec import ContactSpec, ObstacleSpec
from cfem.robot.geometry import Turn

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


class MeshErrorSpec(Spec):
    """How the discretisation error is estimated: some commands are carried out once more on a finer mesh."""

    states: PositiveInt = 3
    """Number of goals whose commands are carried out."""
    cells: float = Field(2.5, ge=1.5, le=8)
    """Cells of the finer mesh relative to the mesh at hand. Eight where the mesh is a file, whose cells are cut."""
    largest: PositiveInt = 60_000
    """No estimate is made where the finer mesh would have more cells."""


class ObjectSpec(Spec):
    """A rigid box that robots hold by their contact points."""

    centre: Point
    """Centre of the box."""
    half_size: Point
    """Half of its edges along x, y and z."""
    turns: bool = True
    """Whether the box can turn. It is guided otherwise."""
    force: ForceVector | None = None
    """Constant force on it, such as its weight. Robots that only touch it take it over after they have grasped."""
    law: Literal["bilateral", "signorini", "coulomb"] = "bilateral"
    """Contact in plans and plant. bilateral glues the points to the box; signorini lets them open and slide; coulomb
    adds friction."""
    friction: float = Field(0.0, ge=0)
    """Coefficient of friction."""
    margin: float | None = Field(None, ge=1)
    """Least margin to slip that plans keep: the friction that each robot's normal force allows over what it uses."""
    balanced: bool = False
    """Whether robots share search.preload so that they do not push the box aside. All actuators have it otherwise."""
    table: bool = False
    """Whether the box stands on a table, with the side that `force` points to. The robots squeeze it there, lift it,
    and put it back where a goal is on the table. Plans and plant know the table."""

    def check(self) -> None:
        if self.table and (self.law != "coulomb" or self.force is None or not any(self.force)):
            raise ValueError("table: robots lift a box from it by friction: give law: coulomb and force, its weight")


class RobotSpec(Spec):
    """One of several equal robots: the scene's, turned about the origin and then moved."""

    name: str = Field(pattern=r"^[A-Za-z0-9_-]+$")
    """Name of this robot."""
    rotate: Turn | None = None
    """Rotation about the origin."""
    translate: Point | None = None
    """Movement after the rotation."""


class ControlSpec(Spec):
    """Which models follow which trajectories, in which plant."""

    scene: Path
    """The robot's scene.yaml."""
    mesh: Path
    """Folder of its mesh."""
    models: dict[Name, Path] = Field(min_length=1)
    """Export folders by name."""
    out: Path
    """Folder for the result."""
    plant: Literal["fem", "model", "pipe"] = "fem"
    """What the commands act on: fem, the finite-element robot; model, the first model itself, for trying out; pipe,
    your own device."""
    runtime: Literal["arrays", "onnx"] = "arrays"
    """Runtime of the models."""
    fe_based: bool = False
    """Whether the same control also runs on FE matrices, for comparison. It takes several FE solves per goal."""
    fe_tolerance: Displacement | None = None
    """Tolerance of that control on FE matrices. 5e-5 of each actuator's stroke unless given."""
    trajectories: dict[Name, TrajectorySpec] = {}
    """Goals to follow, by name. At least one, or a gait."""
    search: SearchSpec = SearchSpec()
    """How the inverse steps approach a goal."""
    reached: Length = 0.1
    """A goal is reached where the robot ends nearer than this, with the forces on obstacles that are wanted within 5 %
    of them. It is out of reach where the search by the model ends farther away, and the optimality conditions show that
    no move within the bounds brings the effectors nearer."""
    reached_rotation: Angle = math.radians(0.1)
    """A goal that states an orientation is reached where that error is smaller, too."""
    mesh_error: MeshErrorSpec | None = MeshErrorSpec()
    """How the discretisation error is estimated, null to leave it out."""
    fewer_iterations: list[PositiveInt] = Field(default=[])
    """Also follow with the first model and these numbers of inverse steps per goal, to see what fewer steps cost."""
    pictures: PositiveInt = 60
    """Largest number of deformed shapes kept of each trajectory."""
    object: ObjectSpec | None = None
    """What the scene's contact points hold. Its centre then follows the goals."""
    robots: list[RobotSpec] = Field(default=[RobotSpec(name="robot")], min_length=1)
    """Robots that hold the object. One, where the scene stands, unless given."""
    updates: PositiveInt | None = None
    """Updates of the object's pose at each query of a learned model. As many as balance needs unless given."""
    design: dict[str, Any] = {}
    """Values of the models' parameters by name, '41 mm' or 0.47, of the robot that is controlled. The scene's own where
    left out. Goals move with where the effectors rest."""
    loads: dict[Name, LoadSpec] = {}
    """Constant loads that the samples did not carry, by the name of the effector, or any name with `at` on a patch of
    the surface: a payload or a push. The model takes them without new samples, and the FE robot carries them. Goals
    stay where they are."""
    obstacles: dict[Name, ObstacleSpec] = {}
    """What the robot meets, by name: rigid bodies, other soft robots, itself. Plans know them: they touch, press or
    avoid them with any part of the surface, and the FE robot meets the same."""
    contact: ContactSpec = ContactSpec()
    """How the robot's surface touches."""
    loop: LoopSpec | None = None
    """Control over time instead, tick by tick."""
    gait: GaitSpec | None = None
    """A crawler instead: `robots` are its legs, whose effectors touch the ground."""

    def check(self) -> None:
        self._trajectories_or_gait()
        self._something_counts()
        self._object_and_fe()
        self._design_alone()
        self._loads_alone()
        self._obstacles_alone()
        self._fe_needs_fe()
        self._loop_fits()

    def _trajectories_or_gait(self) -> None:
        if bool(self.trajectories) == (self.gait is not None):
            raise ValueError("expected trajectories to follow, or a gait")
        if self.gait:
            others = {"object": self.object, "obstacles": self.obstacles, "loads": self.loads, "design": self.design}
            unused = [key for key, value in (others | {"loop": self.loop}).items() if value]
            if unused or self.plant != "fem" or len(self.models) > 1:
                raise ValueError(
                    f"a gait takes one model and plant: fem; leave out {', '.join(unused) or 'the others'}"
                )
            unknown = set(self.gait.mirrored) - {one.name for one in self.robots}
            if unknown:
                raise ValueError(f"gait.mirrored: {sorted(unknown)} are not among the robots")

    def _something_counts(self) -> None:
        weights, pressed = self.search.weights, any(getattr(one, "press", None) for one in self.obstacles.values())
        if weights is not None and not any(weights) and not pressed:
            raise ValueError(
                "search.weights are all 0, so that nothing would be controlled: give one a positive number"
            )

    def _object_and_fe(self) -> None:
        if self.object and (self.plant == "model" or any(t.kind == "image" for t in self.trajectories.values())):
            raise ValueError("an object needs plant: fem and trajectories other than images")
        touched = self.object and self.object.law != "bilateral"
        if touched and (self.fe_based or self.fewer_iterations or len(self.models) > 1 or self.updates):
            raise ValueError(f"object.law: {self.object.law} takes one model, fe_based: false, and no fewer_iterations")
        if self.object and self.object.margin is not None and self.object.law != "coulomb":
            raise ValueError("object.margin needs object.law: coulomb")
        turned = [name for name, one in self.trajectories.items() if getattr(one, "rotation", None) is not None]
        if turned and not (self.object and self.object.turns):
            raise ValueError(f"trajectories.{turned[0]}.rotation: only an object has one, with object.turns: true")
        opens = [name for name, one in self.trajectories.items() if getattr(one, "let_go", False)]
        if opens and not (self.object and self.object.table):
            raise ValueError(f"trajectories.{opens[0]}.let_go: robots let an object go on its table: give object.table")
        names = [one.name for one in self.robots]
        if len(set(names)) < len(names):
            raise ValueError(f"names of robots must differ, got {names}")

    @property
    def oriented(self) -> bool:
        """Whether the object's orientation is controlled: a goal states it, or a weight asks for it."""
        stated = any(getattr(one, "rotation", None) is not None for one in self.trajectories.values())
        return stated or bool(self.object and self.object.turns and len(self.search.weights or []) == 6)

    def _design_alone(self) -> None:
        if self.design and (self.object or self.runtime == "onnx"):
            raise ValueError("design does not go with an object or runtime: onnx yet")
        if self.design and self.loop and (self.loop.moving or any(one.moves for one in self.loop.controllers.values())):
            raise ValueError("design does not go with a loop that moves yet")
        if self.design and self.loop and self.loop.estimate:
            raise ValueError("design does not go with loop.estimate yet")
        if self.design and self.loop and any(one.adapt for one in self.loop.controllers.values()):
            raise ValueError("design states what adapt would find: leave one of them out")

    def _loads_alone(self) -> None:
        if self.loads and (self.object or self.design or self.runtime == "onnx"):
            raise ValueError("loads do not go with an object, a design or runtime: onnx yet")

    def _obstacles_alone(self) -> None:
        if self.obstacles and (self.object or self.design or self.loop or self.runtime == "onnx"):
            raise ValueError("obstacles do not go with an object, a design, a loop or runtime: onnx yet")
        if self.obstacles and (self.fe_based or self.plant == "pipe"):
            raise ValueError("obstacles need fe_based: false, and plant: fem or model")
        own = [name for name, one in self.obstacles.items() if one.kind == "itself"]
        if len(own) > 1:
            raise ValueError(f"obstacles: {' and '.join(own)} are both the robot itself; leave one of them out")

    def _fe_needs_fe(self) -> None:
        if self.plant == "model" and self.fe_based and not self.loop:
            raise ValueError("fe_based: needs plant: fem; set it to false with plant: model")
        if self.plant != "fem" and any(t.kind == "image" for t in self.trajectories.values()):
            raise ValueError("an image trajectory needs plant: fem")

    def _loop_fits(self) -> None:
        loop = self.loop
        if (self.plant == "pipe") != (loop is not None and loop.device is not None):
            raise ValueError("plant: pipe needs loop.device, and loop.device plant: pipe")
        if loop is None:
            return
        if self.object:
            raise ValueError("a loop takes one robot without an object")
        unknown = {one.model for one in loop.controllers.values()} - {None, FE_BASED, *self.models}
        if unknown:
            raise ValueError(f"loop.controllers: models {sorted(unknown)} are not among {sorted(self.models)}")
        if self.plant != "fem" and (loop.real.scene or loop.real.mesh or loop.real.wall):
            raise ValueError("loop.real.scene, loop.real.mesh and loop.real.wall need plant: fem")
        if self.plant != "model" and loop.real.viscosity != 1:
            raise ValueError("loop.real.viscosity needs plant: model; with plant: fem override the scene's material")
        if self.plant == "pipe" and loop.moving:
            raise ValueError("a device moves as it does: leave out loop.moving with plant: pipe")
        if loop.live and (self.loads or self.plant == "model" or self.runtime == "onnx"):
            raise ValueError("loop.live needs plant: fem or pipe and runtime: arrays, and does not go with loads")
        if loop.estimate is not None and self.plant == "model":
            raise ValueError("loop.estimate needs plant: fem or pipe, which has markers")
        if loop.estimate is not None and self.plant == "pipe" and (loop.estimate.lost or loop.estimate.wrong):
            raise ValueError("loop.estimate: a device loses markers as it does; leave out lost and wrong")
        if self.plant != "model" and loop.real.stiffer != 1:
            raise ValueError("loop.real.stiffer needs plant: model; with plant: fem override the scene's material")
