"""The error of the mesh that a model was sampled on, at any of its states."""

import json
from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import Field

from cfem.core.reading import Data

_Share = Annotated[float, Field(ge=0)]
Bounds = tuple[_Share, _Share]  # the smaller one first


class ErrorShare(Data):
    """Error relative to the quantity that it is the error of, between two bounds.

    rest: where the quantity is small; far: where it is `largest`, in its unit. Between, what the share gains over rest
    goes with the square of the quantity, which is the first power that a robot bent to either side can have."""

    rest: Bounds
    far: Bounds
    largest: float = Field(gt=0)

    def bounds(self, quantity: float) -> tuple[float, float]:
        """Smallest and largest error, in the unit of the quantity."""
        grown = (quantity / self.largest) ** 2
        shares = (near + (far - near) * (grown if far > near else min(grown, 1.0)) for near, far in self._ends)
        low, high = (share * quantity for share in shares)
        return low, high

    @property
    def _ends(self) -> zip:
        return zip(self.rest, self.far, strict=True)

    @property
    def highest(self) -> float:
        """The largest share within the range."""
        return max(self.rest[1], self.far[1])


class MeshError(Data):
    """Estimated distance between the robot on an infinitely fine mesh and the robot on this one, at the same command.

    tip: relative to how far the effectors travel, mm; actuators: of what is not commanded, forces where displacements
    are, and displacements where forces are, relative to the largest actuator's
    states: number of states from which it was estimated; cells, finer_cells: of the two meshes"""

    tip: ErrorShare
    actuators: ErrorShare
    states: int = Field(ge=1)
    cells: int = Field(ge=1)
    finer_cells: int = Field(ge=1)


def mesh_error_of(stated: Mapping[str, Any] | None) -> MeshError | None:
    """Error of the mesh that an artefact states, None where it says nothing."""
    if not stated or "left_out" in stated:
        return None
    return MeshError.model_validate_json(json.dumps(dict(stated)))
