"""The shortest y between parallel planes, by the dual active set of Goldfarb and Idnani (Mathematical Programming 27,
1983):

    minimise |y|^2 / 2    subject to    low <= N y <= high,    rows of N of unit length

Every strictly convex program has this form in the coordinates of its objective (see `qp`), which leaves nothing to
scale. The exported C uses the same method (export/firmware/sources/controller/cfem_active.c)."""

import numpy as np

_ROUNDING = 2e-15  # violations below it, relative to y and to the terms of the bound, are none
_DEPENDENT = 1e-11  # a unit normal with no more than this outside of the active ones depends on them
_APART = 1e-10  # bounds that exclude each other by less, relative to their size, meet
_CHANGES = 20  # of the active set, allowed a constraint


class ActiveSet:
    """Active constraints of a least-length program.

    y: (n,)
    which: (k,) the constraints that hold it
    sign: (k,) +1 at the low bound, -1 at the high one
    Q: (n, k) with their signed normals as columns, N = Q R
    T: (k, k) R^-1
    force: (k,) >= 0, of each on y
    feasible: whether there is a y at all
    changes: number of changes of the set"""

    def __init__(self, N: np.ndarray, low: np.ndarray, high: np.ndarray, terms: np.ndarray) -> None:
        n = N.shape[1]
        self._N, self._low, self._high, self._terms = N, low, high, terms
        self._Q, self._T, self.force = np.zeros((n, n)), np.zeros((n, n)), np.zeros(0)
        self._which, self._sign, self._bound = [], [], []
        self.y, self.feasible, self.changes = np.zeros(n), True, 0

    @property
    def which(self) -> np.ndarray:
        return np.array(self._which, dtype=int)

    @property
    def sign(self) -> np.ndarray:
        return np.array(self._sign)

    @property
    def Q(self) -> np.ndarray:
        return self._Q[:, : len(self._which)]

    @property
    def T(self) -> np.ndarray:
        k = len(self._which)
        return self._T[:k, :k]

    def hold(self, k: int, sign: float) -> bool:
        """Makes constraint k active, and drops those that it relieves; False where it cannot be, its bound and the
        active ones excluding each other: by more than rounding, then it is infeasible, or by no more."""
        normal, bound = sign * self._N[k], self._signed(k, sign)
        gap, push = bound - normal @ self.y, 0.0
        while True:
            share, rest = self._split(normal)
            square = float(rest @ rest)
            independent = len(self._which) < len(self.y) and square > _DEPENDENT**2
            relief = self.T @ share
            partial, slot = np.inf, -1
            for i, (r, force) in enumerate(zip(relief, self.force, strict=True)):
                if r > 1e-14 and force < partial * r:
                    partial, slot = force / r, i
            if not independent and slot < 0:
                size = np.abs(self._bound) + self._terms[self._which]
                self.feasible = bool(gap <= _APART * (abs(bound) + self._terms[k] + np.abs(relief) @ size))
                return False
            full = gap / square if independent else np.inf
            step = min(full, partial)
            self.force, push = self.force - step * relief, push + step
            if independent:
                self.y, gap = self.y + step * rest, gap - step * square
            if step == full:
                self.changes += 1
                self._append(k, sign, share, rest / np.sqrt(square), np.sqrt(square))
                self.force = np.append(self.force, push)
                return True
            self._drop(slot)

    def settle(self) -> bool:
        """Solves for y and forces from scratch, which removes what rounding has left; False where a constraint that
        need not hold had to be dropped."""
        along = self._bound @ self.T
        self.y, self.force = self.Q @ along, self.T @ along
        if self._which and self.force.min() < 0:
            self._drop(int(self.force.argmin()))
            return False
        return True

    def _signed(self, k: int, sign: float) -> float:
        return float(self._low[k] if sign > 0 else -self._high[k])

    def _split(self, normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Splits a normal into its shares in Q and what remains, by Gram and Schmidt done twice."""
        share = normal @ self.Q
        rest = normal - self.Q @ share
        again = rest @ self.Q
        return share + again, rest - self.Q @ again

    def _append(self, k: int, sign: float, share: np.ndarray, direction: np.ndarray, length: float) -> None:
        last = len(self._which)
        self._Q[:, last] = direction
        self._T[:last, last] = self.T @ share / -length
        self._T[last, last] = 1 / length
        self._which.append(k)
        self._sign.append(sign)
        self._bound.append(self._signed(k, sign))

    def _drop(self, slot: int) -> None:
        """Drops the constraint in this slot, and takes those after it in again."""
        self.changes += 1
        self.force = np.delete(self.force, slot)
        later = list(zip(self._which, self._sign, strict=True))[slot + 1 :]
        del self._which[slot:], self._sign[slot:], self._bound[slot:]
        for k, sign in later:
            share, rest = self._split(sign * self._N[k])
            length = float(np.sqrt(rest @ rest))
            self._append(k, sign, share, rest / length, length)


def least_length(N: np.ndarray, low: np.ndarray, high: np.ndarray, terms: np.ndarray) -> ActiveSet | None:
    """Active set of the shortest y (n,) with low <= N y <= high. N (m, n), low and high (m,), +-inf where open; terms:
    (m,) the size of what these are differences of. None where the changes allowed were not enough."""
    now, settled = ActiveSet(N, low, high, terms), True
    if low.max() <= 0.0 <= high.min():  # as most often: nothing holds y
        return now
    lowest, highest = low - _ROUNDING * (np.abs(low) + terms), high + _ROUNDING * (np.abs(high) + terms)
    passed = np.zeros(len(N), dtype=bool)  # met to rounding, and dependent on others
    while now.changes <= _CHANGES * (len(N) + 1):
        values = N @ now.y
        below, above = lowest - values, values - highest
        violation = np.maximum(below, above)
        violation[passed] = -np.inf
        violation[now._which] = -np.inf
        k = int(violation.argmax())
        if violation[k] > _ROUNDING * np.sqrt(now.y @ now.y):
            settled = False
            passed[k] = not now.hold(k, 1.0 if below[k] > above[k] else -1.0)
            if not now.feasible:
                return now
        elif settled:
            return now
        else:
            settled = now.settle()
    return None
