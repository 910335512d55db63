"""The rigid bodies of a MuJoCo model that soft robots are fixed to or may touch: where they will be, and how they give
way."""

import mujoco
import numpy as np

from cfem.contact.rigid_bodies import RigidBodies
from cfem.mujoco.geoms import MM, Geoms
from cfem.predict.contact.state import ContactState


class Rigid:
    """Bodies (b) with joints, and what is known of them at the beginning of one step.

    robots: (r,) number, among these, of the body of each robot; obstacles: (n,) of each geom; -1: of none
    J: (6 b, n_v) mm and rad by joint, of their centres"""

    def __init__(self, model: mujoco.MjModel, carriers: np.ndarray, geoms: Geoms):
        """carriers: (r,) bodies that robots are fixed to."""
        moved = np.where(model.body_weldid[carriers] > 0, carriers, -1)
        self.model, every = model, np.concatenate([moved, geoms.bodies])
        self.bodies = np.unique(every[every >= 0])
        numbers = np.where(every >= 0, np.searchsorted(self.bodies, every), -1)
        self.robots, self.obstacles = np.split(numbers, [len(carriers)])
        self.J, self._centres = np.zeros((6 * len(self.bodies), model.nv)), np.zeros((len(self.bodies), 3))
        self._mobility = np.zeros((6 * len(self.bodies),) * 2)

    def begin(self, data: mujoco.MjData) -> None:
        """Takes Jacobians and mobility of the bodies where they are, mj_fwdPosition done."""
        model, moved = self.model, np.zeros_like(self.J)
        rows = self.J.reshape(len(self.bodies), 2, 3, model.nv)
        for body, J in zip(self.bodies.tolist(), rows, strict=True):
            mujoco.mj_jac(model, data, J[0], J[1], data.xpos[body], body)
        rows[:, 0] *= MM
        mujoco.mj_solveM(model, data, moved, self.J)
        self._centres = data.xpos[self.bodies] * MM
        self._mobility = model.opt.timestep**2 / MM * self.J @ moved.T

    def joint_forces(self, wrench: np.ndarray) -> np.ndarray:
        """(n_v,) N or N m of a wrench (6 b,), N and N mm."""
        return self.J.T @ wrench / MM

    def ahead(self, data: mujoco.MjData, wrench: np.ndarray) -> RigidBodies:
        """Bodies where `data` predicts them under a wrench (6 b,)."""
        centres = data.xpos[self.bodies] * MM
        self._way = centres - self._centres
        return RigidBodies(centres, self._mobility, wrench, self.robots, self.obstacles)

    def wrench(self, state: ContactState) -> np.ndarray:
        """(6 b,) N and N mm that the contact of a state exerts about the centres at the beginning of the step. Where a
        robot touches a geom, both get their force at one point, so that impulse and angular impulse balance: that point
        of the geom, moved back as its body moved."""
        wrench, on_geom = np.zeros((len(self.bodies), 6)), state.on_obstacles
        patches, push = state.pairs.points[on_geom], state.push[on_geom]
        geoms = state.pairs.partners[on_geom] - len(self.robots)
        met, points = self.obstacles[geoms], state.places[patches].copy()
        points[met >= 0] -= self._way[met[met >= 0]]
        self._add(wrench, met, points, -push)
        self._add(wrench, self.robots[state.bodies[patches]], points, push)
        soft = state.forces.copy()  # between robots
        np.subtract.at(soft, patches, push)
        if len(self.robots) > 1 and not on_geom.all():
            carriers = self.robots[state.bodies]
            points = state.places - np.where(carriers[:, None] >= 0, self._way[carriers], 0.0)
            self._add(wrench, carriers, points, soft)
        return wrench.ravel()

    def _add(self, wrench: np.ndarray, bodies: np.ndarray, points: np.ndarray, forces: np.ndarray) -> None:
        moved = bodies >= 0
        bodies, forces = bodies[moved], forces[moved]
        np.add.at(wrench, (bodies, slice(0, 3)), forces)
        np.add.at(wrench, (bodies, slice(3, 6)), np.cross(points[moved] - self._centres[bodies], forces))
