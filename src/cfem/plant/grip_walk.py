"""Robots about an object that they grip, and the quasi-static steps in which they go: contact points open, stick and
slide, or are glued to it. The robots are finite elements, or learned (`cfem.predict.contact.gripping_finger`,
`cfem.predict.contact.surface_finger`): what plans with friction ask of a model are such steps of learned robots."""

from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from itertools import pairwise
from typing import Self

import numpy as np

from cfem.contact.law.modes import Mode
from cfem.contact.law.problem import Law
from cfem.contact.step_status import StepStatus
from cfem.equilibrium.contact.grasp import FreeObject, grasp_step, holding_stiffness
from cfem.equilibrium.contact.ground import Pads
from cfem.equilibrium.contact.points import PointRobot, PointsState
from cfem.equilibrium.contact.surface_robot import SurfaceRobot, chosen, joined
from cfem.equilibrium.quasi_static import CONVERGED, carried_out
from cfem.equilibrium.system.actuation import displacement
from cfem.plant.contact_account import ContactAccount

HANDED = 0.25  # of the load: what the robots take over in one step
CLOSING = 1 / 8  # of its longest step: the same while nodes of a surface close on an object that a table bears
OPENING = 0.1  # of its longest step: how far an actuator goes in one while the robots let go
SLIDES = 0.05  # mm that an object which nothing holds slides down in a first step
FASTER, SLOWER, LASTS = 2.0, 0.25, 60  # how that changes from step to step, and where a step fails; steps
ROUNDING = 1e-8  # of the normal force, to which the law is solved: less friction is none
BUCKLES = "the object is not held stably: a robot that holds it buckles"
JOINS = 10  # times that points of a surface join those of a step
LEVERAGE = 10.0  # mm that an object goes in a longest step: more is another contact state, not a step of this one


class GripWalk(ContactAccount):
    """Robots that grip an object, from state to state. Over a table those that go back to rest let it go (`let_go`).

    at: (n_a,) mm where the actuators stand
    load: share of the object's load that the robots carry
    carried: whether the object is held where it is, until the robots have closed
    last: the state of contact there
    stuck: quasi-static steps without a solution so far"""

    def __init__(
        self,
        fingers: Sequence[PointRobot],
        ends: np.ndarray,
        held: FreeObject,
        law: Law,
        mu: float,
        grasp: np.ndarray | None = None,
        table: Pads | None = None,
        longest: np.ndarray | float = 1.0,
    ):
        """Grip of `fingers` about an object, at rest.

        ends: where each robot's actuators begin and end
        held: the object
        law, mu: of contact and friction
        grasp: (n_a,) mm, how the first command begins: the object is carried until then, and handed over there
        table: what the object stands on, and which carries its load, until the robots lift it; None: nothing does
        longest: (n_a,) mm or mm^3 that an actuator goes in one quasi-static step, as friction depends on the way"""
        self.fingers, self._ends, self._held, self._law, self._mu = fingers, ends, held, law, mu
        self._grasp, self.table, self.stuck, self._longest = grasp, table, 0, longest
        self.reset()
        super().__init__(*(("nodes", "take a finer mesh") if self._at_surface else ()))

    @property
    def choices(self) -> list[np.ndarray | None]:
        """Contact points of each robot among those of its surface, None where it has no choice."""
        return [finger.numbers if isinstance(finger, SurfaceRobot) else None for finger in self.fingers]

    @choices.setter
    def choices(self, choices: Sequence[np.ndarray | None]) -> None:
        each = zip(self.fingers, choices, strict=True)
        self.fingers = [finger if numbers is None else finger.touching(numbers) for finger, numbers in each]

    @property
    def _at_surface(self) -> bool:
        """True where robots touch by any point of their surface."""
        return any(choice is not None for choice in self.choices)

    @property
    def holds(self) -> bool:
        """True as long as the robots have not let go."""
        return self.table is None or bool(self.at.any())

    @property
    def glued(self) -> bool:
        return self._law == "bilateral"

    @property
    def centre(self) -> np.ndarray:
        """(3,) mm of the object at rest."""
        return self._held.centre

    @property
    def load_of_object(self) -> np.ndarray:
        """Load (3,) N on the object, all of it."""
        return self._held.load[:3]

    def _stiffness(self, state: PointsState) -> np.ndarray:
        """Eigenvalues (k,) N/mm of the stiffness that holds the object, from the smallest on; rotations as the way by
        which they move the farthest point at rest."""
        K = holding_stiffness(state, self._points(state))
        arms = np.concatenate([finger.points for finger in self.fingers]) - self._held.centre
        length = max(1.0, float(np.linalg.norm(arms, axis=1).max()))
        size = np.array([1.0] * 3 + [length] * (len(K) - 3))
        return np.linalg.eigvalsh(K / np.outer(size, size))

    def _points(self, state: PointsState) -> np.ndarray:
        """Contact points (m, 3) mm of the robots in a state."""
        delta = zip(self.fingers, state.solved, strict=False)  # a table comes last
        return np.concatenate(
            [finger.points + solved.delta_c.reshape(-1, 3) @ finger.turn.T for finger, solved in delta]
        )

    @property
    def solved(self) -> tuple:
        """States of the robots."""
        return self.last.solved[: len(self.fingers)]

    @property
    def parts(self) -> list[tuple[int, int]]:
        """Range of the points of each robot."""
        ends = np.cumsum([0, *(len(finger.points) for finger in self.fingers)])
        return list(pairwise(ends))

    def on_table(self) -> float:
        """Force N by which the table bears the object."""
        return float(self.last.posed.force.reshape(-1, 3)[self.parts[-1][1] :, 0].sum())

    def pushes(self) -> tuple[np.ndarray, np.ndarray]:
        """Forces of each robot on the object: normal force (r,) N, the sum over its points, and friction (r, 3) N."""
        posed = self.last.posed
        force = posed.force.reshape(-1, 3)
        friction = ((force * [0.0, 1.0, 1.0]).ravel() @ posed.rotation).reshape(-1, 3)
        normal = np.array([force[a:b, 0].sum() for a, b in self.parts])
        return normal, np.array([friction[a:b].sum(axis=0) for a, b in self.parts])

    def forces(self) -> np.ndarray:
        """Forces (r, 3) N by which each robot pushes the object."""
        posed = self.last.posed
        force = (posed.force @ posed.rotation).reshape(-1, 3)
        return -np.array([force[a:b].sum(axis=0) for a, b in self.parts])

    def slip_margin(self) -> float:
        """The friction that the robots' normal forces allow over what they use, of the robot that has the least; 0
        where one lets go."""
        normal, friction = self.pushes()
        used = np.linalg.norm(friction, axis=1)
        if not normal.all():
            return 0.0
        return float((self._mu * normal / np.maximum(used, ROUNDING * normal)).min())

    def clearance(self) -> float:
        """Distance (mm) between the object and the contact point nearest to it."""
        return float(self.last.around.surface(self._points(self.last))[0].min())

    def reset(self) -> None:
        """Back to rest, nothing held."""
        self.at, self.last = np.zeros(int(self._ends[-1])), None
        handed_over = self._grasp is not None and self.table is None
        self.load = 0.0 if handed_over else 1.0
        self.carried = handed_over and self._at_surface

    def restarted(self, share: float) -> Self:
        """Walk of the same robots from rest, nothing held, in steps of this share of the length of these."""
        other = copy(self)
        other._longest = share * self._longest
        other.reset()
        return other

    def squeeze(self) -> str:
        """The grasp, without load where the object is handed over: how that ended. Robots that come from apart would
        push a free object before them: it is carried until all have closed, and then rests where they balance."""
        status = self.towards(self.at if self._grasp is None else self._grasp)
        if status != CONVERGED or not self.carried:
            return status
        before, self.carried = (self.last, self.fingers), False
        status = self._go(self.at, self.load)
        if status == CONVERGED and np.linalg.norm(self.last.around.x - before[0].around.x) <= LEVERAGE:
            return status
        self.last, self.fingers = before
        return self._slide(self.at)

    def grasp(self) -> str:
        """The squeeze that the first command begins with, and the load: how that ended."""
        if self._grasp is None:
            return CONVERGED
        status = CONVERGED if self.last is not None else self.squeeze()
        return self.take(1.0) if status == CONVERGED and self.load != 1.0 else status

    def take(self, load: float) -> str:
        """Takes the share `load` of the object's load, in steps; returns how that ended."""
        begin, wanted = np.array([self.load]), np.array([load])
        return carried_out(begin, wanted, HANDED, lambda share: self._go(self.at, float(share[0])))

    def off_table(self) -> Self | None:
        """Robots as they stand, and the object without its table, whose load they take over in whole steps; None where
        they cannot."""
        air, n_points = copy(self), self.parts[-1][1]
        air.table, air._grasp = None, self.at
        air.last = replace(
            self.last, solved=self.solved, modes=self.last.modes[:n_points], stuck=self.last.stuck[:n_points]
        )
        begin = max(0.0, 1 - self.on_table() / float(np.linalg.norm(self._held.load[:3])))
        shares = np.linspace(begin, 1.0, 1 + int(np.ceil((1 - begin) / HANDED)))
        return air if all(air._go(self.at, share) == CONVERGED for share in shares) else None

    def towards(self, u: np.ndarray, via: Sequence[np.ndarray] = ()) -> str:
        """Status at the end of the way to u (n_a,) mm, by way of those in `via`."""
        if self.table is not None and self.at.any() and not u.any():
            return self.let_go((*via, u))
        stands = self._at_surface and self.table is not None and (self.last is None or self.on_table() > 0)
        longest, status = np.inf if self.glued else self._longest * (CLOSING if stands else 1.0), CONVERGED
        for target in (*via, u):
            if status == CONVERGED:
                status = carried_out(self.at, target, longest, lambda there: self._go(there, self.load))
        return status

    def let_go(self, way: Sequence[np.ndarray]) -> str:
        """Along a way of displacements (n_a,) mm, which ends at rest: how that ended. Where the robots do not hold the
        object any more and the table does not bear it yet, it slides down (`_slide`)."""
        for target in way:
            begin, longest = self.at, OPENING * self._longest
            steps = int(np.ceil(float((np.abs(target - begin) / longest).max())))
            for share in np.linspace(0.0, 1.0, 1 + steps)[1:]:
                u = begin + share * (target - begin)
                status = self._go(u, self.load)
                status = self._slide(u) if status != CONVERGED else status
                if status != CONVERGED:
                    return status
        return CONVERGED

    def _slide(self, u: np.ndarray) -> str:
        """Status after the slide to a balance at u (n_a,) mm that no step leads to. The object goes as a viscous drag
        has it, faster and faster, until it stays; inertia is left out."""
        before = self.last, self.fingers, self.at
        arms = (self._points(self.last) if self.table is None else self.table.points) - self._held.centre
        size = float(np.linalg.norm(arms, axis=1).max())
        force = self.load * self.load_of_object if self.load else self.forces().sum(axis=0)
        mobility = SLIDES / float(np.linalg.norm(force))
        for _ in range(LASTS):
            mobilities = mobility * np.array([1.0] * 3 + [1 / size**2] * 3)[: len(self._held.wrench)]
            state, fingers = self._found(u, self.load, mobilities)
            if not state.converged:
                mobility *= SLOWER
                continue
            moved = float(np.linalg.norm(state.around.gone * np.array([1.0] * 3 + [size] * 3)[: len(mobilities)]))
            self.last, self.fingers, self.at, mobility = state, fingers, u, mobility * FASTER
            if moved < SLIDES and self._go(u, self.load) == CONVERGED:
                return CONVERGED
        self.last, self.fingers, self.at = before
        return "the object slides off and finds no balance"

    def alone(self) -> tuple[str, float]:
        """Status and motion (mm) of the object on its table when the robots are taken away as they stand: how that
        balance ended, and how far the object goes."""
        last, n_points = self.last, self.parts[-1][1]
        before = replace(last, solved=last.solved[-1:], modes=last.modes[n_points:], stuck=last.stuck[n_points:])
        held = replace(self._held, load=self.load * self._held.load)
        state = grasp_step([self.table], [displacement(np.zeros(0))], held, self._law, self._mu, before)
        return state.status.value, float(np.linalg.norm(state.around.x - last.around.x))

    def _go(self, u: np.ndarray, load: float) -> str:
        """Status of one step, which is kept where it converges."""
        state, fingers = self._found(u, load)
        status = state.status.value if not state.converged else self._lost(state, u)
        if status == CONVERGED:
            self.last, self.fingers, self.at, self.load = state, fingers, u, load
        else:
            self.stuck += 1
        return status

    def _found(
        self, u: np.ndarray, load: float, mobility: np.ndarray | None = None
    ) -> tuple[PointsState, Sequence[PointRobot]]:
        """State after one step from where the plant stands, and the robots with the contact points that it has."""
        parts = [displacement(u[a:b]) for a, b in zip(self._ends[:-1], self._ends[1:], strict=True)]
        held = replace(self._held, load=load * self._held.load, mobility=mobility, carried=self.carried)
        table = () if self.table is None else (self.table,)
        parts += [displacement(np.zeros(0)) for _ in table]
        robots, before = chosen([*self.fingers, *table], self.last, held if self.last is None else self.last.around)
        for _ in range(JOINS):
            state = grasp_step(robots, parts, held, self._law, self._mu, before)
            self.steps += 1
            self.iterations += state.iterations
            more = joined(robots, before, state) if state.converged else None
            if more is None:
                return state, robots[: len(self.fingers)]
            robots, before = more
        return replace(state, status=StepStatus.MANY), robots[: len(self.fingers)]

    def _lost(self, state: PointsState, u: np.ndarray) -> str:
        """Status of what solves the equations: whether glue holds the object stably, and whether the state is a step
        from `last`, as an object without load may be anywhere once nothing touches it."""
        if self.glued:
            return CONVERGED if self._stiffness(state)[0] > 0 else BUCKLES
        if self.last is None or all(mode is Mode.OPEN for mode in self.last.modes):
            return CONVERGED
        if all(mode is Mode.OPEN for mode in state.modes):
            return "the robots let go of the object"
        moved = float(np.linalg.norm(state.around.x[:3] - self.last.around.x[:3]))
        commanded = float((np.abs(u - self.at) / self._longest).max())
        if commanded > 0 and moved > LEVERAGE * commanded:
            return f"the object would jump by {moved:.2g} mm, to where the robots hold it otherwise"
        return CONVERGED
