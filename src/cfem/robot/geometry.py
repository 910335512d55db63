"""The shapes that a robot may have: from the catalogue, from a file, or several of these placed side by side."""

from math import cos, hypot, pi, tan
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, PositiveInt, field_validator

from cfem.core.spec import Spec
from cfem.core.units import Angle, Length, LengthVector, Point, Points
from cfem.robot.selection import Direction


class SoftFinger(Spec):
    """Three segments joined by bellows with passive cavities (Navez, Menager et al. 2025). Defaults are the paper's."""

    kind: Literal["soft-finger"]
    """The soft finger of the paper."""
    segment_length: Length = Field(default=40.0, gt=0)
    """Length of each segment."""
    height: Length = Field(default=20.0, gt=0)
    """Height of a segment."""
    joint_height: Length = Field(default=6.0, gt=0)
    """Height of the joint between two segments."""
    thickness: Length = Field(default=17.5, gt=0)
    """Thickness of the finger."""
    slope: Angle = Field(default=pi / 4, gt=0, lt=pi / 2)
    """Angle of the sloped faces of a bellow."""
    plateau: Length = Field(default=0.0, ge=0, lt=8)
    """Length over which a bellow has its largest radius."""
    wall: Length = Field(default=3.5, gt=0)
    """Thickness of a bellow's wall around its cavity."""
    centre_wall: Length = Field(default=3.0, ge=0)
    """Thickness of the wall between the two halves of a cavity; 0 for one cavity."""
    cork: Length = Field(default=4.0, ge=0)
    """Height from y = 0 up to which the cavity is filled."""


class Bar(Spec):
    """A bar along x from the origin, centred on the x axis."""

    kind: Literal["bar"]
    """A straight bar."""
    length: Length = Field(default=60.0, gt=0)
    """Length along x."""
    width: Length = Field(default=10.0, gt=0)
    """Width along y."""
    height: Length = Field(default=10.0, gt=0)
    """Height along z."""


class Diamond(Spec):
    """Four legs with knees, from a base up to a platform (after Menager et al. 2023)."""

    kind: Literal["diamond"]
    """The diamond robot."""
    width: Length = Field(default=30.0, gt=0)
    """Width of base, legs and platform."""
    leg_thickness: Length = Field(default=13.5, gt=0)
    """Thickness of a leg."""
    hinge_thickness: Length = Field(default=9.0, gt=0)
    """Thickness of a leg at its root. Smaller than leg_thickness."""
    knee_distance: Length = Field(default=97.0, gt=0)
    """Distance of the knees' outer sides from the z axis."""
    height: Length = Field(default=163.0, gt=0)
    """Height of the whole robot, from z = -37 mm up."""

    def check(self) -> None:
        if self.hinge_thickness >= self.leg_thickness:
            raise ValueError("hinge_thickness must be smaller than leg_thickness")


class Trunk(Spec):
    """A tapered trunk from z = 0 up. Necks join its disks (after Menager et al. 2023)."""

    kind: Literal["trunk"]
    """The trunk robot."""
    length: Length = Field(default=195.0, gt=0)
    """Length along z."""
    base_width: Length = Field(default=26.0, gt=0)
    """Width across flats at the base."""
    tip_width: Length = Field(default=12.0, gt=0)
    """Width across flats at the tip."""
    neck: float = Field(default=0.63, gt=0, le=1)
    """Width of a neck relative to that of a disk there."""
    disks: PositiveInt = 10
    """Number of disks."""
    pitch: Length = Field(default=17.5, gt=0)
    """Distance from disk to disk."""
    disk_thickness: Length = Field(default=6.0, gt=0)
    """Thickness of a disk. Smaller than pitch."""

    def check(self) -> None:
        if self.disk_thickness >= self.pitch or self.disks * self.pitch >= self.length:
            raise ValueError("disk_thickness must be smaller than pitch, and disks times pitch smaller than length")


class Taper(Spec):
    """A round body along x from the origin, such as a tentacle: cones in a row."""

    kind: Literal["taper"]
    """A round body whose radius changes along its axis."""
    places: LengthVector
    """Places along x where the radius is given, from 0 to the length."""
    radii: LengthVector
    """Radius at each place. It is linear in between."""

    def check(self) -> None:
        places, radii = self.places, self.radii
        if len(places) < 2 or len(places) != len(radii):
            raise ValueError(f"taper: needs as many places as radii, at least two; got {len(places)} and {len(radii)}")
        if places[0] != 0 or not (places[1:] > places[:-1]).all():
            raise ValueError("taper: places must begin at 0 and ascend")
        if not (radii > 0).all():
            raise ValueError("taper: radii must be above 0")


class StiffFlop(Spec):
    """Modules in a row from x = 0 along x, each with a bore and six chambers around it (the STIFF-FLOP trunk of Navez,
    Menager et al. 2025). Chamber k lies at k times 60 deg from the y axis towards z. Circles are polygons of twelve
    sides. The sections do not deform, as with fibres around the body. The robot is meshed into slices of mesh.size
    along x. Defaults are the paper's."""

    kind: Literal["stiff-flop"]
    """The pneumatic trunk of one or more modules."""
    modules: PositiveInt = 2
    """Number of modules."""
    module_length: Length = Field(default=55.0, gt=0)
    """Length of one module."""
    radius: Length = Field(default=5.75, gt=0)
    """Outer radius."""
    bore_radius: Length = Field(default=2.25, gt=0)
    """Radius of the bore."""
    chamber_radius: Length = Field(default=0.75, gt=0)
    """Radius of a chamber."""
    chamber_circle: Length = Field(default=4.0, gt=0)
    """Radius of the circle on which the chambers' centres lie."""

    def check(self) -> None:
        wall = self.chamber_circle - self.chamber_radius
        if not self.bore_radius < wall or not self.chamber_circle + self.chamber_radius < self.radius * cos(pi / 12):
            raise ValueError("the chambers must lie between bore_radius and radius")


class PneuNet(Spec):
    """Cells in a row along x from the origin with gaps between them, on a common floor from z = 0 up, with one chamber:
    a room in each cell, joined by a duct through the floor (after Mosadegh et al. 2014). A layer on the floor that does
    not stretch makes it bend: `layers`."""

    kind: Literal["pneunet"]
    """A PneuNet."""
    cells: PositiveInt = 5
    """Number of cells."""
    cell_length: Length = Field(default=10.0, gt=0)
    """Length of a cell along x, walls included."""
    gap: Length = Field(default=1.5, gt=0)
    """Distance from cell to cell."""
    width: Length = Field(default=15.0, gt=0)
    """Width along y."""
    height: Length = Field(default=18.0, gt=0)
    """Height along z, floor included."""
    wall: Length = Field(default=1.5, gt=0)
    """Thickness of the walls and the roof of a room."""
    floor: Length = Field(default=3.0, gt=0)
    """Thickness of the floor below the rooms."""
    duct: Length = Field(default=2.0, gt=0)
    """Width and height of the duct."""

    def check(self) -> None:
        if 2 * self.wall >= min(self.cell_length, self.width) or self.floor + self.duct + self.wall >= self.height:
            what = "2 wall must be smaller than cell_length and width, and floor, duct and wall together than height"
            raise ValueError(what)
        if self.duct >= self.width - 2 * self.wall:
            raise ValueError("the duct must be narrower than a room")


class PneuNetTrunk(Spec):
    """Square cells in a row along x from the origin with gaps between them, on a common spine, with four chambers on
    the sides y+, z+, y- and z-: a room of each in every cell, joined by ducts through the spine. Cells that are blown
    up push their neighbours: `self_contact`."""

    kind: Literal["pneunet-trunk"]
    """A trunk of four PneuNets."""
    cells: PositiveInt = 2
    """Number of cells."""
    cell_length: Length = Field(default=8.0, gt=0)
    """Length of a cell along x, walls included."""
    gap: Length = Field(default=1.0, gt=0)
    """Distance from cell to cell."""
    width: Length = Field(default=30.0, gt=0)
    """Width of a cell along y, and along z."""
    wall: Length = Field(default=1.5, gt=0)
    """Thickness of the walls around rooms and ducts, and between chambers."""
    core: Length = Field(default=2.5, gt=0)
    """Distance of the chambers from the axis."""
    duct: Length = Field(default=2.0, gt=0)
    """Height of a duct, away from the axis."""

    def check(self) -> None:
        if 2 * self.wall >= self.cell_length or 2 * (self.core + self.duct + self.wall) >= self.width:
            raise ValueError("2 wall must be smaller than cell_length, and core, duct and wall together than width / 2")
        if self.wall >= self.core:
            raise ValueError("the core must be larger than the wall, which the chambers leave between them")


class Bellows(Spec):
    """Folds in a row along x from the origin, round about this axis, between two end plates, with one chamber. Walls of
    the folds touch when it is sucked empty: `self_contact`."""

    kind: Literal["bellows"]
    """A bellows."""
    folds: PositiveInt = 4
    """Number of folds."""
    narrow: Length = Field(default=7.0, gt=0)
    """Radius of its outside in the troughs."""
    wide: Length = Field(default=13.0, gt=0)
    """Radius of its outside at the crests."""
    slope: Length = Field(default=2.0, gt=0)
    """Length along x from a trough to a crest."""
    crest: Length = Field(default=3.0, gt=0)
    """Length along x of the outside of a crest, and of a trough."""
    wall: Length = Field(default=1.5, gt=0)
    """Thickness of the walls of the folds."""
    plate: Length = Field(default=3.0, gt=0)
    """Thickness of each end plate."""

    def check(self) -> None:
        if not self.wall < self.narrow < self.wide - self.wall:
            raise ValueError("the wall must be thinner than narrow, and than wide less narrow")
        thinner = self.wall * (hypot(self.wide - self.narrow, self.slope) - self.slope) / (self.wide - self.narrow)
        if thinner >= self.crest / 2:
            raise ValueError(f"walls of the folds fill the crests: crest must be above {2 * thinner:.3g} mm")


class Tube(Spec):
    """A tube along x from the origin, round about this axis, closed by a plate at each end, with one chamber. With a
    braid on its outside it is a McKibben muscle: `layers`."""

    kind: Literal["tube"]
    """A closed tube."""
    length: Length = Field(default=70.0, gt=0)
    """Length along x, plates included."""
    radius: Length = Field(default=8.0, gt=0)
    """Radius of its outside."""
    wall: Length = Field(default=1.5, gt=0)
    """Thickness of the wall."""
    plate: Length = Field(default=5.0, gt=0)
    """Thickness of each end plate."""

    def check(self) -> None:
        if self.wall >= self.radius or 2 * self.plate >= self.length:
            raise ValueError("the wall must be thinner than the radius, and two plates than the length")


class FinRay(Spec):
    """A Fin Ray finger along x from the origin: a front at z = 0 and a back that meets it at the tip, joined by ribs.
    An object that presses the front bends the tip towards itself. The foot is held."""

    kind: Literal["fin-ray"]
    """A Fin Ray finger."""
    length: Length = Field(default=80.0, gt=0)
    """Length along x."""
    base: Length = Field(default=40.0, gt=0)
    """Height along z at the foot, both walls included."""
    tip: Length = Field(default=4.5, gt=0)
    """Height along z at the tip."""
    width: Length = Field(default=20.0, gt=0)
    """Width along y."""
    wall: Length = Field(default=1.5, gt=0)
    """Thickness of the front and of the back."""
    ribs: PositiveInt = 4
    """Number of ribs."""
    rib: Length = Field(default=1.5, gt=0)
    """Thickness of a rib."""
    rib_angle: Angle = Field(default=7 * pi / 36, gt=-pi / 3, lt=pi / 3)
    """Angle by which ribs lean towards the tip from the front to the back; 0 for ribs square to the front."""
    foot: Length = Field(default=4.0, gt=0)
    """Thickness of the foot along x."""

    def check(self) -> None:
        slope = (self.base - self.tip) / self.length
        end = (self.base - self.wall * (2 + hypot(1, slope))) / slope if slope > 0 else 0.0
        end = min(end, self.length - 2 * self.wall)
        if self.tip <= 2 * self.wall or end <= self.foot:
            raise ValueError("tip must be above 2 wall, base above tip, and a room must be left between foot and tip")
        pitch = (end - self.foot) / (self.ribs + 1)
        height = self.base if self.rib_angle < 0 else self.tip + slope * pitch  # of the room that leaning ribs narrow
        if pitch - self.rib / cos(self.rib_angle) <= abs(tan(self.rib_angle)) * height:
            raise ValueError("the ribs fill the finger: take fewer or thinner ones, or a smaller rib_angle")


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
    """A solid in a STEP or BREP file."""

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
