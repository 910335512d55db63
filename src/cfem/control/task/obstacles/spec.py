"""Spec of a robot that meets obstacles: which they are, and how its surface touches."""

from pathlib import Path
from typing import Literal

from pydantic import Field

from cfem.control.task.run_spec import LoadedSpec, PlannedSpec
from cfem.core.names import Name
from cfem.predict.contact.obstacle_spec import ContactSpec, MeshObstacle, ObstacleSpec, RobotObstacle


class StatedContactSpec(ContactSpec):
    """Contact of the robot's surface, and the error that is stated of it."""

    error_places: int = Field(40, ge=0, le=1000)
    """Random places at which finite elements touch one rigid obstacle, at half of them, or two or three, once for each
    model and friction. Errors of the model's forces and tip there give the bounds that the run states, of 95 % from 19
    places of each half on, of soft obstacles too, but for patches. 0 states none."""


class ObstaclesSpec(PlannedSpec, LoadedSpec):
    """Goals of a robot that touches, presses or avoids obstacles on its way."""

    plant: Literal["fem", "model"] = "fem"
    """What the commands act on: fem, the finite-element robot; model, the first model itself, for trying out."""
    runtime: Literal["arrays"] = "arrays"
    """Runtime of the models."""
    fe_based: bool = Field(False, json_schema_extra={"const": False})
    """Control by FE matrices does not know obstacles."""
    obstacles: dict[Name, ObstacleSpec] = Field(min_length=1)
    """What the robot meets, by name: rigid bodies, other soft robots, itself. Plans know them: they touch, press or
    avoid them with any part of the surface, and the FE robot meets the same."""
    contact: StatedContactSpec = StatedContactSpec()
    """How the robot's surface touches."""

    def check(self) -> None:
        """Checks which keys go together."""
        super().check()
        if self.fe_based:
            raise ValueError("obstacles need fe_based: false")
        itself = [name for name, obstacle in self.obstacles.items() if obstacle.kind == "itself"]
        if len(itself) > 1:
            raise ValueError(f"obstacles: {' and '.join(itself)} are both the robot itself; leave one of them out")

    @property
    def at_nodes(self) -> bool:
        """True where the robot touches at every node of its surface, False where it does by patches."""
        return not self.contact.of_patches

    @property
    def error_places(self) -> int:
        """Places at which the error of the contact is calibrated: none where soft surfaces meet by patches, whose pairs
        come and go at edges."""
        soft = any(obstacle.kind in ("robot", "itself") for obstacle in self.obstacles.values())
        return 0 if soft and not self.at_nodes else self.contact.error_places

    @property
    def files(self) -> dict[str, Path]:
        """Files and model folders that obstacles are read from, by the obstacle's name, relative to this spec."""
        named = {name: item.file for name, item in self.obstacles.items() if isinstance(item, MeshObstacle)}
        return named | {name: item.model for name, item in self.obstacles.items() if isinstance(item, RobotObstacle)}

    @property
    def scenes(self) -> dict[str, Path]:
        """Scenes of soft obstacles that are not the robot's own, by the obstacle's name, relative to this spec."""
        robots = {name: item for name, item in self.obstacles.items() if isinstance(item, RobotObstacle)}
        return {name: item.scene for name, item in robots.items() if item.scene}

    def _something_counts(self) -> None:
        if not any(obstacle.press for obstacle in self.obstacles.values()):
            super()._something_counts()
