"""One robot of several that press each other: Newton's corrections of it, whose forces on patches are still open.

With A dx = -R + H_a dlambda_a + H_c df, the actuators held and their rows eliminated, its patches go by

    shift + C df        C = W_cc - W_ca W_aa^-1 W_ac

The factor of A serves on while corrections fall (`cfem.equilibrium.newton`)."""

import numpy as np

from cfem.equilibrium.actuation import displacement
from cfem.equilibrium.contact.held_patch import held
from cfem.equilibrium.contact.patch_compliance import with_patches
from cfem.equilibrium.contact.skinned_robot import SkinnedRobot
from cfem.equilibrium.evaluation import Evaluation, SolveCost, Tangent
from cfem.equilibrium.newton import Correction, NewtonSettings, advanced, closed
from cfem.equilibrium.problem import Problem
from cfem.equilibrium.solution import Equilibrium, State
from cfem.equilibrium.solve import Wanted, solve

STRICT = NewtonSettings(tolerance=1e-11)
_NONE = 1e-9  # of the largest multiplier, or of the body's size: a cable that pushes, or lacks, by less does not


class PressedRobot:
    """A robot on its way from the state `before` to delta (n_a,) mm.

    patches: (c,) those that may carry forces, by their numbers in the robot
    lam: N of actuators and of these, in its frame
    taut: (n_a,) which actuators hold"""

    def __init__(self, robot: SkinnedRobot, delta: np.ndarray, before: Equilibrium, cost: SolveCost):
        """Begins at the state `before`, without patches; cost counts the factorisations."""
        self.of, self.delta, self.cost = robot, delta, cost
        self.taut = ~(before.slack & (delta <= before.delta_a))
        self._tried = {tuple(self.taut)}
        self.patches, self.problem, state = np.zeros(0, dtype=np.int64), robot.problem, before.state
        self.lam = np.where(self.taut, before.lambda_a, 0.0)
        self.x, self.at = state.x, self._evaluate(state.x, state.pressure, state.load)
        self._size, self._part, self._fresh = np.inf, 1.0, False
        self._last, self._growth = np.inf, 0  # of fresh corrections
        self._begin: Evaluation | None = None
        self._tangent: Tangent | None = None

    def _evaluate(self, x: np.ndarray, pressure: np.ndarray, load: float) -> Evaluation:
        return self.problem.evaluate(self.problem.kinematics.hold(x), pressure, load)

    def choose(self, numbers: np.ndarray, forces: np.ndarray) -> None:
        """These patches (c,), under forces (c, 3) N in the robot's frame."""
        if np.array_equal(numbers, self.patches):
            return
        touched = with_patches(self.of.robot, self.of.nodes, self.of.patches, numbers)
        self.patches, self.problem = numbers, Problem(touched, like=self.of.problem)
        self.lam = np.concatenate([self.lam[: len(self.delta)], forces.ravel()])
        self.at = self._evaluate(self.at.x, self.at.pressure, self.at.load)
        self._border()

    @property
    def forces(self) -> np.ndarray:
        """(c, 3) N."""
        return self.lam[len(self.delta) :].reshape(-1, 3)

    @property
    def _held(self) -> np.ndarray:
        """(n,) bool of the rows whose multipliers are open: taut actuators, and patches."""
        return np.concatenate([self.taut, np.ones(3 * len(self.patches), dtype=bool)])

    def _border(self) -> None:
        if self._tangent is not None:
            H = self.at.H[:, self._held]
            self._Z = self._tangent.factor.solve(H) if H.size else H

    def linear(self) -> tuple[np.ndarray, np.ndarray]:
        """Linearisation of the patches, shift (3 c,) mm and C (3 c, 3 c) mm/N, by the factor at hand. Raises
        SingularMatrixError and LinAlgError."""
        self._fresh = self._tangent is None
        if self._tangent is None:
            self._tangent = self.problem.factor(self.at, self.lam, self.cost, self._begin)
            self._border()
        n = int(self.taut.sum())
        imbalance = self.at.residual(self.lam) + self.problem.pressure_residual(self.at, self._tangent)
        self._free = -self._tangent.factor.solve(imbalance[:, None])[:, 0]
        H = self.at.H[:, self._held]
        S, goes = H.T @ self._Z, H.T @ self._free
        self._pull = np.linalg.solve(S[:n, :n], (self.delta - self.at.delta[: len(self.delta)])[self.taut] - goes[:n])
        self._relief = np.linalg.solve(S[:n, :n], S[:n, n:])
        C = S[n:, n:] - S[n:, :n] @ self._relief
        return goes[n:] + S[n:, :n] @ self._pull, (C + C.T) / 2

    def correct(self, df: np.ndarray) -> None:
        """The correction with a change df (3 c,) N of the forces."""
        mu = np.concatenate([self._pull - self._relief @ df, df])
        step, multipliers = self._free + self._Z @ mu, np.zeros(len(self.lam))
        multipliers[self._held] = mu
        self._correction = Correction(
            step, self.problem.pressure_step(self.at, self._tangent, step), multipliers, self._held
        )

    def advance(self) -> bool:
        """Takes the correction. False where it could not be taken: corrections of new factors grow, or an element is
        inverted."""
        size = self._correction.size
        if self._fresh:
            self._growth = self._growth + 1 if size > self._last else 0
            self._last = size
        trial, self._part = advanced(self.problem, self.at, self._correction)
        if trial is None or self._growth >= STRICT.max_growth or not np.isfinite(size):
            return False
        self._size, self._begin, self.at = size, self.at, trial
        self.lam = self.lam + self._part * self._correction.multipliers
        return True

    def worn(self) -> bool:
        """Drops a factor that no longer serves, so that the next correction makes its own; True where it did."""
        smallest = 1e-13 * self.of.robot.body.mesh.size
        serves = self._part == 1.0 and self._correction.size <= max(STRICT.slow * self._size, smallest)
        if self._fresh or serves:
            return False
        self._tangent = None
        return True

    @property
    def balanced(self) -> bool:
        """True where this is a state of the robot under these forces."""
        asked = displacement(self.delta).padded(len(self.lam)).only(self.taut)
        if not closed(self.problem, asked, self.at, self.lam, np.ones(len(asked.C), dtype=bool)):
            return False
        residual = self.problem.relative_residual(self.at, self.lam, self._tangent)
        return residual <= max(STRICT.tolerance, self.problem.rounding(self.at, self.lam))

    def change_slack(self) -> bool | None:
        """Lets a cable go or takes one up, as this state wants it; True where it did, None where that leads nowhere."""
        n, size = len(self.delta), self.of.robot.body.mesh.size
        largest = max(float(np.abs(self.lam).max()), self.problem.force_floor)
        pushes = np.where(self.taut & self.of.robot.unilateral, -self.lam[:n] / largest, 0.0)
        lacks = np.where(self.taut, 0.0, (self.delta - self.at.delta[:n]) / size)
        wrong = np.maximum(pushes, lacks)
        if not wrong.max(initial=0.0) > _NONE:
            return False
        self.taut[wrong.argmax()] ^= True
        if tuple(self.taut) in self._tried:
            return None
        self._tried.add(tuple(self.taut))
        self.lam[: len(self.delta)] *= self.taut
        self._border()
        return True

    def solved(self) -> Equilibrium:
        """The state, solved again with the patches held where they are."""
        actuation = held(displacement(self.delta), self.at.delta[len(self.delta) :])
        start = State(self.at.x, self.at.pressure, self.lam, self.at.load)
        return solve(self.problem, actuation, start=start, base=start, settings=STRICT, wanted=Wanted(condense=False))
