"""What control.yaml says of a crawler: one model, its legs, and the gait that is found for them."""

from pydantic import Field

from cfem.control.crawling.spec import GaitSpec
from cfem.control.holding.spec import RobotSpec, demand_names
from cfem.control.run_spec import RunSpec
from cfem.core.units import Length


class CrawlingSpec(RunSpec):
    """A crawler: a gait is found on the learned model of a leg, and finite elements walk it."""

    gait: GaitSpec
    """The gait to find."""
    robots: list[RobotSpec] = Field(default=[RobotSpec(name="robot")], min_length=1)
    """The legs: the scene's robot at several places, whose effectors touch the ground."""
    reached: Length = 0.1
    """A command is carried out as planned where the base ends nearer than this to where the plan has it."""

    def check(self) -> None:
        if len(self.models) > 1:
            raise ValueError(f"models: a gait takes one model, got {len(self.models)}")
        unknown = set(self.gait.mirrored) - {robot.name for robot in self.robots}
        if unknown:
            raise ValueError(f"gait.mirrored: {sorted(unknown)} are not among the robots")
        demand_names(self.robots)
