"""Learned robots that grip an object by unilateral contact with friction, as a model that control plans with.

Its effectors are the object's place and, where a margin is asked for, what each robot's grip has left before it slips:

    <robot>.grip   N, mu N - margin |T|, N and T the normal force and the friction of all its points

A query walks from where the grip stands (`settle`) to the actuators that are asked for in quasi-static steps, as the FE
plant does (`cfem.plant.grip_walk`), since friction depends on the way. Derivatives are those of the last step, with
the points open, sticking and slipping as they are (`cfem.contact.law.sensitivity`)."""

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from cfem.condensed import Condensed, Rows
from cfem.condensed.rotation import inverse_left_jacobian
from cfem.contact.law.sensitivity import sensitivity
from cfem.control.closed_loop.tick import Pilot
from cfem.control.holding.on_table import lifted, put_down
from cfem.control.holding.spec import HoldingSpec
from cfem.control.search.optimality import Verdict
from cfem.control.task.obstacles.world import ObstacleWorld
from cfem.core.errors import NumericalError
from cfem.equilibrium.quasi_static import CONVERGED
from cfem.plant.grip_plant import GripPlant

MOST = 8.0  # times its load: further is not looked how much a grip holds
APART = 1e-6  # mm between robots and an object that they have let go: less is rounding
STUCK = 50  # quasi-static steps without a solution after which the search for a goal ends


@dataclass(frozen=True)
class Gripped(Condensed):
    """Condensed state of robots that grip an object.

    states: of the robots, each as its own `respond` has it
    forces: (robots, 3) N by which each pushes the object
    borne: N by the table"""

    states: tuple[Any, ...]
    forces: np.ndarray
    borne: float = 0.0


@dataclass
class Gripping:
    """Model of robots that grip an object, whose contact points may open and slide.

    grip: learned robots that hold the object at `home`
    of_object: rows of the object, and of all actuators
    names: of the robots
    mu, margin: see above, None without rows for the grip
    holds: how many times its load the grip would hold at home
    air: the same without a table, where there is one (`cfem.control.holding.on_table`)
    needs: mm or mm^3, the least preload that lifts
    before, settled_at: nothing remembered unless given (`settle`)
    margins, borne: to slip, and N by the table, where it has settled so far
    stuck: steps without a solution since it has settled"""

    grip: GripPlant
    of_object: Rows
    names: tuple[str, ...]
    mu: float
    margin: float | None
    home: np.ndarray
    holds: float | None = None
    air: "Gripping | None" = None
    needs: float | None = None
    before: GripPlant | None = None
    settled_at: np.ndarray | None = None
    margins: list[float] = field(default_factory=list)
    borne: list[float] = field(default_factory=list)
    stuck: int = 0

    @property
    def upwards(self) -> int:
        """The axis of the object's load."""
        return int(np.abs(self.grip.load_of_object).argmax())

    @property
    def rows(self) -> Rows:
        more = () if self.margin is None else tuple(f"{name}.grip" for name in self.names)
        return Rows((*self.of_object.effectors, *more), self.of_object.actuators)

    def _walked(self, delta_a: np.ndarray, via: Sequence[np.ndarray] = ()) -> GripPlant:
        """Grip after the robots have gone to delta_a (n_a,) mm, by way of those in `via`. NumericalError where there is
        no contact state."""
        if self.stuck >= STUCK:
            raise NumericalError(f"learned contact: {STUCK} steps had no solution")
        before = self.grip if self.before is None else self.before
        stands = copy(before)
        status = stands.towards(delta_a, via)
        self.stuck += stands.stuck - before.stuck
        if status != CONVERGED:
            raise NumericalError(f"learned contact: {status}")
        return stands

    def settle(self, delta_a: np.ndarray) -> None:
        """Moves the robots to delta_a (n_a,) mm, where further steps begin."""
        self.begin_search()
        self.settled_at = np.asarray(delta_a, float)
        self.before = self._walked(self.settled_at)
        if self.before.holds:
            self.margins.append(self.before.slip_margin())
        self.borne.append(self.before.on_table())
        self.begin_search()

    def begin_search(self) -> None:
        """Lets the next search fail as often as any."""
        self.stuck = 0
        if self.air is not None:
            self.air.stuck = 0

    def let_go(self, above: np.ndarray, *via: np.ndarray) -> tuple[Gripped, GripPlant]:
        """State of the object when the robots have held it at `above` (n_a,) mm and gone back to rest from there, by
        way of those in `via`. NumericalError where there is no contact state."""
        stands = replace(self, before=self._walked(above))._walked(np.zeros_like(above), via)
        return self._seen(stands), stands

    def at_displacement(self, delta_a: np.ndarray) -> Gripped:
        """Condensed state at delta_a (n_a,) mm. NumericalError where there is no contact state."""
        return self._seen(self._walked(np.asarray(delta_a, float)))

    def _seen(self, stands: GripPlant) -> Gripped:
        """Condensed state of the grip as it is."""
        J, K = self._slopes(stands)
        lam = np.concatenate([state.lambda_a for state in stands.solved])
        e, rows = stands.effectors(), self.rows
        e[:3] -= stands.centre
        W_aa = np.linalg.inv((K + K.T) / 2)
        W_ea = J @ W_aa
        W = np.block([[W_ea @ J.T, W_ea], [W_ea.T, W_aa]])
        delta = np.concatenate([e, stands.at])
        return Gripped(rows, W, delta - W[:, rows.a] @ lam, lam, stands.solved, stands.forces(), stands.on_table())

    def _slopes(self, stands: GripPlant) -> tuple[np.ndarray, np.ndarray]:
        """Slopes by the actuators: of the effectors (n_e, n_a), and of the actuators' forces (n_a, n_a) N/mm."""
        last, posed = stands.last, stands.last.posed
        by_gap, moves = sensitivity(posed.problem, last.modes, posed.force, np.zeros(posed.problem.k))
        robots = list(zip(stands.fingers, stands.solved, strict=True))
        turns = [np.kron(np.eye(len(finger.points)), finger.turn) for finger, _ in robots]
        moved = block_diag(*[turn @ state.by_actuators for turn, (_, state) in zip(turns, robots, strict=True)])
        free = posed.rotation @ np.pad(
            moved, ((0, len(posed.rotation) - len(moved)), (0, 0))
        )  # a table stays where it is
        pressed = by_gap @ free
        K = block_diag(*[state.stiffness for _, state in robots]) - free.T @ pressed
        J = moves @ free
        n_e = self.of_object.n_e
        if n_e > 3:
            J[3:] = inverse_left_jacobian(last.around.delta_e[3:]) @ J[3:]
        J = J[:n_e]
        return (J if self.margin is None else np.vstack([J, self._grips(stands, pressed)])), K

    def _grips(self, stands: GripPlant, pressed: np.ndarray) -> np.ndarray:
        """Slopes (r, n_a) of what each robot's grip has left; pressed (3 m, n_a): N/mm of the points' forces."""
        rotation = stands.last.posed.rotation
        _, friction = stands.pushes()
        slopes = []
        for (a, b), pulls in zip(stands.parts, friction, strict=True):
            mine = np.zeros((len(pressed), pressed.shape[1]))
            mine[3 * a : 3 * b] = pressed[3 * a : 3 * b]
            tangential = rotation.T @ (mine * np.tile([0.0, 1.0, 1.0], len(mine) // 3)[:, None])
            along = tangential.reshape(-1, 3, mine.shape[1])
            size = float(np.linalg.norm(pulls))
            slope = along.sum(axis=0).T @ (pulls / size if size > 0 else np.zeros(3))
            slopes.append(self.mu * mine[::3].sum(axis=0) - self.margin * slope)
        return np.array(slopes)

    def inside(self, gripped: Gripped) -> bool:
        """True if every robot's state is like those that its model was trained on."""
        return all(robot.inside(state) for robot, state in zip(self.grip.fingers, gripped.states, strict=True))

    def distance(self, gripped: Gripped) -> float:
        """Largest of the robots' distances from their training states."""
        return max(robot.distance(state) for robot, state in zip(self.grip.fingers, gripped.states, strict=True))


@dataclass(frozen=True)
class Grip(ObstacleWorld):
    """World of plans that hold an object by friction: each robot's slip margin stays above 0. fe: the plant; model: the
    first that plans."""

    fe: GripPlant
    model: Gripping

    @classmethod
    def of(cls, model: Gripping, fe: GripPlant) -> "Grip":
        k = model.rows.n_e - model.of_object.n_e
        return cls(model.rows, np.zeros(k), np.zeros(k), np.tile([0.0, np.inf], (k, 1)), fe, model)

    def pilot(self, pilot: Pilot) -> Pilot:
        """Pilot whose actuators tend to the squeeze, and which can lift an object off its table and put it down."""
        search = lifted if self.model.air else pilot.search
        return replace(super().pilot(pilot), preload=self.model.home, search=search, put_down=put_down)

    def results(self, spec: HoldingSpec, records: Sequence[Mapping]) -> tuple[dict, list[str]]:
        """Margins to slip, planned and by finite elements: figures, and a line for people."""
        model = self.model
        planned, margin = (min(plant.margins, default=np.nan) for plant in (model, self.fe))
        line = f"grip: the margin to slip is {margin:.2f} at least, {planned:.2f} planned"
        if model.margin is not None:
            line += f", {model.margin:.3g} asked for"
        if model.holds is not None:
            more = "more than " if model.holds >= MOST else ""
            line += f"; the grasp holds {more}{model.holds:.2g} times the load"
        figures, lines = {"margin": margin, "margin_planned": planned, "holds": model.holds}, [line]
        if spec.object.table:
            figures |= {"borne": self.fe.borne, "borne_planned": model.borne, "least_preload": model.needs}
            lines.append(
                f"table: the object stands on it {_at_goals(self.fe.borne)}, planned {_at_goals(model.borne)}; "
                f"a preload of {model.needs:.3g} {spec.search.preload.unit} is enough to lift it"
            )
        if not self.fe.holds:
            ended, moves = self.fe.alone()
            figures["alone"] = {"status": ended, "moves": moves, "clearance": self.fe.clearance()}
            lines.append(_opened(self.fe, ended, moves))
        lines += [
            f"{row['trajectory']}, goal {row['goal_index']}: no plan reaches it; the nearest ends "
            f"{row['predicted_distance']:.2g} mm away ({row['status']})"
            for row in records
            if row["verdict"] != Verdict.REACHED.value
        ]
        return figures, lines


def _at_goals(borne: Sequence[float]) -> str:
    """Goals at which the table bears force, in words; borne: N by the table at each goal."""
    stands = [str(goal) for goal, force in enumerate(borne) if force > 0]
    return f"at goals {', '.join(stands)} of 0 to {len(borne) - 1}" if stands else "at no goal"


def _opened(plant: GripPlant, ended: str, moves: float) -> str:
    """Sentence about the object after the robots have opened."""
    if ended != CONVERGED:
        return f"let go: the object does NOT stand without the robots: {ended}"
    clear, pressed = plant.clearance(), plant.pushes()[0].max()
    apart = f"{clear:.2g} mm away from it" if clear > APART else f"still against it with up to {1e3 * pressed:.2g} mN"
    return f"let go: the object stands on its table, the robots are {apart}; without them it moves by {moves:.1g} mm"
