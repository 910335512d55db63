"""scene.yaml: what the robot is. Geometry, mesh, material, what holds it, what drives it, what is watched."""

from math import pi
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, field_validator, model_validator

from cfem.core.spec import Spec
from cfem.core.units import Angle, Length, LengthRange, Point, Points, Stress
from cfem.robot.selection import Selection


class SoftFinger(Spec):
    """Three segments joined by bellows with passive cavities (Navez, Menager et al. 2025); defaults are the paper's."""

    kind: Literal["soft-finger"]
    segment_length: Length = Field(default=40.0, gt=0)
    height: Length = Field(default=20.0, gt=0)
    joint_height: Length = Field(default=6.0, gt=0)
    thickness: Length = Field(default=17.5, gt=0)
    slope: Angle = Field(default=pi / 4, gt=0, lt=pi / 2)


class Bar(Spec):
    """A bar along x from the origin, centred on the x axis."""

    kind: Literal["bar"]
    length: Length = Field(default=60.0, gt=0)
    width: Length = Field(default=10.0, gt=0)
    height: Length = Field(default=10.0, gt=0)


class MeshFile(Spec):
    """A tetrahedral mesh (.vtu, .vtk, .msh) or closed surface (.stl) of the user's own, its numbers in `unit`."""

    kind: Literal["mesh-file"]
    path: Path
    unit: Length = Field(default=1.0, gt=0)


class StepFile(Spec):
    """A solid in a STEP file, whose units it states itself."""

    kind: Literal["step"]
    path: Path


Geometry = Annotated[SoftFinger | Bar | MeshFile | StepFile, Field(discriminator="kind")]


class Refinement(Spec):
    """A finer mesh size within a box, blending into the rest over `blend`."""

    corners: Points
    size: Length = Field(gt=0)
    blend: Length = Field(default=6.0, ge=0)


class Meshing(Spec):
    """element: linear (tet4), quadratic (tet10), or quadratic with one pressure an element (tet10p0: never locks)."""

    size: Length = Field(gt=0)
    refine: list[Refinement] = []
    element: Literal["tet4", "tet10", "tet10p0"] = "tet10p0"


class Material(Spec):
    """One homogeneous hyperelastic material."""

    law: Literal["neo-hookean", "corotational"] = "neo-hookean"
    young: Stress = Field(gt=0)
    poisson: float = Field(ge=0)

    @field_validator("poisson")
    @classmethod
    def _compressible(cls, value: float) -> float:
        if not value < 0.5:
            raise ValueError("an incompressible material has no finite bulk modulus: use at most 0.4999")
        return value


class Cable(Spec):
    """A cable through points of the body, from a fixed pull point where one is given. reach: its smallest and largest
    shortening. radius: of the region through which each point acts, 0 for a mathematical point. unilateral: it can
    pull and cannot push."""

    kind: Literal["cable"]
    name: str = Field(min_length=1)
    points: Points
    pull_point: Point | None = None
    radius: Length = Field(default=2.0, ge=0)
    reach: LengthRange
    unilateral: bool = True

    @model_validator(mode="after")
    def _ordered(self):
        if not self.reach[0] < self.reach[1]:
            raise ValueError(f"cable '{self.name}': reach must be two numbers, the smaller first")
        return self


class Effector(Spec):
    """A watched point. One that lies outside the body is carried by the best-fit rigid motion of what lies within
    carrier_radius of it."""

    name: str = Field(min_length=1)
    point: Point
    radius: Length = Field(default=2.0, ge=0)
    carrier_radius: Length = Field(default=10.0, gt=0)


class SceneSpec(Spec):
    """The whole robot. length: what '% of length' refers to. out: the mesh artefact folder."""

    name: str = Field(pattern=r"^[a-z0-9][a-z0-9-]*$")
    out: Path
    length: Length = Field(gt=0)
    geometry: Geometry
    mesh: Meshing
    material: Material
    fixed: list[Annotated[Selection, Field(discriminator="kind")]] = Field(min_length=1)
    actuators: list[Cable] = Field(min_length=1)
    effectors: list[Effector] = Field(min_length=1)

    @model_validator(mode="after")
    def _names(self):
        for family in (self.actuators, self.effectors):
            names = [item.name for item in family]
            if len(set(names)) < len(names):
                raise ValueError(f"names must differ, got {names}")
        return self
