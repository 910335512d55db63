"""What control.yaml says of a run in open loop: goals that learned models plan one by one for a robot that is free."""

from typing import Literal

from pydantic import Field, PositiveInt

from cfem.control.task.run_spec import FamilySpec, PlannedSpec
from cfem.core.spec import Spec


class MeshErrorSpec(Spec):
    """How the discretisation error is estimated: some commands are carried out once more on a finer mesh."""

    states: PositiveInt = 3
    """Number of goals whose commands are carried out."""
    cells: float = Field(2.5, ge=1.5, le=8)
    """Cells of the finer mesh relative to the mesh at hand. Eight where the mesh is a file, whose cells are cut."""
    largest: PositiveInt = 60_000
    """No estimate is made where the finer mesh would have more cells."""


class OpenLoopSpec(PlannedSpec, FamilySpec):
    """Goals that learned models plan one by one, and a robot that nothing touches."""

    plant: Literal["fem", "model"] = "fem"
    """What the commands act on: fem, the finite-element robot; model, the first model itself, for trying out."""
    mesh_error: MeshErrorSpec | None = MeshErrorSpec()
    """How the discretisation error is estimated, null to leave it out."""

    def check(self) -> None:
        super().check()
        if self.plant == "model" and self.fe_based:
            raise ValueError("fe_based: needs plant: fem; set it to false with plant: model")
