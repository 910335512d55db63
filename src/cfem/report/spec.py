"""What `report.yaml` says: which artefacts the page is about."""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, PositiveFloat, PositiveInt, model_validator

from cfem.core.spec import Spec
from cfem.core.units import Length

Share = Annotated[float, Field(ge=0, le=1)]


class MeshCase(Spec):
    """A mesh: even (size; sizes near refined places shrink in the same proportion) or graded (cells). radius: of all
    attachments, in the place of the scene's; 0 attaches to mathematical points."""

    element: Literal["tet4", "tet10", "tet10p0", "hex8"]
    size: Length | None = None
    cells: int | None = Field(default=None, ge=100)
    radius: Length | None = Field(default=None, ge=0)

    @model_validator(mode="after")
    def _one(self):
        if (self.size is None) == (self.cells is None):
            raise ValueError("a mesh case has a size or a number of cells, one of the two")
        return self


class Discretisation(Spec):
    """Meshes judged by a finer one. poisson: ratios to repeat it at, the scene's own by default; tolerances: of the
    solver, tried on the scene's own mesh; states: shares of a pull on all actuators."""

    cases: list[MeshCase] = Field(min_length=1)
    reference: MeshCase
    poisson: list[Annotated[float, Field(ge=0, lt=0.5)]] = []
    tolerances: list[PositiveFloat] = []
    states: list[list[Share]] = Field(min_length=1)


class Published(Spec):
    """Figures from the literature to stand beside ours; each optional."""

    source: str
    samples: PositiveInt | None = None
    loss: PositiveFloat | None = None
    query_us: PositiveFloat | None = None
    tracking_percent: PositiveFloat | None = None


class ReportSpec(Spec):
    """scene: what the page is about; mesh, samples, control: artefacts of the stages; models: folders of `cfem train`
    by name; discretisation: a study of meshes. A page holds what is given."""

    scene: Path
    mesh: Path | None = None
    samples: Path | None = None
    models: dict[str, Path] = {}
    control: Path | None = None
    out: Path
    discretisation: Discretisation | None = None
    published: Published | None = None

    @model_validator(mode="after")
    def _whole(self):
        artefacts = {"mesh": self.mesh, "samples": self.samples, "models": self.models, "control": self.control}
        lacking = [name for name, value in artefacts.items() if not value]
        if 0 < len(lacking) < len(artefacts):
            raise ValueError(f"a page on a learned model needs {', '.join(artefacts)}; {', '.join(lacking)} lacks")
        if lacking and self.discretisation is None:
            raise ValueError("nothing to report: give artefacts, a discretisation, or both")
        return self
