"""Spec of `report.yaml`: which artefacts the page is about."""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, PositiveFloat, PositiveInt

from cfem.core.names import Label
from cfem.core.spec import Spec
from cfem.core.units import Length

Share = Annotated[float, Field(ge=0, le=1)]


class MeshCase(Spec):
    """A mesh: even (size; sizes near refined places shrink in the same proportion) or graded (cells)."""

    element: Literal["tet4", "tet10", "tet10p0", "hex8"]
    """Type of the elements."""
    size: Length | None = Field(default=None, gt=0)
    """Largest size of a cell."""
    cells: int | None = Field(default=None, ge=100)
    """About how many tetrahedra, graded."""
    radius: Length | None = Field(default=None, ge=0)
    """Radius of all attachments instead of the scene's; 0 attaches to mathematical points."""

    def check(self) -> None:
        if (self.size is None) == (self.cells is None):
            raise ValueError("a mesh case needs either a size or a number of cells")


class Discretisation(Spec):
    """A study of meshes, judged by a finer one."""

    cases: list[MeshCase] = Field(min_length=1)
    """Meshes to judge."""
    reference: MeshCase
    """The finer mesh."""
    poisson: list[Annotated[float, Field(ge=0, lt=0.5)]] = []
    """Poisson's ratios to repeat the study at. The scene's own unless given."""
    tolerances: list[PositiveFloat] = []
    """Tolerances of the solver, tried on the scene's own mesh."""
    states: list[list[Share]] = Field(min_length=1)
    """States to solve: shares of a pull on all actuators."""


class Published(Spec):
    """Figures from the literature to show beside ours."""

    source: str
    """Where the figures come from."""
    samples: PositiveInt | None = None
    """Number of training samples."""
    loss: PositiveFloat | None = None
    """Loss of the model."""
    query_us: PositiveFloat | None = None
    """Time of one query in microseconds."""


class SurrogateScene(Spec):
    """Models of one robot to compare."""

    models: dict[Label, Path] = Field(min_length=1)
    """Folders of `cfem train` by name."""
    default: str | None = None
    """The model that users get unless they ask for another."""
    samples: Path | None = None
    """Dataset whose test states judge whether a flagged query deserves its flag."""
    beyond: Path | None = None
    """Dataset whose states lie out of the actuators' reach, for the same purpose."""
    published: Published | None = None
    """Figures from the literature."""

    def check(self) -> None:
        if self.default is not None and self.default not in self.models:
            raise ValueError(f"default: '{self.default}' is none of the models {', '.join(self.models)}")


class SizedMesh(Spec):
    """One mesh of the same robot."""

    mesh: Path
    """Folder of the mesh."""
    model: Path
    """Folder of a model of its samples."""
    control: Path
    """Folder of a control run with it."""
    published: Published | None = None
    """Figures from the literature."""


class ReportSpec(Spec):
    """Which artefacts the page shows. It holds what is given."""

    scene: Path | None = None
    """The robot's scene.yaml."""
    mesh: Path | None = None
    """Folder of its mesh."""
    samples: Path | None = None
    """Folder of its dataset."""
    models: dict[Label, Path] = {}
    """Folders of `cfem train` by name."""
    control: Path | None = None
    """Folder of `cfem control`."""
    page: Path | None = None
    """Folder of `cfem export` with format html: its page of the robot is put beside the report, and linked."""
    out: Path
    """Folder for the page."""
    discretisation: Discretisation | None = None
    """A study of meshes."""
    published: Published | None = None
    """Figures from the literature."""
    surrogates: dict[Label, SurrogateScene] = {}
    """Models of several robots by the robots' names."""
    sampling: dict[Label, dict[Label, list[Path]]] = {}
    """Folders of `cfem train` by method of sampling and model, to compare methods."""
    meshes: dict[Label, SizedMesh] = {}
    """Models and control of one robot by mesh."""
    loops: dict[Label, Path] = {}
    """Folders of `cfem control` with a loop, by name."""
    moving: dict[Label, Path] = {}
    """Folders of `cfem train` whose models move, by name: their natural frequencies and damping along the workspace.
    Of `models` that move, the page shows them without being asked."""

    def check(self) -> None:
        """Checks that the artefacts of a page are complete."""
        artefacts = {"mesh": self.mesh, "samples": self.samples, "models": self.models, "control": self.control}
        lacking = [name for name, value in artefacts.items() if not value]
        if 0 < len(lacking) < len(artefacts):
            raise ValueError(f"a page on a learned model needs {', '.join(artefacts)}; {', '.join(lacking)} lacks")
        if self.page and lacking:
            raise ValueError("page: it is linked beside the robot: give scene, mesh, samples, models and control too")
        if self.scene is None and (self.discretisation or not lacking):
            raise ValueError("missing key 'scene': whose artefacts are these?")
        studies = (self.discretisation, self.surrogates, self.sampling, self.meshes, self.loops, self.moving)
        if lacking and not any(studies):
            raise ValueError(
                "nothing to report: give artefacts, a discretisation, surrogates, a study, loops or moving"
            )
