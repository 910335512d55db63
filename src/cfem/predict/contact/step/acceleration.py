"""Anderson's acceleration of rounds that converge linearly (Walker and Ni, *Anderson acceleration for fixed-point
iterations*, SIAM Journal on Numerical Analysis 49, 2011).

Each round answers forces x with forces g(x), which move patches by f(x). The next x is the combination of the last
answers whose steps, combined in the same way, are least."""

from collections.abc import Hashable

import numpy as np

DEPTH, FIRST = 3, 3  # differences of answers that are combined; answers to begin with
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

        step: mm, by which the answer moves the patches
        rows: of the law; others than last time begin anew"""
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
