"""What the robots shall do: goals, observations and rewards of each task, for a batch at once.

Everything that a policy observes is known where a robot works: the measured effector, the last command, the goal. An
observation is a row of numbers of about 1:

    (goal - x) / scale      how far the goal is, n_e
    (goal - x) / (5 near)   the same near the goal, n_e, at most 1
    (goal' - goal) / near   how far the goal goes on in the next tick, n_e; Press: force that is missing, see there
    (x - x_rest) / scale    where the effector is, n_e
    2 u / reach - 1         the last command, n_a

An action in [-1, 1]^n_a changes the command by at most `step`. Rewards are exp(-error / near) - error / scale: without
the first term the last millimetre hardly counts."""

from dataclasses import dataclass

import numpy as np

from cfem.gym.robots import Robots, States

LARGEST = 10.0  # number in an observation


@dataclass(frozen=True)
class Scales:
    """scale: mm, about how far the effector goes; near: mm; step: mm of command a tick; low, reach: (n_a,) mm."""

    scale: float
    near: float
    step: np.ndarray
    low: np.ndarray
    reach: np.ndarray


def observation(scales: Scales, tip: np.ndarray, u: np.ndarray, goal: np.ndarray, ahead: np.ndarray) -> np.ndarray:
    """tip, goal, ahead (B, n_e) mm from rest, ahead from goal, u (B, n_a) mm -> (B, 4 n_e + n_a) float32."""
    share = 2.0 * (u - scales.low) / (scales.reach - scales.low) - 1.0
    off = goal - tip
    close = np.clip(off / (5 * scales.near), -1.0, 1.0)
    parts = [off / scales.scale, close, ahead / scales.near, tip / scales.scale, share]
    return np.clip(np.concatenate(parts, axis=1), -LARGEST, LARGEST).astype(np.float32)


class Reach:
    """Goals that stay where they are for an episode, drawn from where the robot can be."""

    length, compliance = 50, False

    def __init__(self, robots: Robots, rng: np.random.Generator, pool: int = 4096):
        self._pool = robots.feasible(rng, pool)
        self.scale = float(np.ptp(self._pool.tip, axis=0).max())
        self.near = 0.02 * self.scale

    def begin(self, goals: "Goals", which: np.ndarray, rng: np.random.Generator) -> None:
        goals.path[which] = self._pool.tip[rng.integers(len(self._pool.tip), size=len(which))][:, None]

    def tip(self, states: States, goals: "Goals") -> np.ndarray:
        """(B, n_e) mm from rest, where a camera sees it."""
        return states.tip

    def errors(self, states: States, goals: "Goals", t: np.ndarray) -> np.ndarray:
        """(B,) mm."""
        return np.linalg.norm(states.tip - goals.now(t), axis=1)

    def ahead(self, states: States, goals: "Goals", t: np.ndarray) -> np.ndarray:
        """(B, n_e) mm to where the goal will be in the next tick."""
        return goals.now(t + 1) - goals.now(t)


class Follow(Reach):
    """Goals that go round a closed curve: the image of an ellipse of pulls, of random size, phase and pace."""

    length = 100

    def __init__(self, robots: Robots, rng: np.random.Generator, pool: int = 256):
        super().__init__(robots, rng)
        n_a, turn = len(robots.largest_force), np.linspace(0, 2 * np.pi, self.length + 1)
        centre, radius = rng.uniform(0.25, 0.5, (pool, n_a)), rng.uniform(0.05, 0.2, (pool, n_a))
        phase, pace = rng.uniform(0, 2 * np.pi, (pool, n_a)), rng.uniform(0.5, 2.0, (pool, 1, 1))
        share = centre[:, None] + radius[:, None] * np.cos(pace * turn[:, None] + phase[:, None])
        states, curves = robots.start(pool), []
        states.delta_a[:] = robots.model.domain.states[0, :n_a]
        for k in range(len(turn)):
            states = robots.move(states, share[:, k] * robots.largest_force, forces=True)
            curves.append(states.tip)
        self._curves = np.stack(curves, axis=1)

    def begin(self, goals: "Goals", which: np.ndarray, rng: np.random.Generator) -> None:
        goals.path[which] = self._curves[rng.integers(len(self._curves), size=len(which))]


class Press(Reach):
    """A plane without friction, through a place that the robot can reach, is to be pressed with a stated force. Contact
    pushes the effector back by its compliance C at locked actuators, to the first order: with the gap g of the free
    effector and the plane's normal n, f = max(-g, 0) / (n . C n). Forces count as the depth by which a free effector
    would be behind the plane, so that errors are in mm; the third part of the observation is the depth that is missing,
    along -n."""

    compliance = True

    def __init__(self, robots: Robots, rng: np.random.Generator, pool: int = 4096):
        super().__init__(robots, rng, pool)
        way = self._pool.tip
        self._normal = -way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-9)
        self._depth = 0.05 * self.scale * rng.uniform(0.2, 1.0, pool)

    def begin(self, goals: "Goals", which: np.ndarray, rng: np.random.Generator) -> None:
        chosen = rng.integers(len(self._depth), size=len(which))
        goals.normal[which], goals.depth[which] = self._normal[chosen], self._depth[chosen]
        goals.path[which] = self._pool.tip[chosen][:, None]

    def force(self, states: States, goals: "Goals") -> np.ndarray:
        """(B,) N on the plane."""
        return np.maximum(-self._gap(states, goals), 0.0) / self._soft(states, goals)

    def tip(self, states: States, goals: "Goals") -> np.ndarray:
        back = np.einsum("bij,bj->bi", states.compliance, goals.normal)
        return states.tip + back * self.force(states, goals)[:, None]

    def errors(self, states: States, goals: "Goals", t: np.ndarray) -> np.ndarray:
        return np.abs(self._gap(states, goals) + goals.depth)

    def ahead(self, states: States, goals: "Goals", t: np.ndarray) -> np.ndarray:
        missing = goals.depth - np.maximum(-self._gap(states, goals), 0.0)
        return -goals.normal * missing[:, None]

    def _gap(self, states: States, goals: "Goals") -> np.ndarray:
        return ((states.tip - goals.path[:, 0]) * goals.normal).sum(axis=1)

    def _soft(self, states: States, goals: "Goals") -> np.ndarray:
        n = goals.normal
        return np.maximum(np.einsum("bi,bij,bj->b", n, states.compliance, n), 1e-9)


@dataclass
class Goals:
    """path (B, T + 1, n_e) mm from rest at each tick; of Press: normal (B, n_e) of the plane there, depth (B,) mm."""

    path: np.ndarray
    normal: np.ndarray
    depth: np.ndarray

    def now(self, t: np.ndarray) -> np.ndarray:
        """(B, n_e) at ticks t (B,)."""
        return self.path[np.arange(len(t)), np.minimum(t, self.path.shape[1] - 1)]


TASKS = {"reach": Reach, "follow": Follow, "press": Press}
