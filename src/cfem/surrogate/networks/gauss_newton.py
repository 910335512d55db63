"""Nonlinear least squares for some thousand unknowns: Levenberg-Marquardt steps with geodesic acceleration.

The step v solves (J^T J + mu I) v = -J^T r; the acceleration a solves the same system for the second derivative of r
along v, and the step taken is v + a / 2 where a is small beside v (Transtrum and Sethna, Improvements to the
Levenberg-Marquardt algorithm, arXiv:1201.5885). It costs two evaluations of r and follows the curved valleys of such
fits: ten times fewer steps than without."""

import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve

from cfem.core.artefact.files import write_npz
from cfem.surrogate.networks.series_network import DerivativeResiduals

DAMPING = 1e-3  # mu at the start, relative to the mean diagonal entry of J^T J
LEAST_DAMPING = 1e-15
DIFFERENCE = 0.1  # of the step, for the second derivative along it
LARGEST_ACCELERATION = 0.75  # |a| relative to 2 |v|
ATTEMPTS = 15  # at one step, each with more damping
EXACT = 1e-9  # root mean square residual below which there is nothing left to learn
CHECKPOINT_SECONDS = 20.0


@dataclass
class LeastSquaresState:
    """All that the rest of a minimisation depends on, besides its residuals.

    best, best_theta, best_iteration: the least mean square of the held-out residuals, where and when
    history: one record an iteration, root mean squares"""

    theta: np.ndarray
    damping: float = DAMPING
    iteration: int = 0
    ended: bool = False
    best: float = np.inf
    best_theta: np.ndarray = field(default_factory=lambda: np.empty(0))
    best_iteration: int = 0
    history: list[dict[str, float]] = field(default_factory=list)

    def save(self, path: Path) -> None:
        columns = {f"history_{name}": [record[name] for record in self.history] for name in (self.history or [{}])[0]}
        write_npz(path, {name: value for name, value in vars(self).items() if name != "history"} | columns)

    @classmethod
    def load(cls, path: Path) -> "LeastSquaresState":
        with np.load(path) as file:
            data: dict[str, Any] = {name: value.item() if value.ndim == 0 else value for name, value in file.items()}
        columns = {name: data.pop(name).tolist() for name in list(data) if name.startswith("history_")}
        names = [name.removeprefix("history_") for name in columns]
        records = [dict(zip(names, values, strict=True)) for values in zip(*columns.values(), strict=True)]
        return cls(**data, history=records)


def minimise(
    fitted: DerivativeResiduals,
    held_out: DerivativeResiduals | None,
    theta: np.ndarray,
    iterations: int,
    patience: int,
    checkpoint: Path | None = None,
) -> LeastSquaresState:
    """Minimises the squares of `fitted` from `theta` on; what it found is `best_theta`, judged by `held_out` (by
    `fitted` where that is None). Ends where the best is `patience` iterations old or no step goes down any more.

    checkpoint: where the state is kept now and then, and found by a run that goes on."""
    state = (
        LeastSquaresState.load(checkpoint)
        if checkpoint is not None and checkpoint.exists()
        else LeastSquaresState(theta)
    )
    kept = time.monotonic()
    while not state.ended:
        square = _step(fitted, state)
        judged = square / fitted.count if held_out is None else held_out.square(state.theta) / held_out.count
        state.iteration += 1
        if judged < state.best:
            state.best, state.best_theta, state.best_iteration = judged, state.theta, state.iteration
        training = float(np.sqrt(square / fitted.count))
        state.history.append(
            {
                "iteration": state.iteration,
                "training": training,
                "validation": float(np.sqrt(judged)),
                "damping": state.damping,
            }
        )
        old = state.iteration - state.best_iteration >= patience
        state.ended = state.ended or old or training < EXACT or state.iteration >= iterations
        if checkpoint is not None and (state.ended or time.monotonic() - kept > CHECKPOINT_SECONDS):
            state.save(checkpoint)
            kept = time.monotonic()
    return state


def _step(fitted: DerivativeResiduals, state: LeastSquaresState) -> float:
    """Takes one step down and sets the damping of the next; returns the sum of squares reached. Marks the end where no
    step goes down."""
    r, matrix = fitted(state.theta), fitted.normal_matrix(state.theta)
    now, gradient = float(np.sum(r**2)), fitted.pull_back(state.theta, r)
    diagonal = np.diag_indices(len(matrix))
    scale = float(matrix[diagonal].mean())
    growth = 2.0
    for attempt in range(ATTEMPTS):
        damped = matrix.copy()
        damped[diagonal] += state.damping * scale
        reached, theta = _trial(fitted, state.theta, r, gradient, damped)
        if reached < now:
            state.theta = theta
            if attempt == 0:
                state.damping = max(state.damping / 3, LEAST_DAMPING)
            return reached
        state.damping *= growth
        growth *= 2
    state.ended = True
    return now


def _trial(
    fitted: DerivativeResiduals, theta: np.ndarray, r: np.ndarray, gradient: np.ndarray, damped: np.ndarray
) -> tuple[float, np.ndarray]:
    """The sum of squares where the step leads, with acceleration where that helps, and the place; infinity where the
    matrix has no factor."""
    try:
        factor = cho_factor(damped, lower=True, overwrite_a=True, check_finite=False)
    except LinAlgError:
        return np.inf, theta
    step = -cho_solve(factor, gradient)
    choices = [theta + step]
    ahead, behind = fitted(theta + DIFFERENCE * step), fitted(theta - DIFFERENCE * step)
    curvature = fitted.pull_back(theta, (ahead + behind - 2 * r) / DIFFERENCE**2)
    acceleration = -cho_solve(factor, curvature)
    if 2 * np.linalg.norm(acceleration) <= LARGEST_ACCELERATION * np.linalg.norm(step):
        choices.append(theta + step + acceleration / 2)
    squares = [fitted.square(choice) for choice in choices]
    best = int(np.argmin(squares))
    return squares[best], choices[best]
