"""What takes part in contact: learned robots, where they stand, and the rigid obstacles that they may touch."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Self

import numpy as np

from cfem.contact.detection import separation
from cfem.contact.law.problem import demand_friction
from cfem.contact.obstacle_set import ObstacleSet
from cfem.contact.pairs import Surroundings
from cfem.contact.rigid_bodies import RigidBodies
from cfem.contact.surface.triangles import mean_normals
from cfem.predict.contact.step.state import ContactState
from cfem.predict.contact.surface.surface_model import SurfaceModel
from cfem.predict.contact.surface.surfaces import Surfaces


@dataclass(frozen=True)
class PlacedModel:
    """A learned robot and its place in the scene.

    R, t: (3, 3) and (3,) mm from its frame to the scene's
    itself: True where it may touch itself
    unilateral: (n_a,) bool, actuators that go slack where they would push (`cfem.predict.contact.step.slack`); the
        others are held. None: all are held
    wrench: (n_e,) N and N mm on its effectors in its own frame, such as its weight; None: none"""

    patched: SurfaceModel
    R: np.ndarray = field(default_factory=lambda: np.eye(3))
    t: np.ndarray = field(default_factory=lambda: np.zeros(3))
    itself: bool = True
    unilateral: np.ndarray | None = None
    wrench: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class Bodies:
    """Robots, the obstacles that all of them may touch, and the coefficient of friction mu. SpecError where mu is no
    coefficient of friction.

    rigid: bodies that some of them are fixed to, None where all stand still
    meet: whether robots may touch each other
    even: whether steps are alike in length, so that forces may be expected to go on as in the last one
    parts: in which friction is followed along a step (`cfem.contact.law.sliding`), where `rigid` is None"""

    robots: Sequence[PlacedModel]
    obstacles: ObstacleSet = field(default_factory=lambda: ObstacleSet(()))
    mu: float = 0.0
    rigid: RigidBodies | None = None
    meet: bool = True
    even: bool = False
    parts: int = 1

    def __post_init__(self) -> None:
        demand_friction(self.mu)

    def changed(self, **attributes: Any) -> Self:
        """Copy with other attributes, of which none is checked. `surfaces` may be those of some points of the robots,
        and `R`, `t` and `wrenches` others than `robots` have."""
        _ = self.length, self.soft, self.pulls  # what the robots alone say is found once
        changed = object.__new__(type(self))  # many a step
        changed.__dict__.update(self.__dict__, **attributes)
        return changed

    @cached_property
    def soft(self) -> bool:
        """True where soft surfaces may touch: of two robots, or of one that may touch itself."""
        return (self.meet and len(self.robots) > 1) or any(robot.itself for robot in self.robots)

    @cached_property
    def surfaces(self) -> Surfaces:
        return Surfaces([robot.patched for robot in self.robots])

    @property
    def meets_between_nodes(self) -> bool:
        """True where obstacles may touch the robots between their nodes, too: not where bodies move."""
        return self.rigid is None and any(len(robot.patched.facets.triangles) for robot in self.robots)

    @property
    def ends(self) -> list[int]:
        """Indices at which the patches of each robot begin among all, and their number."""
        return self.surfaces.ends

    @property
    def bodies(self) -> np.ndarray:
        """(N,) number of the robot of each patch."""
        return self.surfaces.bodies

    @cached_property
    def R(self) -> np.ndarray:
        """(r, 3, 3) from the frame of each robot to the scene's."""
        return np.array([robot.R for robot in self.robots], float)

    @cached_property
    def t(self) -> np.ndarray:
        """(r, 3) mm"""
        return np.array([robot.t for robot in self.robots], float)

    @cached_property
    def wrenches(self) -> list[np.ndarray | None]:
        """(n_e,) on the effectors of each robot."""
        return [robot.wrench for robot in self.robots]

    @cached_property
    def length(self) -> float:
        return self.robots[0].patched.model.length

    @cached_property
    def unilateral(self) -> np.ndarray:
        """(n,) bool of the actuators of all robots, robot after robot."""
        each = ((robot.unilateral, robot.patched.model.rows.n_a) for robot in self.robots)
        return np.concatenate([np.zeros(n_a, dtype=bool) if some is None else some for some, n_a in each])

    @cached_property
    def pulls(self) -> bool:
        """True where any actuator only pulls."""
        return bool(self.unilateral.any())

    @cached_property
    def surroundings(self) -> Surroundings:
        """Which soft surfaces may touch which."""
        skins = [robot.patched for robot in self.robots]
        return Surroundings.of(skins, [robot.itself for robot in self.robots], self.length)

    def normals(self, rows: Sequence[np.ndarray], R: np.ndarray | None = None) -> np.ndarray:
        """(N, 3) outward of all patches in the scene, by the rows of each robot's skin; R (r, 3, 3): of robots that
        have turned."""
        normals = []
        for robot, of_robot, turn in zip(self.robots, rows, self.R if R is None else R, strict=True):
            patches, skin = robot.patched.patches, robot.patched.model.skin
            surface = skin.surface(of_robot)
            normals.append(mean_normals(surface, skin.triangles, patches.of, len(patches)) @ turn.T)
        return np.concatenate(normals)

    def separation(self, state: ContactState, body: int, second_body: int) -> float:
        """Smallest gap, mm, of two bodies, or of a body and itself, that do not press each other."""
        first, second = (self.bodies == number for number in (body, second_body))
        near = self.surroundings
        return separation(state.places, self.normals(state.rows), near.may_meet.among(first, second), near.spacings)

    def force_or_gap(self, state: ContactState, number: int) -> float:
        """N, the sum of the normal forces of the first robot and the partner `number` of its pairs; where they do not
        press each other, minus the smallest gap, mm."""
        force = state.between(0, number)
        if force:
            return force
        if number < len(self.robots):
            return -self.separation(state, 0, number)
        first = state.places[: self.ends[1]][~self.robots[0].patched.held_still]
        return -float(max(self.obstacles.obstacles[number - len(self.robots)].distance(first).min(), 0.0))
