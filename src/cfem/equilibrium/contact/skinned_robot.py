"""A robot of finite elements whose surface is cut into patches, placed in a scene."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from cfem.condensed.patches import Patches
from cfem.contact.detection import along
from cfem.equilibrium.problem import Problem
from cfem.equilibrium.robot import Robot

HELD = 0.9  # share of a patch's nodes that are held: it touches nothing


@dataclass(frozen=True, eq=False)
class SkinnedRobot:
    """A robot; nodes (m,) of its surface in the mesh, triangles (t, 3) of them, and the patches that cut it; R (3, 3)
    and t (3,) mm from its frame to the scene's; itself: whether it may touch itself."""

    robot: Robot
    nodes: np.ndarray
    triangles: np.ndarray
    patches: Patches
    R: np.ndarray = field(default_factory=lambda: np.eye(3))
    t: np.ndarray = field(default_factory=lambda: np.zeros(3))
    itself: bool = True

    @cached_property
    def problem(self) -> Problem:
        return Problem(self.robot)

    @cached_property
    def along(self) -> np.ndarray:
        return along(self.robot.X[self.nodes], self.triangles, self.patches)

    @cached_property
    def held_still(self) -> np.ndarray:
        return self.patches.mean(np.isin(self.nodes, self.robot.fixed).astype(float)) > HELD

    def surface(self, x: np.ndarray) -> np.ndarray:
        """(m, 3) mm in the scene, of nodes at x (n, 3) mm."""
        return x[self.nodes] @ self.R.T + self.t
