"""Spec of a run in open loop: goals that learned models plan one by one for a robot that is free."""

from typing import Any, Literal

from pydantic import field_validator

from cfem.control.task.run_spec import FamilySpec, PlannedSpec
from cfem.robot.mesh.error_spec import MeshErrorSpec


class OpenLoopSpec(PlannedSpec, FamilySpec):
    """Goals that learned models plan one by one, and a robot that nothing touches."""

    plant: Literal["fem", "model"] = "fem"
    """What the commands act on: fem, the finite-element robot; model, the first model itself, for trying out."""
    mesh_error: MeshErrorSpec | None = MeshErrorSpec()
    """How the error of the mesh is estimated from goals' commands, null to leave it out."""

    @field_validator("plant", mode="before")
    @classmethod
    def _device_has_a_loop(cls, plant: Any) -> Any:
        if plant == "device":
            raise ValueError("device needs `loop`, with `loop.device`")
        return plant

    def check(self) -> None:
        super().check()
        if self.plant == "model" and self.fe_based:
            raise ValueError("fe_based: needs plant: fem; set it to false with plant: model")
