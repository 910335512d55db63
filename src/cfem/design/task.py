"""Co-design: a design together with the actuation that serves it at every goal.

    minimise over z and u_1 ... u_k    sum_i |w (x_e(u_i, p(z)) + C_ee(u_i, p(z)) f_i - goal_i)|^2

0 <= z <= 1, actuators within their reach; C_ee f is what a force f on the effectors (N, held against) moves them by, to
first order, the actuators locked. One bounded least-squares problem in all unknowns, not a search within a search."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cfem.condensed.parameters import Parameter, from_shares
from cfem.parametric.family import Family
from cfem.parametric.least_squares import FitSettings, best_of, fit, spread_starts
from cfem.parametric.states import States


@dataclass(frozen=True)
class Task:
    """Goals that one design is to reach, one after the other."""

    goals: np.ndarray  # (k, n_e) mm, positions of the effectors, or displacements from rest
    from_rest: bool  # which of the two
    weights: np.ndarray  # (n_e,)
    force: np.ndarray  # (k, n_e) N on the effectors

    def reached(self, states: States) -> np.ndarray:
        """Positions or displacements (m, n_e) mm of the effectors under the force of the goal that each state is for
        (goal by goal)."""
        force = np.tile(self.force, (len(states) // len(self.goals), 1))
        moved = (states.locked_compliance @ force[..., None])[..., 0]
        return (states.delta_e if self.from_rest else states.x_e) + moved


@dataclass(frozen=True)
class Served:
    """Design with the control that serves its task.

    p: (n_p,)
    u: (k, n_a) mm
    distance: (k,) mm from each goal over the rows that matter
    states: k of them
    cost: half the sum of squares (mm^2)
    evaluations: of the model"""

    p: np.ndarray
    u: np.ndarray
    distance: np.ndarray
    states: States
    cost: float
    evaluations: int


def serve(family: Family, task: Task, free: Sequence[int], p0: np.ndarray, starts: int = 4) -> Served:
    """Best control of the goals, together with the design. free: numbers of the parameters that may vary, none for the
    best control of the design p0 (n_p,). NumericalError where no start leads anywhere."""
    parameters: list[Parameter] = [family.parameters[i] for i in free]
    n, k, n_a = len(free), len(task.goals), family.rows.n_a
    low, high = family.reach.T
    matter = task.weights > 0
    evaluated = 0

    def states(batch: np.ndarray) -> States:
        """Batch by batch, m k states of (m, n + k n_a)."""
        nonlocal evaluated
        evaluated += len(batch) * k
        p = np.broadcast_to(p0, (len(batch), len(p0))).copy()
        p[:, list(free)] = from_shares(parameters, batch[:, :n])
        u = low + batch[:, n:].reshape(-1, n_a) * (high - low)
        return family.at("displacement", u, np.repeat(p, k, axis=0))

    def missing(batch: np.ndarray) -> np.ndarray:
        """Residuals (m, k, n_e) mm."""
        apart = task.reached(states(batch)).reshape(len(batch), k, -1) - task.goals
        return apart * task.weights

    def both(v: np.ndarray, with_jacobian: bool) -> tuple[np.ndarray, np.ndarray]:
        """Residuals (k n_e,), and derivatives: a design moves all goals' states, an actuator its own goal's only."""
        # what an actuator does is asked for all goals at once
        directions = np.zeros((n + n_a, len(v)))
        directions[:n, :n] = np.eye(n)
        directions[n:, n:] = np.tile(np.eye(n_a), (1, k))
        stencil = family.stencil
        values = missing(v + stencil.points(np.zeros(n + n_a)) @ directions)
        slopes = stencil.slopes(values)  # (k, n_e, n + n_a)
        J = np.zeros((*values.shape[1:], len(v)))
        J[:, :, :n] = slopes[:, :, :n]
        for i in range(k):
            J[i, :, n + i * n_a : n + (i + 1) * n_a] = slopes[i, :, n:]
        return values[0].ravel(), J.reshape(-1, len(v))

    search = FitSettings(margin=0.0, ftol=1e-8)
    best = best_of([fit(both, start, search) for start in _starts(n, k, n_a, starts)], "the co-design")
    states_of_best = states(best.u[None])
    distance = np.linalg.norm((task.reached(states_of_best) - task.goals)[:, matter], axis=1)
    u = low + best.u[n:].reshape(k, n_a) * (high - low)
    return Served(states_of_best.p[0], u, distance, states_of_best, float(best.cost), evaluated)


def _starts(n: int, k: int, n_a: int, count: int) -> list[np.ndarray]:
    """Starts: the given or middle design at half pull, then Halton points."""
    shares = spread_starts(count, max(n + n_a, 1))
    shares = np.clip(shares, 1e-3, 1 - 1e-3)
    return [np.concatenate([start[:n], np.tile(start[n:], k)]) for start in shares]
