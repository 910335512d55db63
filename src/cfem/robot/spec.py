"""scene.yaml: what the robot is. Geometry, mesh, material, what holds it, what drives it, what is watched."""

from pathlib import Path
from typing import Any, Literal

from pydantic import Field

from cfem.core.errors import SpecError
from cfem.core.spec import Spec, load_spec, meaning
from cfem.core.units import AccelerationVector, Length, Percent
from cfem.mechanics.element import SECTIONED
from cfem.robot.catalogue import routes
from cfem.robot.catalogue.stiff_flop import StiffFlop
from cfem.robot.catalogue.taper import Taper
from cfem.robot.constraints import Actuator, Chambers, Contact, Effector, Load
from cfem.robot.discrepancy import DiscrepancySpec
from cfem.robot.geometry import Assembly, Geometry, MeshFile, Refinement
from cfem.robot.layers import LayerSpec
from cfem.robot.materials import MaterialRegion, MaterialSpec
from cfem.robot.selection import Selection
from cfem.robot.self_contact import OptionalSelfContact
from cfem.robot.shape.free_form import FreeForm


class Meshing(Spec):
    """How the body is meshed."""

    size: Length = Field(gt=0)
    """Largest size of a cell."""
    cells: int | None = Field(default=None, ge=100)
    """For how many tetrahedra sizes are graded, finest where W needs it. It makes 0.5 to 2.5 times as many, and more
    where `size` alone makes more."""
    accuracy: Percent | None = None
    """Largest error of the mesh, relative to how far the effectors travel, e.g. '1 %', in place of `cells`. It is
    estimated with single actuators at their reach, and the mesh is made finer until it has it. Of tetrahedra that are
    made here."""
    max_cells: int = Field(default=300_000, ge=1, exclude=True)
    """Number of cells above which the mesh is refused before it is made. It changes nothing else."""
    refine: list[Refinement] = []
    """Boxes of finer tetrahedra."""
    mirror: Literal["x", "y", "z"] | None = None
    """Axis across which the body is its own mirror image. One half is meshed, so that W is as symmetric as the body."""
    element: Literal["tet4", "tet10", "tet10p0", "hex8", "hex8-full", "hex8-reduced", "beam"] = "tet10p0"
    """tet10p0: quadratic tetrahedra with one pressure per element, which never lock. tet4, tet10: linear and quadratic
    tetrahedra. hex8: hexahedra of a bar, of a mesh file, or of a stiff-flop as a solid with hoops around its chambers.
    beam: a stiff-flop or a taper as a geometrically exact rod. hex8-full, hex8-reduced: a stiff-flop as hexahedra
    between rigid sections; hex8-full locks in shear."""


class Gravity(Spec):
    """The weight of everything. Each material then needs its density."""

    acceleration: AccelerationVector
    """Acceleration along x, y and z."""


class SceneSpec(Spec):
    """The whole robot: geometry, mesh, material, what holds it, what drives it, what is watched."""

    name: str = Field(pattern=r"^[a-z0-9][a-z0-9-]*$")
    """Name of the robot: small letters, digits and hyphens."""
    out: Path
    """Folder for the mesh that `cfem mesh` makes."""
    length: Length = Field(gt=0)
    """Length of the robot, to which '% of length' refers."""
    geometry: Geometry
    """Shape of the robot."""
    mesh: Meshing
    """How the body is meshed."""
    shape: FreeForm | None = None
    """Free form: how the meshed geometry is deformed before anything acts on it."""
    material: MaterialSpec
    """Material of the body."""
    materials: list[MaterialRegion] = []
    """Regions of another material. Later regions win."""
    layers: list[LayerSpec] = []
    """Thin layers on faces of tetrahedra that resist stretching alone: paper, fabric, windings."""
    self_contact: OptionalSelfContact = None
    """Contact of the surface with itself, of tetrahedra: `true`, or its settings. None unless given."""
    fixed: list[Selection] = Field(min_length=1)
    """What is held: regions or named sets of nodes that do not move."""
    rigid: list[Selection] = []
    """Groups of nodes that each move as one rigid body."""
    gravity: Gravity | None = None
    """Gravity, none unless given."""
    loads: list[Load] = []
    """Constant forces."""
    actuators: list[Actuator]
    """What drives the robot: cables and chambers. `cfem mesh` works without any, samples need one."""
    contacts: list[Contact] = []
    """Points that something may touch."""
    effectors: list[Effector] = Field(min_length=1)
    """What is watched and controlled."""
    discrepancy: DiscrepancySpec | None = None
    """What finite elements lack at the effectors. `cfem calibrate-cases` writes it. None unless given."""

    @property
    def all_materials(self) -> dict[str, MaterialSpec]:
        """Materials by their key: the body's, then that of each region."""
        regions = {f"materials.{index}.material": item.material for index, item in enumerate(self.materials)}
        return {"material": self.material, **regions}

    def check(self) -> None:
        """Raises ValueError, led by the key, where parts of the scene do not go together."""
        self._check_names()
        self._check_routes()
        self._check_materials()
        self._check_meshing()
        self._check_sections()

    def _check_names(self) -> None:
        """Names of actuators differ, and those of effectors and contacts, which both have rows name.x, name.y,
        name.z."""
        watched = [(key, i, item) for key in ("effectors", "contacts") for i, item in enumerate(getattr(self, key))]
        driven = [("actuators", index, item) for index, item in enumerate(self.actuators)]
        for items in (driven, watched):
            first: dict[str, str] = {}
            for key, index, item in items:
                place = f"{key}.{index}.name"
                if item.name in first:
                    raise ValueError(f"{place}: names must differ, and {first[item.name]} is '{item.name}' too")
                first[item.name] = place

    def _check_routes(self) -> None:
        """Routes and tips are known of the geometry."""
        needs_tip = [f"actuators.{i}.route" for i, item in enumerate(self.actuators) if getattr(item, "route", None)]
        needs_tip += [f"effectors.{i}.at" for i, item in enumerate(self.effectors) if item.at == "tip"]
        if needs_tip and not routes.has_tip(self.geometry):
            *kinds, last = routes.BODIES
            raise ValueError(f"{needs_tip[0]}: needs a geometry of kind {', '.join(kinds)} or {last}")
        for index, item in enumerate(self.actuators):
            wrong = routes.fault(self.geometry, item.route) if getattr(item, "route", None) else ""
            if wrong:
                raise ValueError(f"actuators.{index}.route: {wrong}")

    def _check_materials(self) -> None:
        """Each material has its density under gravity."""
        lacking = [key for key, material in self.all_materials.items() if material.density is None]
        if self.gravity is not None and lacking:
            raise ValueError(f"{lacking[0]}: gravity needs the density of each material, such as '1070 kg/m^3'")

    def _check_meshing(self) -> None:
        """Keys of `mesh` that are of tetrahedra made here, of one body, stand with nothing else."""
        geometry, mesh = self.geometry, self.mesh
        cells_of_file = isinstance(geometry, MeshFile) and not geometry.meshed_here
        if mesh.cells is not None and (mesh.element in ("hex8", *SECTIONED) or cells_of_file):
            raise ValueError("mesh.cells: grades tetrahedra that are made here, not hexahedra or a mesh file")
        if mesh.accuracy is not None and (mesh.element in ("hex8", *SECTIONED) or cells_of_file):
            raise ValueError("mesh.accuracy: is of tetrahedra that are made here, not of hexahedra or a mesh file")
        if mesh.accuracy is not None and (mesh.cells is not None or not self.actuators):
            raise ValueError("mesh.accuracy: needs actuators, and does not go with mesh.cells")
        if mesh.mirror and (isinstance(geometry, Assembly | MeshFile | StiffFlop) or mesh.element == "hex8"):
            raise ValueError("mesh.mirror: is for tetrahedra of one body that is meshed here")
        if self.layers and mesh.element in ("hex8", *SECTIONED):
            raise ValueError("layers: lie on faces of tetrahedra, set mesh.element to tet10p0 or tet10")
        if self.self_contact and mesh.element in ("hex8", *SECTIONED):
            raise ValueError("self_contact: is of the faces of tetrahedra, set mesh.element to tet10p0 or tet10")
        if isinstance(geometry, Assembly) and mesh.refine:
            raise ValueError("mesh.refine: has no place in an assembly, give each part its own `refine`")

    def _check_sections(self) -> None:
        """Robots of rigid sections have elements for them, and nothing that would deform these or hold them
        together."""
        sections, element = isinstance(self.geometry, StiffFlop), self.mesh.element
        rod = isinstance(self.geometry, Taper) and element == "beam"
        if (sections and element not in ("hex8", *SECTIONED)) or (element in SECTIONED and not (sections or rod)):
            what = f"geometry stiff-flop goes with mesh.element {', '.join(SECTIONED)} or hex8"
            raise ValueError(f"{what}, taper with beam or tetrahedra, and the first {len(SECTIONED)} with no other")
        if (sections or rod) and self.rigid:
            raise ValueError(f"rigid: the sections of a {self.geometry.kind} are rigid already, leave `rigid` out")
        for index, item in enumerate(self.actuators):
            if isinstance(item, Chambers) and (not sections or item.module > self.geometry.modules):
                what = f"chambers '{item.name}': the geometry has no module {item.module} with chambers"
                raise ValueError(f"actuators.{index}.module: {what}")
        if self.shape is not None and (element in SECTIONED or sections):
            raise ValueError("shape: the robot is of sections that do not deform, leave `shape` out")


def demand_driven(scene: SceneSpec) -> None:
    """Raises SpecError where nothing drives the robot."""
    if not scene.actuators:
        with scene.locating():
            do = "add cables or chambers: comments in a scene of `cfem init` show how"
            raise SpecError("nothing drives the robot yet", where="actuators", do=do)


def scene_meaning(path: Path) -> Any:
    """Plain data of a scene, independent of comments, of spelling and of where its mesh goes."""
    return meaning(load_spec(path, SceneSpec), {"out"})
