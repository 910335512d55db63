"""Spec of an object and of the robots that hold it."""

from pathlib import Path
from typing import Literal

from pydantic import Field, PositiveInt

from cfem.control.task.goals.trajectory_spec import GoalsSpec
from cfem.control.task.run_spec import PlannedSpec
from cfem.core.spec import Spec
from cfem.core.units import ForceVector, Length, Point
from cfem.robot.geometry import Turn


class ObjectSpec(Spec):
    """A rigid body that robots hold: a box, a ball, a cylinder, or any closed body of a file."""

    centre: Point
    """Centre of mass of the object where it begins. The body of a file has the centroid of its volume there."""
    half_size: Point | None = None
    """Half of the edges of a box, along its own x, y and z."""
    radius: Length | None = Field(None, gt=0)
    """Radius of a ball, or of a cylinder."""
    half_length: Length | None = Field(None, gt=0)
    """Half of the length of a cylinder, along its own z."""
    file: Path | None = None
    """STL file of a closed body, relative to this file."""
    unit: Length = Field(1.0, gt=0)
    """Length of one unit of the file."""
    rotate: Turn | None = None
    """Rotation of the body about its centre, as it begins."""
    turns: bool = True
    """Whether the object can turn. It is guided otherwise."""
    force: ForceVector | None = None
    """Constant force on it, such as its weight. Robots that only touch it take it over after they have grasped."""
    law: Literal["bilateral", "signorini", "coulomb"] = "bilateral"
    """Contact in plans and plant. bilateral glues the scene's contact points to it; signorini lets them open and slide;
    coulomb adds friction. Robots without contact points hold it by friction, with all of their surface."""
    friction: float = Field(0.0, ge=0)
    """Coefficient of friction."""
    margin: float | None = Field(None, ge=1)
    """Least margin to slip that plans keep: the friction that each robot's normal force allows over what it uses."""
    balanced: bool = False
    """Whether robots share search.preload so that they do not push the object aside, else all have it alike."""
    table: bool = False
    """Whether the object stands on a table, with the side that `force` points to. The robots squeeze it there, lift it,
    and put it back where a goal is on the table. Plans and plant know the table."""

    def check(self) -> None:
        """Checks that the object has one shape, and that robots can lift it where it stands on a table."""
        if sum(shape is not None for shape in (self.half_size, self.radius, self.file)) != 1:
            raise ValueError("give half_size of a box, radius of a ball or cylinder, or file of a body, one of these")
        if self.half_length is not None and self.radius is None:
            raise ValueError("half_length is that of a cylinder: give its radius")
        if self.half_size is not None and min(self.half_size) <= 0:
            raise ValueError("half_size: all three must be above 0")
        if self.table and (self.law != "coulomb" or self.force is None or not any(self.force)):
            raise ValueError(
                "table: robots lift an object from it by friction: give law: coulomb and force, its weight"
            )


class RobotSpec(Spec):
    """One of several equal robots: the scene's, turned about the origin and then moved."""

    name: str = Field(pattern=r"^[A-Za-z0-9_-]+$")
    """Name of this robot."""
    rotate: Turn | None = None
    """Rotation about the origin."""
    translate: Point | None = None
    """Movement after the rotation."""


class HoldingSpec(PlannedSpec):
    """Goals of an object that one or several equal robots hold, by the scene's contact points where models were sampled
    with these, else by any point of their surface."""

    object: ObjectSpec
    """What they hold. Its centre then follows the goals."""
    robots: list[RobotSpec] = Field(default=[RobotSpec(name="robot")], min_length=1)
    """Robots that hold the object. One, where the scene stands, unless given."""
    updates: PositiveInt | None = None
    """Updates of the object's pose at each query of a learned model. As many as balance needs unless given."""

    def check(self) -> None:
        super().check()
        touched = self.object.law != "bilateral"
        if touched and (self.fe_based or self.fewer_iterations or len(self.models) > 1 or self.updates):
            raise ValueError(f"object.law: {self.object.law} takes one model, fe_based: false, and no fewer_iterations")
        if self.object.margin is not None and self.object.law != "coulomb":
            raise ValueError("object.margin needs object.law: coulomb")
        demand_names(self.robots)

    def _only_what_the_robot_has(self) -> None:
        for name, trajectory in self.trajectories.items():
            if trajectory.kind == "image":
                raise ValueError(f"trajectories.{name}: an object needs goals other than an image")
            if isinstance(trajectory, GoalsSpec):
                trajectory.demand_object(name, self.object.turns, self.object.table)

    @property
    def oriented(self) -> bool:
        """True where the object's orientation is controlled: a goal states it, or a weight asks for it."""
        goals = [item for item in self.trajectories.values() if isinstance(item, GoalsSpec)]
        weighed = self.object.turns and len(self.search.weights or []) == 6
        return weighed or any(item.rotation is not None for item in goals)


def demand_names(robots: list[RobotSpec]) -> None:
    """ValueError where two robots have one name."""
    names = [robot.name for robot in robots]
    if len(set(names)) < len(names):
        raise ValueError(f"names of robots must differ, got {names}")
