"""One robot of several that press each other: Newton's corrections of it, whose forces on its points are still open.

With A dx = -R + H_a dlambda_a + H_c df, the actuators held and their rows eliminated, its points go by

    shift + C df        C = W_cc - W_ca W_aa^-1 W_ac

The factor of A serves on while corrections fall (`cfem.equilibrium.newton`). Forces on points are loads of its
problem, so that no row of the problem belongs to them: points that join cost their own right-hand sides alone."""

from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from cfem.equilibrium.contact.held_patch import held
from cfem.equilibrium.contact.patch_compliance import with_patches
from cfem.equilibrium.contact.skinned_robot import SkinnedRobot
from cfem.equilibrium.newton import Correction, NewtonSettings, advanced, closed
from cfem.equilibrium.solve import Wanted, solve
from cfem.equilibrium.system.actuation import displacement
from cfem.equilibrium.system.evaluation import Evaluation, SolveCost, Tangent
from cfem.equilibrium.system.problem import Problem
from cfem.equilibrium.system.solution import Equilibrium, State

STRICT = NewtonSettings(tolerance=1e-11)
AT_ONCE = 96  # right-hand sides
_NONE = 1e-9  # of the largest multiplier, or of the body's size: a cable that pushes, or lacks, by less does not


class PressedRobot:
    """A robot on its way from the state `before` to delta (n_a,) mm.

    patches: (c,) points that may carry forces, by their numbers in the robot
    forces: (c, 3) N on these, in its frame
    lam: (n_a,) N
    taut: (n_a,) which actuators hold"""

    def __init__(self, robot: SkinnedRobot, delta: np.ndarray, before: Equilibrium, cost: SolveCost):
        """Begins at the state `before`, without points; cost counts the factorisations."""
        self.of, self.delta, self.cost = robot, delta, cost
        self.taut = ~(before.slack & (delta <= before.delta_a))
        self._tried = {tuple(self.taut)}
        self.patches, self.problem, state = np.zeros(0, dtype=np.int64), robot.problem, before.state
        self.lam, self.forces = np.where(self.taut, before.lambda_a, 0.0), np.zeros((0, 3))
        self.at = self.problem.evaluate(self.problem.kinematics.hold(state.x), state.pressure, state.load)
        self._size, self._part, self._fresh = np.inf, 1.0, False
        self._last, self._growth = np.inf, 0  # of fresh corrections
        self._begin: Evaluation | None = None
        self._tangent: Tangent | None = None
        self._compliance = _Compliance()

    def choose(self, numbers: np.ndarray, forces: np.ndarray) -> None:
        """These points (c,), under forces (c, 3) N in the robot's frame."""
        if np.array_equal(numbers, self.patches):
            return
        self.patches = numbers
        self._load(self.at, forces)

    def _load(self, at: Evaluation, forces: np.ndarray) -> None:
        """Takes over a state, under other forces (c, 3) N on the points than those of the problem."""
        nodal = np.zeros((len(at.x), 3))
        nodal[self.of.nodes] = self.of.patches.weights[self.patches].T @ forces
        problem, before = self.of.problem.under(nodal), self.problem.loads
        more = problem.loads if before is None else problem.loads - before
        self.forces, self.problem = forces, problem
        self.at = replace(at, force=at.force - at.load * problem.kinematics.reduce(at.x, more))

    def _border(self) -> None:
        if self._tangent is not None:
            H = self.at.H[:, self.taut]
            self._Z = self._tangent.factor.solve(H) if H.size else H

    def linear(self) -> tuple[np.ndarray, np.ndarray]:
        """Linearisation of the points, shift (3 c,) mm and C (3 c, 3 c) mm/N, by the factor at hand. Raises
        SingularMatrixError and LinAlgError."""
        self._fresh = self._tangent is None
        if self._tangent is None:
            self._tangent = self.problem.factor(self.at, self.lam, self.cost, self._begin)
            self._compliance = _Compliance()
            self._border()
        imbalance = self.at.residual(self.lam) + self.problem.pressure_residual(self.at, self._tangent)
        self._free = -self._tangent.factor.solve(imbalance[:, None])[:, 0]
        motion = self.of.motion_of_points(self.at.x)
        self._mine = motion[:, _rows(self.patches)]
        W_cc = self._compliance.of(self.patches, motion, self._tangent)
        H, W_ac = self.at.H[:, self.taut], (self._mine.T @ self._Z).T
        W_aa = H.T @ self._Z
        self._pull = np.linalg.solve(W_aa, (self.delta - self.at.delta)[self.taut] - H.T @ self._free)
        self._relief = np.linalg.solve(W_aa, W_ac)
        C = W_cc - W_ac.T @ self._relief
        return self._mine.T @ self._free + W_ac.T @ self._pull, (C + C.T) / 2

    def correct(self, df: np.ndarray) -> None:
        """The correction with a change df (3 c,) N of the forces."""
        mu = self._pull - self._relief @ df
        step, multipliers = self._free + self._Z @ mu, np.zeros(len(self.lam))
        if df.any():
            step = step + self._tangent.factor.solve((self._mine @ df)[:, None])[:, 0]
        multipliers[self.taut] = mu
        self._df = df.reshape(-1, 3)
        self._correction = Correction(
            step, self.problem.pressure_step(self.at, self._tangent, step), multipliers, self.taut
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
        self._size, self._begin = size, self.at
        self._load(trial, self.forces + self._part * self._df)
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
        asked = displacement(self.delta).only(self.taut)
        if not closed(self.problem, asked, self.at, self.lam, np.ones(len(asked.C), dtype=bool)):
            return False
        residual = self.problem.relative_residual(self.at, self.lam, self._tangent)
        return residual <= max(STRICT.tolerance, self.problem.rounding(self.at, self.lam))

    def change_slack(self) -> bool | None:
        """Lets a cable go or takes one up, as this state wants it; True where it did, None where that leads nowhere."""
        size = self.of.robot.body.mesh.size
        largest = max(np.abs(self.lam).max(initial=0.0), np.abs(self.forces).max(initial=0.0), self.problem.force_floor)
        pushes = np.where(self.taut & self.of.robot.unilateral, -self.lam / largest, 0.0)
        lacks = np.where(self.taut, 0.0, (self.delta - self.at.delta) / size)
        wrong = np.maximum(pushes, lacks)
        if not wrong.max(initial=0.0) > _NONE:
            return False
        self.taut[wrong.argmax()] ^= True
        if tuple(self.taut) in self._tried:
            return None
        self._tried.add(tuple(self.taut))
        self.lam = self.lam * self.taut
        self._border()
        return True

    def solved(self) -> tuple[Equilibrium, float]:
        """The state, judged for its stability with the pressed points held where they are, and by how much, N, the
        forces are others then."""
        pressed = np.flatnonzero(self.forces.any(axis=1))
        touched = with_patches(self.of.robot, self.of.nodes, self.of.patches, self.patches[pressed])
        problem, lam = Problem(touched, like=self.of.problem), np.concatenate([self.lam, self.forces[pressed].ravel()])
        at = problem.evaluate(self.at.x, self.at.pressure, self.at.load)
        state, actuation = (
            State(at.x, at.pressure, lam, at.load),
            held(displacement(self.delta), at.delta[len(self.delta) :]),
        )
        solved = solve(problem, actuation, state, state, STRICT, tangent=problem.latest, wanted=Wanted(condense=False))
        return solved, float(np.abs(solved.lambda_c - self.forces[pressed].ravel()).max(initial=0.0))


class _Compliance:
    """Compliance of points by one factor: of those that were asked for so far."""

    def __init__(self) -> None:
        self.known, self.W = np.zeros(0, dtype=np.int64), np.zeros((0, 0))

    def of(self, numbers: np.ndarray, motion: sp.csc_array, tangent: Tangent) -> np.ndarray:
        """Compliance (3 c, 3 c) mm/N of the points `numbers` (c,); motion (n_dof, 3 N):
        `SkinnedRobot.motion_of_points`."""
        new = np.setdiff1d(numbers, self.known)
        if len(new):
            both = np.concatenate([self.known, new])
            old, rows = len(self.W), motion[:, _rows(both)]
            W = np.zeros((3 * len(both), 3 * len(both)))
            W[:old, :old] = self.W
            for first in range(old, len(W), AT_ONCE):
                some = slice(first, min(first + AT_ONCE, len(W)))
                W[:, some] = rows.T @ tangent.factor.solve(rows[:, some].toarray())
            W[old:, :old] = W[:old, old:].T
            self.known, self.W = both, W
        order = np.argsort(self.known)
        place = _rows(order[np.searchsorted(self.known[order], numbers)])
        return self.W[np.ix_(place, place)]


def _rows(numbers: np.ndarray) -> np.ndarray:
    return (3 * numbers[:, None] + np.arange(3)).ravel()
