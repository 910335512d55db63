"""Spec of an object and of the robots that hold it."""

from typing import Literal

from pydantic import Field, PositiveInt

from cfem.control.task.goals.trajectory_spec import GoalsSpec
from cfem.control.task.run_spec import PlannedSpec
from cfem.core.spec import Spec
from cfem.core.units import ForceVector, Point
from cfem.robot.geometry import Turn


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


class HoldingSpec(PlannedSpec):
    """Goals of an object that one or several equal robots hold by their contact points."""

    object: ObjectSpec
    """What the scene's contact points hold. Its centre then follows the goals."""
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
