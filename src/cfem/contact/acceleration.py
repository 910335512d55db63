"""Anderson's acceleration of rounds that converge linearly (Walker and Ni, *Anderson acceleration for fixed-point
iterations*, SIAM Journal on Numerical Analysis 49, 2011).

A round begins with forces x, finds forces g(x), and moves patches by f(x) = C (g(x) - x), with their compliance C. The
next x is sum_k a_k g(x_k) over the last rounds, with the shares a_k, 1 in sum, that make |sum_k a_k f(x_k)| least."""

from collections.abc import Hashable

import numpy as np

DEPTH, FIRST = 3, 3  # most differences of answers that are combined; answers before any are
DEPENDENT = 1e-6  # share of a difference that others do not explain: below, it adds nothing


class Acceleration:
    """Answers of the last rounds on the same `rows` of the law."""

    def __init__(self):
        """Begins without answers."""
        self._rows: Hashable = None
        self._answers: list[np.ndarray] = []
        self._steps: list[np.ndarray] = []

    def forget(self) -> None:
        """Drops all answers."""
        self._rows = None

    def next(self, rows: Hashable, answer: np.ndarray, step: np.ndarray) -> np.ndarray | None:
        """Forces N, of the shape of `answer`, from which the next round begins; None where these are the answer.

        rows: which rows the law has. Answers on other rows are dropped
        step: (c, 3) mm, by which the answer moves the patches"""
        if rows != self._rows:
            self._rows, self._answers, self._steps = rows, [], []
        self._answers, self._steps = [*self._answers, answer][-DEPTH - 1 :], [*self._steps, step.ravel()][-DEPTH - 1 :]
        if len(self._answers) < FIRST:
            return None
        by_step, by_answer = np.diff(self._steps, axis=0), np.diff(self._answers, axis=0)
        sizes = np.maximum(np.linalg.norm(by_step, axis=1), 1e-300)
        by_step = by_step / sizes[:, None]
        gram = by_step @ by_step.T + DEPENDENT * np.eye(len(sizes))
        shares = np.linalg.solve(gram, by_step @ step.ravel()) / sizes
        return answer - np.tensordot(shares, by_answer, axes=1)
