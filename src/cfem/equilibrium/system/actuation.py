"""Actuation: what is prescribed to the active rows (actuators, then contacts): displacements, forces, or a mixture, in
one form.

lambda = offset + C^T mu      and      C delta = target

with C (m, n) and unknown mu (m,). C = 1 prescribes every displacement; m = 0 prescribes every force; C = one row u^T
pulls all cables in proportion u until the weighted displacement reaches its target, which stays well posed wherever the
robot can be. A cable that is told its length pulls, or is slack: mu >= 0, C delta >= target, one of them with equality
(`pulling_only`)."""

from dataclasses import dataclass, replace

import numpy as np


@dataclass(frozen=True)
class Actuation:
    """What is prescribed to n active rows: C delta = target, lam = C^T mu + offset.

    C: (m, n) rows, dimensionless
    target: (m,) mm (mm^3 for chambers)
    offset: (n,) N (MPa)
    load: share of the scene's constant loads that acts
    one_sided: the rows that cannot push, each of one actuator alone, whose multiplier is mu"""

    C: np.ndarray
    target: np.ndarray
    offset: np.ndarray
    load: float = 1.0
    one_sided: tuple[int, ...] = ()

    @property
    def n(self) -> int:
        """Active rows."""
        return len(self.offset)

    def padded(self, n: int) -> "Actuation":
        """This actuation for n active rows: further rows (contacts) are free, with multipliers 0."""
        extra = n - self.n
        if extra == 0:
            return self
        C = np.hstack([self.C, np.zeros((len(self.C), extra))])
        return replace(self, C=C, offset=np.concatenate([self.offset, np.zeros(extra)]))

    @property
    def unilateral(self) -> np.ndarray:
        """Mask (m,) of the rows that cannot push."""
        rows = np.zeros(len(self.C), dtype=bool)
        rows[list(self.one_sided)] = True
        return rows

    def only(self, held: np.ndarray) -> "Actuation":
        """Actuation by these of its rows (m,) bool alone, held from both sides."""
        return replace(self, C=self.C[held], target=self.target[held], one_sided=())


def displacement(delta: np.ndarray) -> Actuation:
    """Every displacement prescribed, (n,) mm: of the actuators, or of actuators and contacts."""
    delta = np.asarray(delta, dtype=float)
    return Actuation(np.eye(len(delta)), delta, np.zeros(len(delta)))


def force(lam: np.ndarray) -> Actuation:
    """Every multiplier prescribed, (n,) N."""
    lam = np.asarray(lam, dtype=float)
    return Actuation(np.zeros((0, len(lam))), np.zeros(0), lam)


def pulling_only(actuation: Actuation, unilateral: np.ndarray) -> Actuation:
    """Actuation of a robot some of whose actuators pull and cannot push, unilateral (n_a,) bool: of forces that they
    are given none is negative, and rows that prescribe one of them alone are one-sided."""
    C, target, offset = actuation.C.copy(), actuation.target.copy(), actuation.offset.copy()
    prescribed, one_sided = C[:, : len(unilateral)] != 0, []
    given = np.flatnonzero(unilateral & ~prescribed.any(axis=0))
    offset[given] = np.maximum(offset[given], 0.0)
    for index, row in enumerate(C):
        (actuators,) = np.nonzero(row)
        if len(actuators) == 1 and actuators[0] < len(unilateral) and unilateral[actuators[0]]:
            (actuator,) = actuators
            if prescribed[:, actuator].sum() == 1:
                target[index] /= row[actuator]
                row[actuator], offset[actuator] = 1.0, 0.0
                one_sided.append(index)
    return replace(actuation, C=C, target=target, offset=offset, one_sided=tuple(one_sided))


def pull(share: np.ndarray, reach: np.ndarray, amount: float | None = None) -> Actuation:
    """Pull in the proportion `share` (n_a,) in [0, 1] until the share-weighted mean displacement, in units of `reach`
    (n_a,) mm, is `amount` (the largest share unless given):

        lambda_a = mu C^T,    C = share / (sum(share) reach),    C delta_a = amount

    One cable alone, and all alike, are pulled by their share of the reach; in between a cable may go some per cent
    beyond its reach, so that the unit cube of shares covers all states within reach in which no cable pushes."""
    share, reach = np.asarray(share, dtype=float), np.asarray(reach, dtype=float)
    total = float(share.sum())
    if total == 0.0:
        return force(np.zeros(len(share)))
    target = float(share.max()) if amount is None else amount
    return Actuation((share / (total * reach))[None, :], np.array([target]), np.zeros(len(share)))
