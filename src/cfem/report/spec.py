"""What `report.yaml` says: which artefacts the page is about."""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, PositiveFloat, PositiveInt

from cfem.core.spec import Spec
from cfem.core.units import Length


class MeshCase(Spec):
    """One row of the discretisation study; sizes near refined places shrink in the same proportion."""

    element: Literal["tet4", "tet10", "tet10p0"]
    size: Length


class Published(Spec):
    """Figures from the literature to stand beside ours; each optional."""

    source: str
    samples: PositiveInt | None = None
    loss: PositiveFloat | None = None
    query_us: PositiveFloat | None = None
    tracking_percent: PositiveFloat | None = None


class ReportSpec(Spec):
    """scene, mesh, samples, control: artefacts of the stages; models: folders of `cfem train` by name;
    discretisation: meshes to compare with the finest of them, none by default."""

    scene: Path
    mesh: Path
    samples: Path
    models: dict[str, Path] = Field(min_length=1)
    control: Path
    out: Path
    discretisation: list[MeshCase] = Field(default=[])
    discretisation_states: list[list[Annotated[float, Field(ge=0, le=1)]]] = Field(default=[])
    published: Published | None = None
