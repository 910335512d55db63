"""A robot without finite elements: nodes, energy and compliance are closed forms of delta_a, of which `solve` finds the
one that an actuation asks for by Newton's method. Its first node carries delta_a, so a start tells where it stands."""

import time
from dataclasses import dataclass

import numpy as np
from surrogate import synthetic as closed_form

from cfem.condensed import Condensed, Rows
from cfem.equilibrium.actuation import Actuation
from cfem.equilibrium.solution import Equilibrium, State, Status
from cfem.sample.solver import Facts

ROWS = Rows(("tip.x", "tip.y", "tip.z"), ("left", "right"))
FACTS = Facts("synthetic", ROWS, np.array([[0.0, 20.0], [0.0, 20.0]]), np.array([0.0, 10.0, -120.0]), 120.0)


@dataclass(frozen=True)
class Factory:
    """delay: seconds a solve takes at least; fails_beyond: mm of mean shortening that the robot cannot reach."""

    delay: float = 0.0
    fails_beyond: float = np.inf

    def __call__(self) -> "SyntheticSolver":
        return SyntheticSolver(self.delay, self.fails_beyond)


@dataclass(frozen=True)
class SyntheticSolver:
    delay: float = 0.0
    fails_beyond: float = np.inf
    facts: Facts = FACTS

    def solve(self, actuation: Actuation, start: State | None) -> Equilibrium:
        time.sleep(self.delay)
        delta = np.zeros(2) if start is None else start.x[0, :2].copy()
        C, m = actuation.C, len(actuation.C)
        mu = np.zeros(m)
        iterations = 0
        while True:
            _, (lam,), (stiffness,) = closed_form.energy(delta[None])
            residual = np.concatenate([lam - actuation.offset - C.T @ mu, C @ delta - actuation.target])
            if np.abs(residual).max() < 1e-10 or iterations == 60:
                break
            iterations += 1
            step = np.linalg.solve(np.block([[stiffness, -C.T], [C, np.zeros((m, m))]]), -residual)
            delta, mu = delta + step[:2] * min(1.0, 4 / np.abs(step[:2]).max()), mu + step[2:]
        status = Status.CONVERGED if delta.mean() <= self.fails_beyond else Status.STEP_TOO_SMALL
        return equilibrium(delta, iterations, status)


def nodes(delta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n, 3) and their derivative (n, 3, 2): an arc that bends with the mean and leans with the difference."""
    place = np.linspace(10.0, 120.0, 8)
    bend, lean = 0.02 * delta.sum() / 2 * place / 20, (delta[0] - delta[1]) / 10
    x = np.column_stack([lean * np.cos(bend) * place / 20, place * np.sin(bend), -place * np.cos(bend)])
    by_bend = np.column_stack([-lean * np.sin(bend) * place / 20, place * np.cos(bend), place * np.sin(bend)])
    by_bend = by_bend * (0.01 * place / 20)[:, None]
    by_lean = np.column_stack([np.cos(bend) * place / 200, np.zeros((8, 2))])
    carrier = np.array([[[1.0, 0.0], [0.0, 1.0], [0.0, 0.0]]])
    dx = np.concatenate([carrier, np.stack([by_bend + by_lean, by_bend - by_lean], axis=-1)])
    return np.vstack([[*delta, 0.0], x]), dx


def equilibrium(delta: np.ndarray, iterations: int, status: Status) -> Equilibrium:
    psi, lam, stiffness = (value[0] for value in closed_form.energy(delta[None]))
    e, gradient = (value[0] for value in closed_form.effector(delta[None]))
    W_aa = np.linalg.inv(stiffness)
    W_ea = gradient @ W_aa
    W = np.block([[closed_form.locked_compliance(delta[None])[0] + W_ea @ gradient.T, W_ea], [W_ea.T, W_aa]])
    W = (W + W.T) / 2
    x, dx = nodes(delta)
    return Equilibrium(
        status=status,
        state=State(x, np.empty(0), lam),
        n_a=2,
        delta=delta,
        delta_e=e,
        slack=np.abs(lam) < 1e-9,
        energy=float(psi),
        residual=1e-12,
        rounding=1e-15,
        path=1.0,
        iterations=iterations,
        factorizations=iterations,
        steps=1,
        seconds=0.0,
        condensed=Condensed(ROWS, W, np.concatenate([e, delta]) - W[:, 3:] @ lam, lam),
        response=dx @ W_aa,
    )
