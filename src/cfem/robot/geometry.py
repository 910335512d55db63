"""The shapes that a robot may have: from the catalogue, from a file, or several of these placed side by side."""

from math import cos, pi
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, PositiveInt, field_validator, model_validator

from cfem.core.spec import Spec
from cfem.core.units import Angle, Length, Point, Points
from cfem.robot.selection import Direction


class SoftFinger(Spec):
    """Three segments joined by bellows with passive cavities (Navez, Menager et al. 2025); defaults are the paper's.
    plateau: length over which a bellow has its largest radius; wall: of a bellow around its cavity; centre_wall:
    between its two halves, 0 for one cavity; cork: what fills it from y = 0 up."""

    kind: Literal["soft-finger"]
    segment_length: Length = Field(default=40.0, gt=0)
    height: Length = Field(default=20.0, gt=0)
    joint_height: Length = Field(default=6.0, gt=0)
    thickness: Length = Field(default=17.5, gt=0)
    slope: Angle = Field(default=pi / 4, gt=0, lt=pi / 2)
    plateau: Length = Field(default=0.0, ge=0, lt=8)
    wall: Length = Field(default=3.5, gt=0)
    centre_wall: Length = Field(default=3.0, ge=0)
    cork: Length = Field(default=4.0, ge=0)


class Bar(Spec):
    """A bar along x from the origin, centred on the x axis."""

    kind: Literal["bar"]
    length: Length = Field(default=60.0, gt=0)
    width: Length = Field(default=10.0, gt=0)
    height: Length = Field(default=10.0, gt=0)


class Diamond(Spec):
    """Four legs with knees, from a base up to a platform (after Menager et al. 2023). width: of base, legs and
    platform; hinge_thickness: of a leg at its root; knee_distance: of the knees' outer sides from the z axis;
    height: of all, from z = -37 mm up."""

    kind: Literal["diamond"]
    width: Length = Field(default=30.0, gt=0)
    leg_thickness: Length = Field(default=13.5, gt=0)
    hinge_thickness: Length = Field(default=9.0, gt=0)
    knee_distance: Length = Field(default=97.0, gt=0)
    height: Length = Field(default=163.0, gt=0)

    @model_validator(mode="after")
    def _possible(self):
        if self.hinge_thickness >= self.leg_thickness:
            raise ValueError("hinge_thickness must be smaller than leg_thickness")
        return self


class Trunk(Spec):
    """A tapered trunk from z = 0 up, its disks joined by necks (after Menager et al. 2023). widths: across flats;
    neck: width of a neck relative to that of a disk there; pitch: from disk to disk."""

    kind: Literal["trunk"]
    length: Length = Field(default=195.0, gt=0)
    base_width: Length = Field(default=26.0, gt=0)
    tip_width: Length = Field(default=12.0, gt=0)
    neck: float = Field(default=0.63, gt=0, le=1)
    disks: PositiveInt = 10
    pitch: Length = Field(default=17.5, gt=0)
    disk_thickness: Length = Field(default=6.0, gt=0)

    @model_validator(mode="after")
    def _possible(self):
        if self.disk_thickness >= self.pitch or self.disks * self.pitch >= self.length:
            raise ValueError("disk_thickness must be smaller than pitch, and disks times pitch smaller than length")
        return self


class StiffFlop(Spec):
    """Modules in a row from x = 0 along x, with a bore and, around it, six chambers along each module; circles are
    polygons of twelve sides. Chamber k lies at k times 60 deg from the y axis towards z. Its sections do not deform, as
    with a reinforcement of fibres around it (the STIFF-FLOP trunk of Navez, Menager et al. 2025; defaults are theirs).
    It is meshed into slices of mesh.size along x."""

    kind: Literal["stiff-flop"]
    modules: PositiveInt = 2
    module_length: Length = Field(default=55.0, gt=0)
    radius: Length = Field(default=5.75, gt=0)
    bore_radius: Length = Field(default=2.25, gt=0)
    chamber_radius: Length = Field(default=0.75, gt=0)
    chamber_circle: Length = Field(default=4.0, gt=0)

    @model_validator(mode="after")
    def _possible(self):
        wall = self.chamber_circle - self.chamber_radius
        if not self.bore_radius < wall or not self.chamber_circle + self.chamber_radius < self.radius * cos(pi / 12):
            raise ValueError("the chambers must lie between bore_radius and radius")
        return self


class MeshFile(Spec):
    """A mesh of tetrahedra or hexahedra (.vtu, .vtk, .msh) or closed surface (.stl) of the user's own, its numbers in
    `unit`."""

    kind: Literal["mesh-file"]
    path: Path
    unit: Length = Field(default=1.0, gt=0)


class StepFile(Spec):
    """A solid in a STEP file, whose units it states itself."""

    kind: Literal["step"]
    path: Path


Single = SoftFinger | Bar | Diamond | Trunk | StiffFlop | MeshFile | StepFile


class Refinement(Spec):
    """A finer mesh size within a box, blending into the rest over `blend`."""

    corners: Points
    size: Length = Field(gt=0)
    blend: Length = Field(default=6.0, ge=0)


class Turn(Spec):
    """A rotation by `angle` about the line through the origin along `axis`, by the right-hand rule."""

    axis: Direction
    angle: Angle


class Part(Spec):
    """One body of several: its geometry turned by `rotate` about its own origin and then moved by `translate`. size:
    of its mesh, in the place of mesh.size. refine: in the part's own coordinates, those of its geometry before it is
    placed, so that equal parts have equal meshes. All else in a scene is in the scene's coordinates."""

    name: str = Field(pattern=r"^[A-Za-z0-9_-]+$")
    geometry: Annotated[Single, Field(discriminator="kind")]
    rotate: Turn | None = None
    translate: Point | None = None
    size: Annotated[Length, Field(gt=0)] | None = None
    refine: list[Refinement] = []


class Assembly(Spec):
    """Several bodies, each meshed on its own. The name of a part is that of its cells, nodes and facets; a set `end` of
    its mesh file is `part.end`. Touching parts are not joined, unless by a rigid group."""

    kind: Literal["assembly"]
    parts: list[Part] = Field(min_length=1)

    @field_validator("parts")
    @classmethod
    def _distinct(cls, parts: list[Part]) -> list[Part]:
        names = [part.name for part in parts]
        if len(set(names)) < len(names):
            raise ValueError(f"names of parts must differ, got {names}")
        return parts


Geometry = Annotated[Single | Assembly, Field(discriminator="kind")]
