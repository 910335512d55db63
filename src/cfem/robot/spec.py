"""What a user writes in scene.yaml: the robot's geometry, mesh, material, what holds it, drives it, is watched."""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, Field, StringConstraints, model_validator

from cfem.core.spec import Spec
from cfem.core.units import Angle, Length, LengthRange, Point, Points, Stress

Name = Annotated[str, StringConstraints(pattern=r"^[A-Za-z][A-Za-z0-9_-]*$")]
PositiveLength = Annotated[Length, Field(gt=0)]
Radius = Annotated[Length, Field(ge=0)]


def _not_incompressible(poisson: float) -> float:
    if not 0 <= poisson < 0.5:
        raise ValueError("expected 0 <= poisson < 0.5; for an incompressible material use 0.499")
    return poisson


class Bellow(Spec):
    """A hollow half disc that joins two segments of the finger."""

    bulge: PositiveLength = "6 mm"
    half_length: PositiveLength = "4 mm"
    wall: PositiveLength = "3.5 mm"
    centre_wall: Radius = "3 mm"
    cork: Radius = "4 mm"


class SoftFinger(Spec):
    """Three segments along -z joined by hollow bellows, bending towards +y (Navez, Menager et al. 2025)."""

    kind: Literal["soft-finger"]
    segment_length: PositiveLength = "40 mm"
    height: PositiveLength = "20 mm"
    joint_height: PositiveLength = "6 mm"
    thickness: PositiveLength = "17.5 mm"
    slope: Angle = "45 deg"
    bellow: Bellow = Bellow()


class Bar(Spec):
    """A straight bar along +x from the origin, its cross-section centred on the axis: size is (x, y, z)."""

    kind: Literal["bar"]
    size: Point = {"mm": [60, 10, 10]}


class MeshFile(Spec):
    """A mesh of the user's own (.vtk, .vtu, .msh), or a closed surface (.stl) to be filled with tetrahedra."""

    kind: Literal["mesh-file"]
    path: Path
    unit: PositiveLength = Field("1 mm", description="length of one unit of the file")


class StepFile(Spec):
    """A solid from a CAD program (.step)."""

    kind: Literal["step"]
    path: Path


class Refinement(Spec):
    """A finer size inside a box between two corners."""

    box: Points
    size: PositiveLength

    @model_validator(mode="after")
    def _two_corners(self):
        return _checked(
            self,
            len(self.box) == 2 and (self.box[0] < self.box[1]).all(),
            "box: expected its lower and its upper corner",
        )


class MeshSettings(Spec):
    """size: edge length; element: tet4, tet10, or tet10p0 (quadratic with one pressure an element, the default)."""

    size: PositiveLength | None = None
    refine: tuple[Refinement, ...] = ()
    element: Literal["tet4", "tet10", "tet10p0"] = "tet10p0"


class Material(Spec):
    law: Literal["neo-hookean", "corotational"] = "neo-hookean"
    young: Annotated[Stress, Field(gt=0)]
    poisson: Annotated[
        float, AfterValidator(_not_incompressible), Field(json_schema_extra={"minimum": 0, "exclusiveMaximum": 0.5})
    ]


class BoxSelection(Spec):
    """All between two corners, borders included."""

    kind: Literal["box"]
    corners: Points

    @model_validator(mode="after")
    def _two_corners(self):
        fits = len(self.corners) == 2 and (self.corners[0] <= self.corners[1]).all()
        return _checked(self, fits, "corners: expected the lower and the upper corner")


class SphereSelection(Spec):
    kind: Literal["sphere"]
    centre: Point
    radius: PositiveLength


class PlaneSelection(Spec):
    """The half space on the side of the plane to which the normal points, border included."""

    kind: Literal["plane"]
    point: Point
    normal: Annotated[tuple[float, ...], Field(min_length=3, max_length=3)]

    @model_validator(mode="after")
    def _has_direction(self):
        return _checked(self, any(self.normal), "normal: has no direction")


class NameSelection(Spec):
    """A physical group or named set of the mesh."""

    kind: Literal["name"]
    name: str


class Cable(Spec):
    """A cable through `points`, pulled from `pull_point` where one is given, else from its first point.

    radius: of the region of the body that each point acts through; 0 means the mathematical point.
    reach: smallest and largest shortening."""

    kind: Literal["cable"]
    name: Name
    points: Points
    pull_point: Point | None = None
    radius: Radius = "2 mm"
    reach: LengthRange
    unilateral: bool = True

    @model_validator(mode="after")
    def _has_length(self):
        _checked(self, self.reach[0] < self.reach[1], "reach: expected the smallest, then the largest shortening")
        enough = len(self.points) + (self.pull_point is not None) >= 2
        return _checked(self, enough, "points: a cable without pull_point needs two points")


class Effector(Spec):
    """A watched point. Inside the body it is the mean over `radius`; outside, it is carried by the best-fit rigid motion
    of the region within `carrier_radius`."""

    name: Name
    point: Point
    radius: Radius = "2 mm"
    carrier_radius: PositiveLength = "10 mm"


Geometry = Annotated[SoftFinger | Bar | MeshFile | StepFile, Field(discriminator="kind")]
Selection = Annotated[BoxSelection | SphereSelection | PlaneSelection | NameSelection, Field(discriminator="kind")]


class SceneSpec(Spec):
    """scene.yaml. length: what '% of length' refers to."""

    name: Name
    out: Path
    length: PositiveLength
    geometry: Geometry
    mesh: MeshSettings = MeshSettings()
    material: Material
    fixed: Annotated[tuple[Selection, ...], Field(min_length=1)]
    actuators: Annotated[tuple[Cable, ...], Field(min_length=1)]
    effectors: Annotated[tuple[Effector, ...], Field(min_length=1)]

    @model_validator(mode="after")
    def _consistent(self):
        names = [part.name for part in (*self.actuators, *self.effectors)]
        twice = sorted({name for name in names if names.count(name) > 1})
        _checked(self, not twice, f"actuators and effectors need names of their own; twice: {', '.join(twice)}")
        return _checked(
            self, self.mesh.size or not self.needs_size, "mesh.size: missing; this geometry has yet to be meshed"
        )

    @property
    def needs_size(self) -> bool:
        """Whether tetrahedra are ours to make."""
        return not isinstance(self.geometry, MeshFile) or self.geometry.path.suffix.lower() == ".stl"

    def physics(self) -> dict:
        """What an equilibrium depends on besides the mesh itself: enters the hashes of the stages that solve."""
        return self.model_dump(exclude={"out": True, "geometry": True, "mesh": {"size", "refine"}})


def _checked(spec: Spec, right: bool, message: str) -> Spec:
    if not right:
        raise ValueError(message)
    return spec
