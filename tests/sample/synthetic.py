"""A robot without finite elements: nodes, energy and compliance are closed forms of delta_a, of which `solve` finds the
one that an actuation asks for by Newton's method. Its first node carries delta_a, so a start tells where it stands.
With a parameter, Poisson's ratio in its coordinate q multiplies the energy and leans the nodes."""

import time
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from surrogate import synthetic as closed_form

from cfem.condensed import Condensed, Rows
from cfem.condensed.skin import Skin
from cfem.equilibrium.system.actuation import Actuation
from cfem.equilibrium.system.solution import Equilibrium, ParameterSlopes, State, Status
from cfem.sample.solver import Facts

NONE = np.zeros(0)
ROWS = Rows(("tip.x", "tip.y", "tip.z"), ("left", "right"))
REACH, REST = np.array([[0.0, 20.0], [0.0, 20.0]]), np.array([0.0, 10.0, -120.0])
FACTS = Facts("synthetic", ROWS, REACH, REST, 120.0, np.linalg.inv(closed_form.energy(np.zeros((1, 2)))[2][0]))


@dataclass(frozen=True)
class Factory:
    """delay: seconds a solve takes at least; fails_beyond: mm of mean shortening that the robot cannot reach;
    parameters: of the robot, none or POISSON and YOUNG; third_order: solves with dW."""

    delay: float = 0.0
    fails_beyond: float = np.inf
    parameters: tuple = ()
    third_order: bool = False

    def __call__(self) -> "SyntheticSolver":
        facts = replace(FACTS, parameters=self.parameters)
        return SyntheticSolver(self.delay, self.fails_beyond, facts, self.third_order)


@dataclass(frozen=True)
class SyntheticSolver:
    delay: float = 0.0
    fails_beyond: float = np.inf
    facts: Facts = FACTS
    third_order: bool = False
    rotation_strain: ClassVar[None] = None

    def solve(self, actuation: Actuation, start: State | None, p: np.ndarray = NONE) -> Equilibrium:
        time.sleep(self.delay)
        delta = np.zeros(2) if start is None else start.x[0, :2].copy()
        C, m = actuation.C, len(actuation.C)
        mu = np.zeros(m)
        iterations = 0
        while True:
            _, (lam,), (stiffness,) = closed_form.energy(delta[None])
            lam, stiffness = factor(p) * lam, factor(p) * stiffness
            residual = np.concatenate([lam - actuation.offset - C.T @ mu, C @ delta - actuation.target])
            if np.abs(residual).max() < 1e-10 or iterations == 60:
                break
            iterations += 1
            step = np.linalg.solve(np.block([[stiffness, -C.T], [C, np.zeros((m, m))]]), -residual)
            delta, mu = delta + step[:2] * 4 / max(4.0, np.abs(step[:2]).max()), mu + step[2:]
        status = Status.CONVERGED if delta.mean() <= self.fails_beyond else Status.STEP_TOO_SMALL
        return equilibrium(delta, iterations, status, p, self.third_order)

    def roughly(self, pushed: Skin | None = None) -> "SyntheticSolver":
        return self


def factor(p: np.ndarray) -> float:
    """Of the energy."""
    return float(closed_form.stiffer(p[None])[0]) if len(p) else 1.0


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


def equilibrium(
    delta: np.ndarray, iterations: int, status: Status, p: np.ndarray = NONE, third_order: bool = False
) -> Equilibrium:
    stiffer = np.array([factor(p)])
    state = {name: value[0] for name, value in closed_form.states(delta[None], stiffer).items()}
    W, lam = (state["W"] + state["W"].T) / 2, state["lambda_a"]
    x, dx = nodes(delta)
    slopes = None
    if len(p):
        q = np.log(1 - 2 * p[0])
        lean = np.array([0.1, 0.2, 0.0])
        x[1:] += lean * q
        by_q = 0.2 * q / stiffer[0]  # of the logarithm of the factor 1 + q^2 / 10
        at_nodes = np.vstack([np.zeros(3), np.tile(lean, (len(x) - 1, 1))])
        none = np.zeros((len(state["delta_e"]), 1))
        slopes = ParameterSlopes(state["energy"] * np.array([by_q]), (lam * by_q)[:, None], none, at_nodes[..., None])
    return Equilibrium(
        status=status,
        state=State(x, np.empty(0), lam),
        n_a=2,
        delta=delta,
        delta_e=state["delta_e"],
        slack=np.abs(lam) < 1e-9,
        energy=float(state["energy"]),
        residual=1e-12,
        rounding=1e-15,
        tolerance=1e-10,
        path=1.0,
        iterations=iterations,
        factorizations=iterations,
        steps=1,
        seconds=0.0,
        condensed=Condensed(ROWS, W, state["delta_free"], lam),
        response=dx @ W[3:, 3:],
        dW=closed_form.compliance_derivatives(delta[None], stiffer)[0] if third_order else None,
        slopes=slopes,
    )
