"""scene.yaml: what the robot is. Geometry, mesh, material, what holds it, what drives it, what is watched."""

from collections import Counter
from pathlib import Path
from typing import Literal

from pydantic import Field, model_validator

from cfem.core.spec import Spec
from cfem.core.units import AccelerationVector, Length
from cfem.mechanics.element import SECTIONED
from cfem.robot.constraints import Actuator, Chambers, Contact, Effector, Load
from cfem.robot.geometry import Assembly, Geometry, MeshFile, Refinement, SoftFinger, StiffFlop
from cfem.robot.materials import MaterialRegion, MaterialSpec
from cfem.robot.selection import Selection


class Meshing(Spec):
    """element: linear (tet4), quadratic (tet10), or quadratic tetrahedra with one pressure an element (tet10p0: never
    locks); hexahedra (hex8) of a bar, or of a mesh file that holds them. A stiff-flop, of rigid sections, is a
    geometrically exact rod (beam), or hexahedra between the sections: hex8-full, whose shear locks, or hex8-reduced;
    with hex8 it is a solid whose chambers are wound by hoops that keep their shape, one a section, and whose modules
    end in rigid plates. size: the largest. refine: boxes of finer tetrahedra. cells: about how many tetrahedra; they
    are then graded, finest where W needs it. mirror: the axis across which the body is its own mirror image: one half
    is meshed, and W is as symmetric as the body."""

    size: Length = Field(gt=0)
    cells: int | None = Field(default=None, ge=100)
    refine: list[Refinement] = []
    mirror: Literal["x", "y", "z"] | None = None
    element: Literal["tet4", "tet10", "tet10p0", "hex8", "hex8-full", "hex8-reduced", "beam"] = "tet10p0"


class Gravity(Spec):
    """The weight of everything; each material then needs its density."""

    acceleration: AccelerationVector


class SceneSpec(Spec):
    """The whole robot. length: what '% of length' refers to. out: the mesh artefact folder. materials: regions of
    another material, of which later ones win. rigid: groups of nodes that each move as one rigid body. contacts: points
    that something may touch. loads: constant forces."""

    name: str = Field(pattern=r"^[a-z0-9][a-z0-9-]*$")
    out: Path
    length: Length = Field(gt=0)
    geometry: Geometry
    mesh: Meshing
    material: MaterialSpec
    materials: list[MaterialRegion] = []
    fixed: list[Selection] = Field(min_length=1)
    rigid: list[Selection] = []
    gravity: Gravity | None = None
    loads: list[Load] = []
    actuators: list[Actuator] = Field(min_length=1)
    contacts: list[Contact] = []
    effectors: list[Effector] = Field(min_length=1)

    @model_validator(mode="after")
    def _names(self):
        for names in (
            [item.name for item in self.actuators],
            [item.name for item in (*self.effectors, *self.contacts)],  # both have rows name.x, name.y, name.z
        ):
            if max(Counter(names).values()) > 1:
                raise ValueError(f"names must differ, got {names}")
        return self

    @model_validator(mode="after")
    def _places(self):
        asked = [f"route of cable '{one.name}'" for one in self.actuators if getattr(one, "route", None)]
        asked += [f"place `at` of effector '{one.name}'" for one in self.effectors if one.at]
        if asked and not isinstance(self.geometry, SoftFinger):
            raise ValueError(f"the {asked[0]} needs a geometry of kind soft-finger")
        return self

    @model_validator(mode="after")
    def _weights(self):
        materials = {"material": self.material} | {
            f"materials[{index}].material": item.material for index, item in enumerate(self.materials)
        }
        lacking = [name for name, material in materials.items() if material.density is None]
        if self.gravity is not None and lacking:
            raise ValueError(f"gravity needs the density of each material, such as '1070 kg/m^3': {lacking} lacks it")
        return self

    @model_validator(mode="after")
    def _graded(self):
        if self.mesh.cells is not None and (
            self.mesh.element in ("hex8", *SECTIONED)
            or (isinstance(self.geometry, MeshFile) and self.geometry.path.suffix != ".stl")
        ):
            raise ValueError("mesh.cells grades tetrahedra that are made here, not hexahedra or a mesh file")
        return self

    @model_validator(mode="after")
    def _mirrored(self):
        made = not isinstance(self.geometry, Assembly | MeshFile | StiffFlop) and self.mesh.element != "hex8"
        if self.mesh.mirror and not made:
            raise ValueError("mesh.mirror is for tetrahedra of one body that is meshed here")
        return self

    @model_validator(mode="after")
    def _sectioned(self):
        sections, element = isinstance(self.geometry, StiffFlop), self.mesh.element
        if (sections and element not in ("hex8", *SECTIONED)) or (element in SECTIONED and not sections):
            what = f"geometry stiff-flop goes with mesh.element {', '.join(SECTIONED)} or hex8"
            raise ValueError(f"{what}, and the first {len(SECTIONED)} with no other geometry")
        if sections and self.rigid:
            raise ValueError("what is rigid of a stiff-flop is so already: leave `rigid` out")
        for item in self.actuators:
            if isinstance(item, Chambers) and (not sections or item.module > self.geometry.modules):
                raise ValueError(f"chambers '{item.name}': the geometry has no module {item.module} with chambers")
        return self

    @model_validator(mode="after")
    def _refined(self):
        if isinstance(self.geometry, Assembly) and self.mesh.refine:
            raise ValueError("mesh.refine has no place in an assembly: give each part its own `refine`")
        return self
