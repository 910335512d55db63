"""What a robot meets, and what control does with it, as `control.yaml` says it."""

from abc import abstractmethod
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from cfem.contact.obstacle import Box, Capsule, ClosedMesh, Obstacle, Plane, Sphere, tangents
from cfem.contact.prescribed_motion import ActuatedRobot, PrescribedMotion, Translation
from cfem.contact.surface.closed_surface import ClosedSurface
from cfem.core.errors import InputError
from cfem.core.spec import Spec
from cfem.core.stl import read_stl
from cfem.core.units import Force, Length, Point, Points
from cfem.predict.protocol import Predictor
from cfem.robot.geometry import Turn
from cfem.robot.mesh.placement import rotation_of
from cfem.robot.selection import Direction


class _Any(Spec):
    """What holds for every obstacle."""

    press: Force | None = Field(None, gt=0)
    """Force with which plans press it, the sum of the normal forces of all patches that touch it."""
    largest_force: Force | None = Field(None, gt=0)
    """Largest such force that plans may use."""
    avoid: Length | None = Field(None, gt=0)
    """Smallest distance that plans keep from it."""
    path: Points | None = None
    """Displacements that it goes through from the first goal to the last, evenly spread, straight from one to the next.
    It stands still unless given."""

    def check(self) -> None:
        if self.avoid is not None and (self.press is not None or self.largest_force is not None):
            raise ValueError("an obstacle is pressed or avoided; leave one of them out")
        if self.press is not None and self.largest_force is not None and self.press > self.largest_force:
            raise ValueError(f"press: {self.press:g} N is more than largest_force, {self.largest_force:g} N")

    @property
    def pressed(self) -> bool:
        return self.press is not None or self.largest_force is not None


class _Solid(_Any):
    """An obstacle that does not yield."""

    @abstractmethod
    def made(self, folder: Path) -> Obstacle:
        """The obstacle where it stands; folder: of the control.yaml."""

    def course(self, folder: Path) -> PrescribedMotion:
        """Motion of the obstacle over the run; folder: of the control.yaml."""
        return Translation(self.made(folder), np.zeros((1, 3)) if self.path is None else np.asarray(self.path, float))


class PlaneObstacle(_Solid):
    """A wall or a table: everything behind a plane."""

    kind: Literal["plane"]
    """A plane."""
    point: Point
    """A point of the plane."""
    normal: Direction
    """Direction out of the wall, to where the robot may be."""

    def made(self, folder: Path) -> Obstacle:
        return Plane(R=_turned(self.normal), t=np.array(self.point))


class SphereObstacle(_Solid):
    """A ball."""

    kind: Literal["sphere"]
    """A ball."""
    centre: Point
    """Its centre."""
    radius: Annotated[Length, Field(gt=0)]
    """Its radius."""

    def made(self, folder: Path) -> Obstacle:
        return Sphere(self.radius, t=np.array(self.centre))


class BoxObstacle(_Solid):
    """A box."""

    kind: Literal["box"]
    """A box."""
    centre: Point
    """Its centre."""
    half_size: Point
    """Half of its edges along its own x, y and z."""
    rotate: Turn | None = None
    """Rotation about its centre."""

    def made(self, folder: Path) -> Obstacle:
        return Box(np.array(self.half_size), R=rotation_of(self.rotate), t=np.array(self.centre))


class CapsuleObstacle(_Solid):
    """A rod with round ends."""

    kind: Literal["capsule"]
    """A rod with round ends."""
    ends: Points
    """Centres of its two round ends."""
    radius: Annotated[Length, Field(gt=0)]
    """Its radius."""

    def check(self) -> None:
        super().check()
        if len(self.ends) != 2 or np.allclose(self.ends[0], self.ends[1]):
            raise ValueError("ends: expected two points that differ")

    def made(self, folder: Path) -> Obstacle:
        first, second = np.asarray(self.ends, float)
        return Capsule(
            self.radius, float(np.linalg.norm(second - first)) / 2, R=_turned(second - first), t=(first + second) / 2
        )


class MeshObstacle(_Solid):
    """A body of any shape."""

    kind: Literal["mesh"]
    """A closed surface of triangles in a file."""
    file: Path
    """STL file, relative to this file."""
    unit: Length = Field(1.0, gt=0)
    """Length of one unit of the file."""
    rotate: Turn | None = None
    """Rotation about the origin of the file."""
    translate: Point | None = None
    """Movement after the rotation."""

    def made(self, folder: Path) -> Obstacle:
        path = folder / self.file
        try:
            surface = ClosedSurface(*read_stl(path, self.unit))
        except InputError as error:
            raise InputError(error.what, where=error.where or str(path), do=error.do) from None
        t = np.zeros(3) if self.translate is None else np.array(self.translate)
        return ClosedMesh(surface, R=rotation_of(self.rotate), t=t)


class RobotObstacle(_Any):
    """Another soft robot. It yields where they touch, in plans and in finite elements."""

    kind: Literal["robot"]
    """Another learned robot."""
    model: Path
    """Folder of its model, which has a skin; relative to this file."""
    scene: Path | None = None
    """Its scene; that of the robot itself unless given. What is only avoided needs none."""
    shares: Annotated[tuple[tuple[float, ...], ...], Field(min_length=1)]
    """Where its actuators are, as shares of their reach, from the first goal to the last: evenly spread, straight from
    one to the next. One entry stands still."""
    rotate: Turn | None = None
    """Rotation about the origin of its scene."""
    translate: Point | None = None
    """Movement after the rotation."""

    def check(self) -> None:
        super().check()
        if self.path is not None:
            raise ValueError("path: another robot moves by its actuators, state `shares`")

    def actuated(self, model: Predictor) -> ActuatedRobot:
        """Motion of the obstacle that the robot is, by its actuators; model: its own. InputError where `shares` do not
        fit it, or it has no skin."""
        n_a = model.rows.n_a
        if any(len(row) != n_a for row in self.shares):
            raise InputError(f"the model has {n_a} actuators, and each row of `shares` needs as many numbers")
        shares = np.array(self.shares)
        if not (np.isfinite(shares).all() and shares.min() >= 0 and shares.max() <= 1):
            raise InputError("`shares` must be between 0 and 1")
        low, high = model.reach.T
        R, t = rotation_of(self.rotate), np.zeros(3) if self.translate is None else np.array(self.translate)
        facets = model.facets
        return ActuatedRobot(model, low + shares * (high - low), lambda x: ClosedMesh(ClosedSurface(x, facets)), R, t)


class ItselfObstacle(_Any):
    """The robot's own surface, where parts of it come to lie on each other."""

    kind: Literal["itself"]
    """The robot touches itself. Parts that are nearer than 0.3 of its length along its surface never meet."""

    def check(self) -> None:
        super().check()
        if self.path is not None or self.avoid is not None:
            raise ValueError("itself takes press or largest_force, and neither path nor avoid")


ObstacleSpec = Annotated[
    PlaneObstacle | SphereObstacle | BoxObstacle | CapsuleObstacle | MeshObstacle | RobotObstacle | ItselfObstacle,
    Field(discriminator="kind"),
]


class ContactSpec(Spec):
    """How the robot's surface touches."""

    resolution: Literal["patches", "mesh"] | None = None
    """`mesh`: at every node of the surface, in the plan and in the FE robot. `patches`: at the means of patches, which
    is coarser and faster. Unless given, `control` takes the mesh where neither `patches` nor `sharp_edges` are given,
    and everything else takes patches."""
    patches: Length | None = Field(None, gt=0)
    """Distance of the patches into which the surface is cut. Each touches as a point. A twentieth of the robot's length
    unless given."""
    sharp_edges: bool = False
    """Whether convex edges that turn by more than 30 degrees have patches of their own. Without these such an edge
    reaches into what it touches before any patch does. With them there are more patches."""
    friction: float = Field(0.0, ge=0)
    """Coefficient of friction of the robot's surface, on obstacles, other robots and itself."""

    def check(self) -> None:
        if self.resolution == "mesh" and (self.patches is not None or self.sharp_edges):
            raise ValueError("contact: resolution mesh has no patches: leave out patches and sharp_edges")

    @property
    def of_patches(self) -> bool:
        """True where the spec asks for patches."""
        return self.resolution == "patches" or self.patches is not None or self.sharp_edges

    @property
    def cut(self) -> tuple[float | None, bool]:
        """Spacing of the patches and whether sharp edges have their own
        (`cfem.predict.contact.surface.patched_model.patches_of`)."""
        return self.patches, self.sharp_edges


def _turned(z: np.ndarray) -> np.ndarray:
    """(3, 3) a rotation that turns z to this direction."""
    n, t1, t2 = tangents((np.asarray(z, float) / np.linalg.norm(z))[None])[0]
    return np.stack([t1, t2, n], axis=1)
