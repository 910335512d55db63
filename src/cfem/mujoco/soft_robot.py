"""A learned robot at a site of a MuJoCo model: its contact, its skin that is drawn, and its sensors."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from cfem.core.errors import InputError, NumericalError
from cfem.equilibrium.system.robot import Robot
from cfem.mujoco.description import points_of, rows_of
from cfem.predict.contact.surface.kept_patches import node_model_of, patched_model_of
from cfem.predict.contact.surface.surface_model import SurfaceModel
from cfem.predict.load import load_model
from cfem.predict.loads.loaded import TRUSTED, wrench_error
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh, made_from

STANDARD = 9806.65  # mm/s^2: g
MOST = 1e3 * STANDARD  # that is looked for
UNEVEN = 0.5  # of gravity: its largest difference between the ends of a robot
AROUND = np.concatenate([np.eye(3), -np.eye(3)])


@dataclass(frozen=True, eq=False)
class OwnWeight:
    """The weight of a robot whose model has an effector at its centre of mass.

    mass: t
    rows: (3,) numbers of the effector's rows
    sampled: (3,) mm/s^2, gravity in its samples, in its frame"""

    mass: float
    rows: np.ndarray
    sampled: np.ndarray

    @classmethod
    def of(cls, robot: Robot, sampled: ArrayLike | None) -> "OwnWeight | None":
        """None where the robot has no such effector, and InputError where it has more than one."""
        if len(robot.masses) > 1:
            raise InputError("the scene has several effectors at centres of mass", do="leave one")
        for name, mass in robot.masses.items():
            rows = np.array([robot.rows.effectors.index(f"{name}.{axis}") for axis in "xyz"])
            return cls(mass, rows, np.zeros(3) if sampled is None else np.asarray(sampled, float))
        return None


@dataclass(frozen=True, eq=False)
class SoftRobot:
    """A learned robot whose surface may be touched; its frame is that of the site. unilateral: (n_a,) bool, actuators
    that go slack where they would push; None: all are held. weight: None where its model does not know it."""

    surface: SurfaceModel
    unilateral: np.ndarray | None = None
    weight: "OwnWeight | None" = None

    @classmethod
    def load(
        cls, model: Path | str, scene: Path | str, patches: float | None = None, sharp_edges: bool = False
    ) -> "SoftRobot":
        """A trained model, its folder, of a scene.yaml. It touches at every node of its surface, or at patches this far
        from each other, mm, which is coarser and faster. Finite elements say once how these yield, which takes a minute
        or two and is kept beside the model. InputError where the model cannot be touched."""
        folder, scene = Path(model), Path(scene)
        learned, (spec, mesh) = load_model(folder), load_scene_and_mesh(scene)
        robot, made_of = build_robot(spec, mesh), made_from(scene, scene.parent / spec.out) | {"loads": {}}
        try:
            if patches is None and not sharp_edges:
                surface: SurfaceModel = node_model_of(learned, folder, robot, made_of)
            else:
                surface = patched_model_of(learned, folder, robot, made_of, patches, sharp_edges)
        except InputError as error:
            raise InputError(error.what, where=error.where or str(folder), do=error.do) from None
        return cls(surface, robot.unilateral, OwnWeight.of(robot, spec.gravity and spec.gravity.acceleration))

    @property
    def points(self) -> list[str]:
        """Names of the effectors that have a place."""
        return points_of(self.surface.model)

    @cached_property
    def point_rows(self) -> np.ndarray:
        """(p, 3) rows of the places of `points`."""
        return np.array([rows_of(self.surface.model, point) for point in self.points], dtype=np.int64).reshape(-1, 3)

    def wrench(self, gravity: np.ndarray) -> np.ndarray | None:
        """(n_e,) N of gravity, (3,) mm/s^2 in its frame, on its effectors, beside that in its samples. None where its
        model does not know its weight."""
        if self.weight is None:
            return None
        wrench = np.zeros(self.surface.model.rows.n_e)
        wrench[self.weight.rows] = self.weight.mass * (gravity - self.weight.sampled)
        return wrench

    def demand_slow(self, gravity: np.ndarray, turning: float, name: str, t: float) -> None:
        """NumericalError at t s where gravity (3,) mm/s^2, with the acceleration of its base, bends the robot further
        than its model knows, or differs by `turning` mm/s^2 between its ends, which the model does not know."""
        size = float(np.linalg.norm(gravity))
        if size > self.known_gravity:
            what = f"at t = {t:.4g} s the base of '{name}' accelerates so that {size / STANDARD:.3g} g bend it, and its"
            do = "move it more slowly, or leave out `inertia`, as for impacts"
            raise NumericalError(f"{what} model knows {self.known_gravity / STANDARD:.3g} g", do=do)
        if turning > UNEVEN * max(size, STANDARD):
            what = f"at t = {t:.4g} s the base of '{name}' turns so fast that acceleration differs by"
            what += f" {turning / STANDARD:.3g} g between its ends, and its model knows one for all of it"
            raise NumericalError(what, do="turn it more slowly, or leave out `inertia`")

    @cached_property
    def known_gravity(self) -> float:
        """mm/s^2 in any direction to which the model knows how gravity bends the robot, to 2 %."""
        low, high = 0.0, STANDARD
        while high < MOST and self._knows(high):
            low, high = high, 2 * high
        while high - low > 0.02 * high:
            middle = (low + high) / 2
            low, high = (middle, high) if self._knows(middle) else (low, middle)
        return low

    def _knows(self, gravity: float) -> bool:
        model = self.surface.model
        wrenches = (self.wrench(gravity * direction) for direction in AROUND)
        return all(wrench_error(model, wrench) <= TRUSTED * model.length for wrench in wrenches)

    def demand_known(self, gravity: float, name: str) -> None:
        """InputError where gravity of a size, mm/s^2, bends the robot further than its model knows."""
        model = self.surface.model
        for direction in AROUND if self.weight is not None else []:
            error = wrench_error(model, self.wrench(gravity * direction))
            if error > TRUSTED * model.length:
                what = f"the weight of '{name}' bends it so far that its model would be wrong by about {error:.2g} mm"
                do = "sample it with `loads: true`, or with gravity and without an effector at its centre of mass"
                raise InputError(f"{what}, and {TRUSTED * model.length:.2g} mm are allowed", do=do)
