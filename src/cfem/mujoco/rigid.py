"""The rigid bodies of a MuJoCo model that soft robots are fixed to or may touch: where they will be, and how they give
way."""

import mujoco
import numpy as np
from numba import njit

from cfem.contact.rigid_bodies import RigidBodies, add_wrench
from cfem.mujoco.geoms import MM, Geoms
from cfem.predict.contact.step.state import ContactState


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
        self._moved, rows = np.zeros_like(self.J), self.J.reshape(len(self.bodies), 2, 3, model.nv)
        self._each = [(body, *J) for body, J in zip(self.bodies.tolist(), rows, strict=True)]

    def begin(self, data: mujoco.MjData) -> None:
        """Takes Jacobians and mobility of the bodies where they are, mj_fwdPosition done."""
        model = self.model
        for body, along, about in self._each:
            mujoco.mj_jacBody(model, data, along, about, body)
        mujoco.mj_solveM(model, data, self._moved, self.J)
        self._centres, self._mobility = _begun(self.J, self._moved, data.xpos, self.bodies, model.opt.timestep)

    def joint_forces(self, wrench: np.ndarray) -> np.ndarray:
        """(n_v,) N or N m of a wrench (6 b,), N and N mm."""
        return _joint_forces(wrench, self.J)

    def ahead(self, data: mujoco.MjData, wrench: np.ndarray) -> RigidBodies:
        """Bodies where `data` predicts them under a wrench (6 b,)."""
        centres, self._way = _gone(data.xpos, self.bodies, self._centres)
        return RigidBodies(centres, self._mobility, wrench, self.robots, self.obstacles)

    def wrench(self, state: ContactState) -> tuple[np.ndarray, np.ndarray]:
        """(6 b,) N and N mm that the contact of a state exerts about the centres at the beginning of the step, and its
        `joint_forces`. Where a robot touches a geom, both get their force at one point, so that impulse and angular
        impulse balance: that point of the geom, moved back as its body moved."""
        pairs, loads = state.pairs, (self.robots, state.bodies, state.places, state.forces)
        on_geoms = self.obstacles, self._centres, self._way
        return _wrench(pairs.slots, pairs.partners, state.push, *loads, *on_geoms, self.J)


@njit(cache=True, error_model="numpy")
def _begun(J, moved, xpos, bodies, dt):
    """Centres (b, 3) mm of bodies among places (n, 3) m, and their mobility dt^2 J M^-1 J^T; from m to mm in J
    (6 b, n_v); moved (6 b, n_v): J M^-1, in m."""
    centres, (n, joints) = np.empty((len(bodies), 3)), J.shape
    for i in range(len(bodies)):
        for a in range(3):
            centres[i, a] = xpos[bodies[i], a] * MM
            for k in range(joints):
                J[6 * i + a, k] *= MM
    mobility = np.zeros((n, n))
    for i in range(n):
        for j in range(n):
            for k in range(joints):
                mobility[i, j] += J[i, k] * moved[j, k]
            mobility[i, j] *= dt * dt * (1.0 if j % 6 < 3 else 1.0 / MM)
    return centres, mobility


@njit(cache=True, error_model="numpy")
def _gone(xpos, bodies, begin):
    """Centres (b, 3) mm of bodies among places (n, 3) m, and their ways from `begin`, (b, 3) mm."""
    centres, way = np.empty(begin.shape), np.empty(begin.shape)
    for i in range(len(bodies)):
        for a in range(3):
            centres[i, a] = xpos[bodies[i], a] * MM
            way[i, a] = centres[i, a] - begin[i, a]
    return centres, way


@njit(cache=True, error_model="numpy")
def _joint_forces(wrench, J):
    forces = np.zeros(J.shape[1])
    for i in range(len(wrench)):
        for k in range(len(forces)):
            forces[k] += wrench[i] * J[i, k] / MM
    return forces


@njit(cache=True, error_model="numpy")
def _wrench(slots, partners, push, robots, bodies, places, forces, obstacles, centres, way, J):
    """(6 b,) wrench, and its `joint_forces`, of pairs (p,) of `ContactState.pairs`, push (p, 3) N, about centres (b, 3)
    mm that go by way (b, 3) mm; bodies (N,), places (N, 3) mm and forces (N, 3) N of all points; robots (r,), obstacles
    (n,): their bodies."""
    wrench, soft, between, lever, n = np.zeros(6 * len(centres)), forces.copy(), False, np.empty(3), len(places)
    for p in range(len(slots)):
        if slots[p] < n:
            between = True
            continue
        point = slots[p] - n
        for a in range(3):
            soft[point, a] -= push[p, a]
        met, carrier = obstacles[partners[p] - len(robots)], robots[bodies[point]]
        for body, sign in ((met, -1.0), (carrier, 1.0)):
            if body < 0:
                continue
            for a in range(3):
                lever[a] = places[point, a] - (way[met, a] if met >= 0 else 0.0) - centres[body, a]
            add_wrench(wrench, body, lever, sign * push[p])
    if between and len(robots) > 1:
        for point in range(n):
            carrier = robots[bodies[point]]
            if carrier >= 0:
                for a in range(3):
                    lever[a] = places[point, a] - way[carrier, a] - centres[carrier, a]
                add_wrench(wrench, carrier, lever, soft[point])
    return wrench, _joint_forces(wrench, J)
