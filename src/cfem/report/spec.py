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


class SurrogateScene(Spec):
    """Models of one robot to compare. models: folders of `cfem train` by name; default: the one that users get unless
    they ask for another; samples: the dataset whose test states judge whether a flagged query deserves its flag;
    beyond: one whose states out of the actuators' reach serve the same end."""

    models: dict[str, Path] = Field(min_length=1)
    default: str | None = None
    samples: Path | None = None
    beyond: Path | None = None
    published: Published | None = None

    @model_validator(mode="after")
    def _default_is_known(self):
        if self.default is not None and self.default not in self.models:
            raise ValueError(f"default: '{self.default}' is none of the models {', '.join(self.models)}")
        return self


class SizedMesh(Spec):
    """One mesh of the same robot: the artefact, a model of its samples, and control of it."""

    mesh: Path
    model: Path
    control: Path
    published: Published | None = None


class ReportSpec(Spec):
    """scene: what the page is about; mesh, samples, control: artefacts of the stages; models: folders of `cfem train`
    by name; discretisation: a study of meshes. surrogates: models of several robots by the robots' names; sampling:
    folders of `cfem train` by method of sampling and model, to compare methods; meshes: models and control of one robot
    by mesh. loops: artefacts of `cfem control` with a loop, by a name. A page holds what is given."""

    scene: Path | None = None
    mesh: Path | None = None
    samples: Path | None = None
    models: dict[str, Path] = {}
    control: Path | None = None
    out: Path
    discretisation: Discretisation | None = None
    published: Published | None = None
    surrogates: dict[str, SurrogateScene] = {}
    sampling: dict[str, dict[str, list[Path]]] = {}
    meshes: dict[str, SizedMesh] = {}
    loops: dict[str, Path] = {}

    @model_validator(mode="after")
    def _whole(self):
        artefacts = {"mesh": self.mesh, "samples": self.samples, "models": self.models, "control": self.control}
        lacking = [name for name, value in artefacts.items() if not value]
        if 0 < len(lacking) < len(artefacts):
            raise ValueError(f"a page on a learned model needs {', '.join(artefacts)}; {', '.join(lacking)} lacks")
        if self.scene is None and (self.discretisation or not lacking):
            raise ValueError("missing key 'scene': whose artefacts are these?")
        if lacking and not (self.discretisation or self.surrogates or self.sampling or self.meshes or self.loops):
            raise ValueError("nothing to report: give artefacts, a discretisation, surrogates, a study or loops")
        return self
