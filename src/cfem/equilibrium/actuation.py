"""What is prescribed to the actuators: displacements, forces, or a mixture, in one form.

lambda_a = offset + C^T mu      and      C delta_a = target

with C (m, n_a) and unknown mu (m,). C = 1 prescribes every displacement; m = 0 prescribes every force; C = the unit
rows of the taut cables leaves the others slack (offset 0); C = one row u^T pulls all cables in proportion u until the
weighted displacement reaches its target, which stays well posed wherever the robot can be."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Actuation:
    """C: (m, n_a) rows, dimensionless; target: (m,) mm; offset: (n_a,) N."""

    C: np.ndarray
    target: np.ndarray
    offset: np.ndarray

    @property
    def n_a(self) -> int:
        return len(self.offset)


def displacement(delta_a: np.ndarray) -> Actuation:
    """Every actuator displacement prescribed, (n_a,) mm."""
    delta_a = np.asarray(delta_a, dtype=float)
    return Actuation(np.eye(len(delta_a)), delta_a, np.zeros(len(delta_a)))


def force(lambda_a: np.ndarray) -> Actuation:
    """Every multiplier prescribed, (n_a,) N."""
    lambda_a = np.asarray(lambda_a, dtype=float)
    return Actuation(np.zeros((0, len(lambda_a))), np.zeros(0), lambda_a)


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
