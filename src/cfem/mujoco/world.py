"""A MuJoCo model with learned soft robots, in steps of its own timestep.

A step predicts where all rigid bodies will be, under the contact forces of the last step. There the contact of all
robots with all geoms and with each other is one problem (`cfem.predict.contact`), in which rigid bodies give way by
dt^2 J M^-1 J^T and robots by their compliance. Its forces act on both sides in MuJoCo's own step: implicit Euler for
contact, so that no damping is needed. Robots have no inertia of their own."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from math import isfinite
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from cfem.contact.law.problem import demand_friction
from cfem.contact.obstacle_set import ObstacleSet
from cfem.contact.rigid_bodies import RigidBodies
from cfem.core.errors import InputError, NumericalError, SpecError
from cfem.mujoco.description import add_robot, control_names, skin_name
from cfem.mujoco.geoms import MM, Geoms, poses, ways
from cfem.mujoco.near import Look
from cfem.mujoco.rigid import Rigid
from cfem.mujoco.sensors import Sensors
from cfem.mujoco.soft_robot import SoftRobot
from cfem.predict.contact.step.bodies import PlacedModel
from cfem.predict.contact.step.scene import ContactScene
from cfem.predict.contact.step.state import TRUSTED, ContactState

INSIDE = 1e-3  # of the length: by how much a robot may overlap a geom at the start
FAST = 0.05  # of the length: the longest way of a geom in one step that may touch a robot in it
LONGEST = 0.01  # of the length: how far a patch may begin beyond the middle of a geom
GIVEN = 0.02  # of all energy that contact has exchanged: what rounding and prediction may add to it
LEAST = 1e-3  # N mm: less is not looked at
STATE, RK4 = mujoco.mjtState.mjSTATE_INTEGRATION, int(mujoco.mjtIntegrator.mjINT_RK4)


@dataclass(frozen=True, eq=False)
class Energies:
    """Energies of contact since the start, N mm.

    commanded: work of the commands against contact, and of weight that turns with a base against it
    passed: work on rigid bodies, of the robots' bases too
    stored: in the robots, as long as they are touched
    turned: sum of all that was exchanged, of either sign"""

    commanded: float = 0.0
    passed: float = 0.0
    stored: float = 0.0
    turned: float = 0.0

    @property
    def lost(self) -> float:
        """Energy lost to friction, and to the steps."""
        return self.commanded - self.passed - self.stored


@dataclass(frozen=True, eq=False)
class Saved:
    """All that a world goes on from."""

    mujoco: np.ndarray
    contact: ContactState | None
    look: Look
    wrench: np.ndarray
    energies: Energies


class World:
    """model, data: MuJoCo's, free to use between steps
    contact: state of the robots after the last step, None before the first; in mm and N, and of the points of their
        surfaces that may touch, `points`
    energies: what contact has done since the start"""

    def __init__(
        self,
        mjcf: Path | str | mujoco.MjSpec,
        robots: Mapping[str, SoftRobot],
        friction: float = 0.5,
        robots_touch: bool = False,
        inertia: bool = False,
    ):
        """Robots at the sites of these names.

        friction: coefficient of all surfaces of the robots
        robots_touch: whether robots may touch each other
        inertia: whether the acceleration of its base bends a robot, as weight does, at rest in the base's frame

        InputError where a geom is of a kind that they do not touch, or touches one at the start, where the actuators
        are at 0."""
        self.model = _compiled(mjcf, robots)
        self.data, self._ahead = mujoco.MjData(self.model), mujoco.MjData(self.model)
        self.robots, self.friction, self.robots_touch, self.inertia = dict(robots), friction, robots_touch, inertia
        self._sites = np.array([self.model.site(name).id for name in robots], dtype=np.int64)
        for name, robot in robots.items():
            robot.demand_known(MM * float(np.linalg.norm(self.model.opt.gravity)), name)
            if inertia and robot.weight is None:
                what = f"the soft robot '{name}' does not know its mass, so that no acceleration of its base bends it"
                raise InputError(what, do="give its scene density and an effector at its centre of mass")
        carriers = self.model.site_bodyid[self._sites]
        kind = mujoco.mjtObj.mjOBJ_ACTUATOR
        self._controls = {
            name: np.array(
                [mujoco.mj_name2id(self.model, kind, each) for each in control_names(name, robot.surface.model)]
            )
            for name, robot in robots.items()
        }
        kind, self._vector = mujoco.mjtObj.mjOBJ_FLEX, np.empty(mujoco.mj_stateSize(self.model, STATE))
        self._flexes = [mujoco.mj_name2id(self.model, kind, skin_name(name)) for name in robots]
        self._skins = list(_hidden(self.model, self._flexes))
        self._sensors = Sensors(self.model, self.robots)
        self.geoms = Geoms(self.model, carriers.tolist())
        self.rigid = Rigid(self.model, carriers, self.geoms)
        self._shortest = min(robot.surface.model.length for robot in self.robots.values())
        placed = [PlacedModel(it.surface, itself=False, unilateral=it.unilateral) for it in robots.values()]
        self._standing = ContactScene(placed, ObstacleSet(()), friction, meet=robots_touch, even=True)
        self._weighed = [(i, robot) for i, robot in enumerate(robots.values()) if robot.weight is not None]
        self._everywhere = Look.nowhere(self._standing.surfaces)
        self.reset()

    def reset(self) -> None:
        """Back to the start, the actuators at 0. InputError where a geom touches a robot there."""
        mujoco.mj_resetData(self.model, self.data)
        mujoco.mj_forward(self.model, self.data)
        self.contact, self.energies, self._look = None, Energies(), self._everywhere
        self._wrench = np.zeros(6 * len(self.rigid.bodies))
        scene = self._scene(self.data)
        start = scene.changed(obstacles=ObstacleSet(())).start(self._deltas)
        each = zip(scene.robots, self.robots, start.rows, scene.R, scene.t, strict=True)
        for robot, name, rows, R, t in each:
            free = ~robot.patched.held_still[robot.patched.patches.of]
            places = robot.patched.model.skin.surface(rows)[free] @ R.T + t
            for geom, obstacle in zip(self.geoms.names, scene.obstacles.obstacles, strict=True):
                inside = -float(obstacle.distance(places).min())
                if inside > INSIDE * robot.patched.model.length:
                    what = f"geom '{geom}' and the soft robot '{name}' overlap by {inside:.2g} mm at the start"
                    raise InputError(what, do="move one of them, or let the geom not collide: contype=conaffinity=0")
        self._sensors.write(self.data.sensordata, start, *self._poses(self.data))

    @contextmanager
    def _skins_hidden(self) -> Iterator[None]:
        """MuJoCo passes over the robots' skins, which would take most of the time of its steps."""
        for numbers, hidden, _ in self._skins:
            numbers[:] = hidden
        try:
            yield
        finally:
            for numbers, _, full in self._skins:
                numbers[:] = full

    def step(self, commands: Mapping[str, ArrayLike]) -> ContactState:
        """One timestep, to displacements (n_a,) of the actuators of robots by name, mm or mm^3; those of others
        are the controls of MuJoCo where it has actuators of their names, or stay. SpecError
        where there is no such robot. NumericalError where contact finds no state, the timestep is too long for what is
        touched, or energy appears from nowhere."""
        with self._skins_hidden():
            return self._step(commands)

    def _step(self, commands: Mapping[str, ArrayLike]) -> ContactState:
        """Contact state after one step of the world: contact where MuJoCo alone would bring its bodies, then MuJoCo's
        step under the forces of that contact."""
        model, data, ahead, rigid = self.model, self.data, self._ahead, self.rigid
        deltas = self._commanded(commands)
        mujoco.mj_copyState(model, data, ahead, STATE)
        mujoco.mj_step1(model, ahead)
        rigid.begin(ahead)
        applied = ahead.qfrc_applied
        applied += rigid.joint_forces(self._wrench)
        before = self._velocities(ahead)
        begin = ahead.geom_xpos.copy()
        (mujoco.mj_step if model.opt.integrator == RK4 else mujoco.mj_step2)(model, ahead)
        mujoco.mj_kinematics(model, ahead)
        gravity = self._gravity(before)
        scene = self._scene(ahead, gravity, rigid.ahead(ahead, self._wrench))
        self._demand_slow(*ways(scene.obstacles.t, begin, self.geoms.numbers))
        state, look = self._look.step(scene, deltas, self.contact)
        self._demand_sound(scene, state)
        (wrench, forces), speed, applied = rigid.wrench(state), data.qvel.copy(), data.qfrc_applied
        by_user = applied.copy()
        applied += forces
        mujoco.mj_step(model, data)
        applied[:] = by_user
        passed = MM * model.opt.timestep * float(forces.dot(speed + data.qvel)) / 2
        mujoco.mj_kinematics(model, data)
        self.energies = self._account(state, passed)
        self.contact, self._look, self._wrench = state, look, wrench
        self._sensors.write(data.sensordata, state, *self._poses(data))
        return state

    @property
    def friction(self) -> float:
        """Coefficient of all surfaces of the robots. SpecError where it is set to what is none."""
        return self._friction

    @friction.setter
    def friction(self, mu: float) -> None:
        demand_friction(mu)
        self._friction = mu

    @property
    def points(self) -> np.ndarray:
        """(n,) numbers of the points that `contact` is of, among those of all robots, robot after robot."""
        return self._look.numbers

    @property
    def places(self) -> np.ndarray:
        """(N, 3) mm of all points of the robots' surfaces after the last step, robot after robot."""
        if self.contact is None:
            return self._scene(self.data).changed(obstacles=ObstacleSet(())).start(self._deltas).places
        return self._everywhere.taken(self.contact, self._look.numbers).places

    def force(self, robot: str, geom: str | None = None) -> np.ndarray:
        """(3,) N on a robot in the axes of the world, of one geom or of all that it touches."""
        state, number = self.contact, list(self.robots).index(robot)
        if state is None:
            return np.zeros(3)
        if geom is None:
            return state.forces[state.bodies == number].sum(axis=0)
        partner = len(self.robots) + self.geoms.names.index(geom)
        mine = (state.bodies[state.pairs.points] == number) & (state.pairs.partners == partner)
        return state.push[mine].sum(axis=0)

    def draw(self) -> None:
        """Brings the skins that MuJoCo draws to where the robots are; before a renderer or viewer updates its scene."""
        model, data = self.model, self.data
        mujoco.mj_kinematics(model, data)
        each = enumerate(zip(self.robots.values(), self._flexes, *self._poses(data), strict=True))
        for number, (robot, flex, R, t) in each:
            skin = robot.surface.model.skin
            rows = skin.rows(self._deltas[number], np.zeros(0)) if self.contact is None else self.contact.rows[number]
            first = model.flex_vertadr[flex]
            data.flexvert_xpos[first : first + len(skin.rest)] = (skin.surface(rows) @ R.T + t) / MM

    def save(self) -> Saved:
        """The state of MuJoCo and of the robots, for `restore`."""
        vector = self._vector.copy()
        mujoco.mj_getState(self.model, self.data, vector, STATE)
        return Saved(vector, self.contact, self._look, self._wrench, self.energies)

    def restore(self, saved: Saved) -> None:
        """Goes back to a saved state of this world, or of another one of the same model and robots."""
        mujoco.mj_setState(self.model, self.data, saved.mujoco, STATE)
        mujoco.mj_forward(self.model, self.data)
        self.contact, self._look, self._wrench, self.energies = saved.contact, saved.look, saved.wrench, saved.energies

    def _poses(self, data: mujoco.MjData) -> tuple[np.ndarray, np.ndarray]:
        """(r, 3, 3) and (r, 3) mm of the robots' sites."""
        return poses(data.site_xmat, data.site_xpos, self._sites)

    def _velocities(self, data: mujoco.MjData) -> list[np.ndarray]:
        """(2, 3) mm/s and rad/s of each base at its robot's centre of mass; none without `inertia`."""
        if not self.inertia:
            return []
        model, J, velocities = self.model, np.zeros((2, 3, self.model.nv)), []
        mujoco.mj_comPos(model, data)
        for number, (robot, R, t) in enumerate(zip(self.robots.values(), *self._poses(data), strict=True)):
            centre = robot.surface.model.rest_e + (0.0 if self.contact is None else self.contact.delta_e[number])
            point, body = (R @ centre[robot.weight.rows] + t) / MM, model.site_bodyid[self._sites[number]]
            mujoco.mj_jac(model, data, J[0], J[1], point, body)
            velocities.append(J @ data.qvel * [[MM], [1.0]])
        return velocities

    def _gravity(self, before: list[np.ndarray]) -> np.ndarray | None:
        """(r, 3) mm/s^2 of each robot at the end of the predicted step, less the acceleration of its base from the
        velocities `before`; None where these are not asked for. NumericalError where that is more than its model
        knows."""
        if not before:
            return None
        model, gravity = self.model, np.full((len(self.robots), 3), MM * self.model.opt.gravity)
        each = zip(self.robots.items(), before, self._velocities(self._ahead), strict=False)
        for number, ((name, robot), begin, end) in enumerate(each):
            change = (end - begin) / model.opt.timestep
            gravity[number] -= change[0]
            turning = robot.surface.model.length * (end[1] @ end[1] + float(np.linalg.norm(change[1])))
            robot.demand_slow(gravity[number], turning, name, self.data.time)
        return gravity

    def _scene(
        self, data: mujoco.MjData, gravity: np.ndarray | None = None, rigid: RigidBodies | None = None
    ) -> ContactScene:
        """Robots and geoms where `data` has them; gravity (r, 3) mm/s^2 on each robot, the model's unless given; rigid:
        bodies that give way."""
        R, t = self._poses(data)
        wrenches: list[np.ndarray | None] = [None] * len(self.robots)
        for number, robot in self._weighed:
            by = MM * self.model.opt.gravity if gravity is None else gravity[number]
            wrenches[number] = robot.wrench(by @ R[number])
        posed = {"R": R, "t": t, "obstacles": self.geoms.placed(data), "wrenches": wrenches}
        return self._standing.changed(**posed, rigid=rigid, mu=self.friction)

    def _commanded(self, commands: Mapping[str, ArrayLike]) -> list[np.ndarray]:
        """Displacements (n_a,) of each robot's actuators: as stated, else by MuJoCo's controls, else as they are.
        SpecError for an unknown robot, or numbers that do not fit it."""
        for name in commands:
            if name not in self.robots:
                raise SpecError(f"there is no soft robot '{name}'", do=f"known are {', '.join(self.robots)}")
        deltas = []
        for number, (name, robot) in enumerate(self.robots.items()):
            rows = robot.surface.model.rows
            delta = np.asarray(commands[name] if name in commands else self._controlled(name, number), float)
            if delta.shape != (rows.n_a,) or not all(map(isfinite, delta.tolist())):
                names = ", ".join(rows.actuators)
                raise SpecError(f"robot '{name}' takes one finite number for each of its actuators, {names}")
            deltas.append(delta)
        return deltas

    def _controlled(self, name: str, number: int) -> np.ndarray:
        """(n_a,) what the controls of MuJoCo command of a robot, what it has now where it has none."""
        numbers = self._controls[name]
        if (numbers < 0).any():
            return self._deltas[number]
        return np.clip(self.data.ctrl[numbers], *self.model.actuator_ctrlrange[numbers].T)

    @property
    def _deltas(self) -> list[np.ndarray]:
        """(n_a,) displacements of each robot's actuators."""
        if self.contact is not None:
            return self.contact.deltas
        return [np.zeros(robot.surface.model.rows.n_a) for robot in self.robots.values()]

    def _demand_slow(self, by: np.ndarray, largest: float) -> None:
        """NumericalError where a geom that is near a robot goes so far in one step, by (n, 3) mm, that it may pass it;
        largest: mm of all entries."""
        longest = FAST * self._shortest
        if self.contact is None or largest < longest / 2:  # less than the root of 3
            return
        ways = np.sqrt((by * by).sum(axis=1))
        fast = np.flatnonzero(ways > longest)
        if not len(fast):
            return
        places = self._everywhere.places(self.contact)
        for i in fast:
            if self.contact.obstacles.obstacles[i].distance(places).min() < ways[i]:
                what = f"the geom '{self.geoms.names[i]}' goes {ways[i]:.2g} mm in one step near a soft robot"
                what += f" at t = {self.data.time:.4g} s, and may pass it"
                raise NumericalError(what, do=f"take a timestep shorter than {self.model.opt.timestep:g} s")

    def _demand_sound(self, scene: ContactScene, state: ContactState) -> None:
        """NumericalError where a state cannot be gone on from."""
        too_deep = state.deep and state.depth > LONGEST * scene.length
        if state.converged and not too_deep:
            return
        when = f"at t = {self.data.time:.4g} s"
        if not state.converged:
            what = f"contact of soft robots {when}: {state.status.value}"
            do = "take a shorter timestep, or slower commands"
            known = 0.0 if self.contact is None else self.contact.error
            if known > TRUSTED:
                what += f"; just before, forces bent a robot so far that what they do was {known:.0%} off"
                do = "touch it more slowly or with less mass; a shorter timestep does not help a robot that buckles"
            raise NumericalError(what, do=do)
        what = f"{when} a geom comes {state.depth:.2g} mm into a soft robot in one step, too far to know on which side"
        raise NumericalError(what, do=f"take a timestep shorter than {self.model.opt.timestep:g} s")

    def _account(self, state: ContactState, passed: float) -> Energies:
        """Energies after a step that has passed this work, N mm, on to rigid bodies. NumericalError where they have
        come from nowhere."""
        before, commanded = self.energies, 0.0
        if self.contact is not None:
            last = self.contact
            commanded = -float((state.given - last.given).dot(state.answers.work + last.answers.work)) / 2
        turned = before.turned + abs(passed) + abs(commanded)
        energies = Energies(before.commanded + commanded, before.passed + passed, state.stored, turned)
        if energies.lost < -GIVEN * turned - LEAST:
            what = f"contact has given {-energies.lost:.3g} N mm more than it was given by t = {self.data.time:.4g} s"
            raise NumericalError(what, do=f"take a timestep shorter than {self.model.opt.timestep:g} s")
        return energies


def _hidden(model: mujoco.MjModel, flexes: list[int]) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Numbers of a model, as they make MuJoCo pass over these flexes, and as they are. Without vertices and elements it
    would still ask where all vertices are that belong to a moving body."""
    vertices = np.isin(np.repeat(np.arange(model.nflex), model.flex_vertnum), flexes)
    each = ((count, flexes) for count in (model.flex_vertnum, model.flex_elemnum, model.flex_bvhnum))
    for numbers, mine in [*each, (model.flex_vertbodyid, vertices)]:
        hidden, full = numbers.copy(), numbers.copy()
        hidden[mine] = 0
        yield numbers, hidden, full


def _compiled(mjcf: Path | str | mujoco.MjSpec, robots: Mapping[str, SoftRobot]) -> mujoco.MjModel:
    """The model with the robots' skins and sensors. InputError where MuJoCo does not read it."""
    is_text = isinstance(mjcf, str) and mjcf.lstrip().startswith("<")
    where = None if is_text or isinstance(mjcf, mujoco.MjSpec) else str(mjcf)
    try:
        if isinstance(mjcf, mujoco.MjSpec):
            spec = mjcf.copy()
        elif where:
            spec = mujoco.MjSpec.from_file(where)
        else:
            spec = mujoco.MjSpec.from_string(mjcf)
        for name, robot in robots.items():
            add_robot(spec, name, robot.surface.model)
        return spec.compile()
    except (ValueError, mujoco.FatalError) as error:
        raise InputError(" ".join(str(error).split()), where=where or "the MuJoCo model") from None
