"""The shapes that a robot may have: from the catalogue, from a file, or several of these placed side by side."""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, PositiveInt, field_validator

from cfem.core.spec import Spec
from cfem.core.units import Angle, Length, Point, Points
from cfem.robot.catalogue.bar import Bar
from cfem.robot.catalogue.bellows import Bellows
from cfem.robot.catalogue.diamond import Diamond
from cfem.robot.catalogue.fin_ray import FinRay
from cfem.robot.catalogue.pneunet import PneuNet
from cfem.robot.catalogue.pneunet_trunk import PneuNetTrunk
from cfem.robot.catalogue.soft_finger import SoftFinger
from cfem.robot.catalogue.stiff_flop import StiffFlop
from cfem.robot.catalogue.taper import Taper
from cfem.robot.catalogue.trunk import Trunk
from cfem.robot.catalogue.tube import Tube
from cfem.robot.selection import Direction

SURFACES = (".stl", ".obj", ".3mf", ".ply", ".off")  # files of triangles alone


class MeshFile(Spec):
    """The user's own mesh of tetrahedra or hexahedra (.vtu, .vtk, .msh, .inp), or a closed surface that is meshed here
    (.stl, .obj, .3mf, .ply, .off)."""

    kind: Literal["mesh-file"]
    """A mesh or surface from a file."""
    path: Path
    """The file, relative to this spec."""
    unit: Length = Field(default=1.0, gt=0)
    """Size of one unit of the file's numbers, such as '1 mm' or '25.4 mm'. A .3mf is in mm here, whatever unit it
    states."""
    remesh: bool = False
    """Whether only the surface of the file's mesh counts, and its inside is meshed anew. Files of triangles alone are
    meshed in any case."""
    body: PositiveInt = 1
    """Which of several bodies that surfaces in the file bound, the largest first."""

    def check(self) -> None:
        if self.body > 1 and not self.meshed_here:
            raise ValueError("body chooses among surfaces: add remesh: true")

    @property
    def meshed_here(self) -> bool:
        """True if the file's surface is meshed anew; False if the file's own cells are used."""
        return self.remesh or self.path.suffix.lower() in SURFACES


class StepFile(Spec):
    """A body in a STEP or BREP file: a solid, or several that touch. Then solid-1, solid-2, ... name the cells of each,
    in the order of the file, as in a region of `materials`."""

    kind: Literal["step"]
    """A solid from a STEP (.step, .stp) or BREP (.brep, .brp) file."""
    path: Path
    """The file, relative to this spec."""
    unit: Length | None = Field(default=None, gt=0)
    """Size of one unit of a BREP file's numbers, 1 mm unless given. A STEP file states its own units."""

    def check(self) -> None:
        if self.unit is not None and self.path.suffix.lower() not in (".brep", ".brp"):
            raise ValueError("unit: a STEP file states its own units, leave it out")


# the catalogue
Body = SoftFinger | Bar | Diamond | Trunk | Taper | StiffFlop | PneuNet | PneuNetTrunk | Bellows | Tube | FinRay
Single = Body | MeshFile | StepFile


class Refinement(Spec):
    """A finer mesh size within a box."""

    corners: Points
    """Two opposite corners of the box."""
    size: Length = Field(gt=0)
    """Largest size of a cell in the box."""
    blend: Length = Field(default=6.0, ge=0)
    """Distance over which the size grows to that of the rest."""


class Turn(Spec):
    """A rotation about a line through the origin, by the right-hand rule."""

    axis: Direction
    """Direction of the line."""
    angle: Angle
    """Angle of the rotation."""


class Part(Spec):
    """One body of several. Its geometry is turned by `rotate` about its own origin, then moved by `translate`."""

    name: str = Field(pattern=r"^[A-Za-z0-9_-]+$")
    """Name of the part, and of its cells, nodes and facets."""
    geometry: Annotated[Single, Field(discriminator="kind")]
    """Shape of the part."""
    rotate: Turn | None = None
    """Rotation about the part's own origin."""
    translate: Point | None = None
    """Movement after the rotation."""
    size: Annotated[Length, Field(gt=0)] | None = None
    """Largest size of a cell of this part, instead of mesh.size."""
    refine: list[Refinement] = []
    """Boxes of finer tetrahedra, in the part's own coordinates before it is placed."""


class Assembly(Spec):
    """Several bodies, each meshed on its own. A set `end` of a part's mesh file is named `part.end`. Parts that touch
    are not joined, unless a rigid group joins them."""

    kind: Literal["assembly"]
    """Several bodies."""
    parts: list[Part] = Field(min_length=1)
    """The bodies."""

    @field_validator("parts")
    @classmethod
    def _distinct(cls, parts: list[Part]) -> list[Part]:
        names = [part.name for part in parts]
        if len(set(names)) < len(names):
            raise ValueError(f"names of parts must differ, got {names}")
        return parts


Geometry = Annotated[Single | Assembly, Field(discriminator="kind")]


def singles(geometry: Geometry) -> dict[str, Single]:
    """Geometry of each body, by the name of what it is: that of a part, or 'geometry' for the only one."""
    if isinstance(geometry, Assembly):
        return {f"part {part.name}": part.geometry for part in geometry.parts}
    return {"geometry": geometry}


def files(geometry: Geometry) -> dict[str, Path]:
    """Files that a geometry is read from, by the names of `singles`."""
    return {name: single.path for name, single in singles(geometry).items() if isinstance(single, MeshFile | StepFile)}
