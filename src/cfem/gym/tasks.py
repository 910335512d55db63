"""Tasks of the environments: goals, observations and rewards of each, for a batch at once.

Everything that a policy observes is known where a robot works: the measured effector, the last command, the goal. An
observation is a row of numbers of about 1:

    (goal - x) / scale      how far the goal of the end of the tick that follows is, n_e
    (goal - x) / (5 near)   the same near the goal, n_e, at most 1
    (goal' - goal) / near   how far it goes on in the tick after that, n_e; Press: force that is missing, see there
    (x - x_rest) / scale    where the effector is, n_e
    2 u / reach - 1         the last command, n_a
    2 share - 1             where the robot is told its parameters: of the range of each (`observe_parameters`), n_p

An action in [-1, 1]^n_a changes the command by at most `step`. Rewards are exp(-error / near) - error / scale: without
the first term the last millimetre hardly counts."""

from dataclasses import dataclass

import numpy as np

from cfem.core.errors import InputError
from cfem.gym.robots import Robots, RobotStates

LARGEST = 10.0  # number in an observation


@dataclass(frozen=True)
class Scales:
    """Units of observations and commands.

    scale: mm, about how far the effector goes
    near: mm
    step: mm of command a tick
    low, reach: (n_a,) mm"""

    scale: float
    near: float
    step: np.ndarray
    low: np.ndarray
    reach: np.ndarray

    def command(self, u: np.ndarray, actions: np.ndarray) -> np.ndarray:
        """Commands (..., n_a) that follow u (..., n_a) by actions (..., n_a) in [-1, 1]."""
        move = np.clip(np.nan_to_num(np.asarray(actions, float)), -1.0, 1.0) * self.step
        return np.clip(u + move, self.low, self.reach)

    def reward(self, errors: np.ndarray) -> np.ndarray:
        """Rewards of errors mm."""
        return np.exp(-errors / self.near) - errors / self.scale


def observation(
    scales: Scales, tip: np.ndarray, u: np.ndarray, goal: np.ndarray, ahead: np.ndarray, parameters: np.ndarray
) -> np.ndarray:
    """Observation (B, 4 n_e + n_a + k) float32: tip, goal, ahead (B, n_e) mm from rest, ahead from goal, u (B, n_a) mm,
    parameters (B, k) in [-1, 1] of the robot."""
    share = 2.0 * (u - scales.low) / (scales.reach - scales.low) - 1.0
    errors = goal - tip
    close = np.clip(errors / (5 * scales.near), -1.0, 1.0)
    parts = [errors / scales.scale, close, ahead / scales.near, tip / scales.scale, share, parameters]
    observed = np.concatenate(parts, axis=1, dtype=np.float32, casting="same_kind")
    return np.clip(observed, -LARGEST, LARGEST, out=observed)


class Reach:
    """Goals that stay where they are for an episode, drawn from where the robot can be. robots; p (m, n_p): those of
    which episodes are, each with goals of its own."""

    length, needs, loaded = 50, (), ()
    goals_move = False  # during an episode

    def __init__(self, robots: Robots, p: np.ndarray, rng: np.random.Generator):
        self._pool, self._p = robots.feasible(rng, p), p
        self.scale = float(np.ptp(self._pool.tip, axis=0).max())
        self.near = 0.02 * self.scale

    def begin(self, goals: "Goals", robots: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Draws goals for new episodes of `robots` (k,), numbers in the batch, and returns their parameters
        (k, n_p)."""
        chosen = rng.integers(len(self._pool.tip), size=len(robots))
        goals.path[robots] = self._pool.tip[chosen][:, None]
        return self._p[chosen]

    def tip(self, states: RobotStates, goals: "Goals") -> np.ndarray:
        """Displacements (B, n_e) mm of the effectors, where a camera sees them."""
        return states.tip

    def errors(self, states: RobotStates, goals: "Goals", t: np.ndarray) -> np.ndarray:
        """Errors (B,) mm of the effectors."""
        errors = states.tip - goals.now(t)
        return np.sqrt(np.einsum("bi,bi->b", errors, errors))

    def ahead(self, states: RobotStates, goals: "Goals", t: np.ndarray) -> np.ndarray:
        """Way (B, n_e) mm to where the goal will be in the next tick."""
        return goals.now(t + 1) - goals.now(t)


class Follow(Reach):
    """Goals that go round a closed curve: the image of an ellipse of pulls, of random size, phase and pace."""

    length, curves, goals_move = 100, 1024, True

    def __init__(self, robots: Robots, p: np.ndarray, rng: np.random.Generator):
        """Draws closed curves that the robots can follow, under their loads. InputError where they can follow none."""
        super().__init__(robots, p, rng)
        self._load = self._loads(robots, rng)
        self._p = p[: self.curves]
        states, places = robots.start(len(self._p)), []
        states.delta_a[:] = robots.model.domain.states[0, : len(robots.largest_force)]
        within = np.ones(len(self._p), dtype=bool)
        for share in self._shares(rng, (len(self._p), len(robots.largest_force))):
            states = robots.move(states, robots.forces(share, self._p), self._p, forces=True, loads=self._load)
            within &= robots.within_reach(states)
            places.append(states.tip)
        if not within.any():
            what = f"none of {len(within)} curves drawn lies within the reach of the actuators"
            raise InputError(what, do="give the actuators of the scene more reach, and sample again")
        self._p, self._curves = self._p[within], np.stack(places, axis=1)[within]
        self._load = None if self._load is None else self._load[within]

    def _loads(self, robots: Robots, rng: np.random.Generator) -> np.ndarray | None:
        return None

    def _shares(self, rng: np.random.Generator, size: tuple[int, int]) -> np.ndarray:
        """Shares (length + 1, *size) of the largest forces, tick by tick."""
        turn = np.linspace(0, 2 * np.pi, self.length + 1)[:, None, None]
        centre, radius = rng.uniform(0.25, 0.5, size), rng.uniform(0.05, 0.2, size)
        phase, pace = rng.uniform(0, 2 * np.pi, size), rng.uniform(0.5, 2.0, (size[0], 1))
        return centre + radius * np.cos(pace * turn + phase)

    def begin(self, goals: "Goals", robots: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        chosen = rng.integers(len(self._curves), size=len(robots))
        goals.path[robots] = self._curves[chosen]
        if self._load is not None:
            goals.load[robots] = self._load[chosen]
        return self._p[chosen]


class Carry(Follow):
    """A weight that hangs from the first effector, unknown to the policy, is to be carried from one place to another:
    held for a fifth of the episode, moved with a smooth start and end, held again. Weights pull along -z of the scene,
    and move the robot by at most about 5 % of its workspace; they count to the first order (`Robots.move`)."""

    loaded = (2,)

    def _loads(self, robots: Robots, rng: np.random.Generator) -> np.ndarray:
        pool = self._pool
        softer = Robots(robots.model, ("effector_compliance",)).move(pool, pool.delta_a, self._p).compliance
        softest = np.median(softer[:, 2, 2])
        return -0.05 * self.scale / softest * rng.random((self.curves, 1))

    def _shares(self, rng: np.random.Generator, size: tuple[int, int]) -> np.ndarray:
        begin, end = rng.uniform(0.15, 0.65, size), rng.uniform(0.15, 0.65, size)
        s = np.clip((np.linspace(0, 1, self.length + 1)[:, None, None] - 0.2) / 0.6, 0.0, 1.0)
        return begin + (end - begin) * s**3 * (10 - 15 * s + 6 * s**2)


class Press(Reach):
    """A plane without friction, through a place that the robot can reach, is to be pressed with a stated force. Contact
    pushes the effector back by its compliance C at locked actuators, to the first order: with the gap g of the free
    effector and the plane's normal n, f = max(-g, 0) / (n . C n). Forces count as the depth by which a free effector
    would be behind the plane, so that errors are in mm; the third part of the observation is the depth that is missing,
    along -n."""

    needs = ("effector_compliance",)

    def __init__(self, robots: Robots, p: np.ndarray, rng: np.random.Generator):
        super().__init__(robots, p, rng)
        tips = self._pool.tip
        self._normal = -tips / np.maximum(np.linalg.norm(tips, axis=1, keepdims=True), 1e-9)
        self._depth = 0.05 * self.scale * rng.uniform(0.2, 1.0, len(p))

    def begin(self, goals: "Goals", robots: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        chosen = rng.integers(len(self._depth), size=len(robots))
        goals.normal[robots], goals.depth[robots] = self._normal[chosen], self._depth[chosen]
        goals.path[robots] = self._pool.tip[chosen][:, None]
        return self._p[chosen]

    def force(self, states: RobotStates, goals: "Goals") -> np.ndarray:
        """Forces (B,) N on the plane."""
        return np.maximum(-self._gap(states, goals), 0.0) / self._soft(states, goals)

    def tip(self, states: RobotStates, goals: "Goals") -> np.ndarray:
        back = np.einsum("bij,bj->bi", states.compliance, goals.normal)
        return states.tip + back * self.force(states, goals)[:, None]

    def errors(self, states: RobotStates, goals: "Goals", t: np.ndarray) -> np.ndarray:
        return np.abs(self._gap(states, goals) + goals.depth)

    def ahead(self, states: RobotStates, goals: "Goals", t: np.ndarray) -> np.ndarray:
        missing = goals.depth - np.maximum(-self._gap(states, goals), 0.0)
        return -goals.normal * missing[:, None]

    def _gap(self, states: RobotStates, goals: "Goals") -> np.ndarray:
        return ((states.tip - goals.path[:, 0]) * goals.normal).sum(axis=1)

    def _soft(self, states: RobotStates, goals: "Goals") -> np.ndarray:
        n = goals.normal
        return np.maximum(np.einsum("bi,bij,bj->b", n, states.compliance, n), 1e-9)


@dataclass
class Goals:
    """Goals of a batch."""

    path: np.ndarray  # (B, T + 1, n_e) mm from rest at each tick, or (B, 1, n_e) of goals that stay
    normal: np.ndarray  # (B, n_e) of the plane there, of Press
    depth: np.ndarray  # (B,) mm, of Press
    load: np.ndarray  # (B, 1) N along z, of Carry

    @classmethod
    def of(cls, task: Reach, count: int, n_e: int) -> "Goals":
        """Goals of `count` robots before their first episode."""
        path = np.zeros((count, task.length + 1 if task.goals_move else 1, n_e))
        return cls(path, np.zeros((count, n_e)), np.zeros(count), np.zeros((count, len(task.loaded))))

    def now(self, t: np.ndarray) -> np.ndarray:
        """Goals (B, n_e) at ticks t (B,), the last one after the end of their path."""
        if self.path.shape[1] == 1:
            return self.path[:, 0]
        return self.path[np.arange(len(t)), np.minimum(t, self.path.shape[1] - 1)]


TASKS = {"reach": Reach, "follow": Follow, "press": Press, "carry": Carry}
