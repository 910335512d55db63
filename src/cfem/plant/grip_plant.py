"""FE robots and an object that they only touch, as the plant: contact points open, stick and slide."""

from collections import Counter
from collections.abc import Sequence

import numpy as np

from cfem.contact.problem import Law
from cfem.equilibrium.actuation import displacement
from cfem.equilibrium.grip import Free, grip
from cfem.equilibrium.touch import PlacedRobot, Touch
from cfem.plant.protocol import Command, Measurement

LONGEST = 1.0  # mm that an actuator goes in one quasi-static step: friction depends on the way
SHORTEST = 1 / 64  # of a command: a way that is cut further than this ends


class GripPlant:
    """`Plant`. ends: where each robot's actuators begin and end; object_points (k, 3) mm of the object at rest, which
    `x` shows behind the robots' nodes; grasp: (n_a,) mm, how the first command begins, so that something is held.

    counts: how many contact points were open, stuck and slipped at the end of each command so far; steps, iterations,
    failures: quasi-static steps, rounds of FE solves that they took, commands that ended before their goal"""

    def __init__(
        self,
        fingers: Sequence[PlacedRobot],
        ends: np.ndarray,
        held: Free,
        law: Law,
        mu: float,
        object_points: np.ndarray,
        grasp: np.ndarray | None = None,
    ):
        self._fingers, self._ends, self._held, self._law, self._mu = fingers, ends, held, law, mu
        self._object_points, self._grasp = object_points, grasp
        self._at, self._last, self._t = np.zeros(int(ends[-1])), None, 0
        self.counts: list[dict[str, int]] = []
        self.steps, self.iterations, self.failures, self.worst = 0, 0, 0, 0.0

    @property
    def x(self) -> np.ndarray:
        """(n, 3) mm nodes of all robots, one after the other, and the points of the object."""
        last = self._last
        if last is None:
            nodes = [one.problem.rest @ one.turn.T + one.shift for one in self._fingers]
            return np.concatenate([*nodes, self._object_points])
        solved = zip(self._fingers, last.solved, strict=True)
        nodes = [one.state.x @ finger.turn.T + finger.shift for finger, one in solved]
        return np.concatenate([*nodes, last.around.now(self._object_points)])

    def step(self, u: np.ndarray, kind: Command = "displacement") -> Measurement:
        """Displacements (n_a,) mm, in quasi-static steps; where a step fails it is halved, and where the shortest fails
        the state is the last one that was found, and the status says why."""
        self._t += 1
        if self._last is None and self._grasp is not None:
            self._towards(self._grasp)
        status = self._towards(np.asarray(u, float))
        if status != "converged":
            self.failures += 1
        last = self._last
        if last is None or kind != "displacement":
            return Measurement.failed(3, len(self._at), self._t, status)
        self.counts.append(dict(Counter(mode.value for mode in last.modes)))
        self.worst = max(self.worst, last.check.largest)
        delta_a, lambda_a = (
            np.concatenate([getattr(one, key) for one in last.solved]) for key in ("delta_a", "lambda_a")
        )
        return Measurement(self._held.centre + last.around.x, delta_a, lambda_a, self._t, status)

    def _towards(self, u: np.ndarray) -> str:
        """How it ended."""
        begin, share = self._at, 0.0
        way = u - begin
        size = min(1.0, LONGEST / max(float(np.abs(way).max()), LONGEST))
        while share < 1.0:
            there = min(1.0, share + size)
            found = self._go(begin + there * way)
            if found.converged:
                share, self._last, self._at = there, found, begin + there * way
                size *= 2 if size < LONGEST / max(float(np.abs(way).max()), LONGEST) else 1
            elif size > SHORTEST:
                size /= 2
            else:
                return f"{found.status.value}, at {100 * share:.0f} % of the way"
        return "converged"

    def _go(self, u: np.ndarray) -> Touch:
        parts = [displacement(u[a:b]) for a, b in zip(self._ends[:-1], self._ends[1:], strict=True)]
        found = grip(self._fingers, parts, self._held, self._law, self._mu, self._last)
        self.steps += 1
        self.iterations += found.iterations
        return found

    def account(self) -> dict:
        """What a results file says of it."""
        total = {mode: sum(one.get(mode, 0) for one in self.counts) for mode in ("open", "stick", "slip")}
        return {
            "commands": self._t,
            "failures": self.failures,
            "points": total,
            "steps": self.steps,
            "iterations": self.iterations,
            "law_residual": self.worst,
        }

    def sentence(self) -> str:
        """For people."""
        points = ", ".join(f"{count} {mode}" for mode, count in self.account()["points"].items())
        return (
            f"contact: {self._t - self.failures} of {self._t} commands carried out; after them points {points}; "
            f"{self.steps} quasi-static steps, {self.iterations} rounds of FE; the law is met to {self.worst:.1e}"
        )
