"""Many condensed states at once, each of a robot of its own."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from cfem.condensed import Condensed, Rows


@dataclass(frozen=True)
class States:
    """m states of robots.

    p: (m, n_p) of their robots
    W, delta_free, lam: (m, n, n), (m, n) and (m, n_a) as `Condensed`
    rest_e: (m, n_e) mm rest positions of the effectors, of each robot its own
    numbers: (m,) by name, of the whole bodies, where finite elements give them: volume mm^3, mass t, strain, stress
    MPa"""

    rows: Rows
    p: np.ndarray
    W: np.ndarray
    delta_free: np.ndarray
    lam: np.ndarray
    rest_e: np.ndarray
    numbers: Mapping[str, np.ndarray] | None = None

    def __len__(self) -> int:
        return len(self.p)

    @property
    def delta(self) -> np.ndarray:
        """(m, n) displacements at the states themselves."""
        return (self.W[:, :, self.rows.a] @ self.lam[:, :, None])[:, :, 0] + self.delta_free

    @property
    def delta_e(self) -> np.ndarray:
        return self.delta[:, self.rows.e]

    @property
    def delta_a(self) -> np.ndarray:
        return self.delta[:, self.rows.a]

    @property
    def x_e(self) -> np.ndarray:
        """(m, n_e) mm positions of the effectors."""
        return self.rest_e + self.delta_e

    @property
    def locked_compliance(self) -> np.ndarray:
        """(m, n_e, n_e) mm/N of the effectors, actuators held where they are: W_ee - W_ea W_aa^-1 W_ae."""
        e, a = self.rows.e, self.rows.a
        W_ae = self.W[:, a, e]
        return self.W[:, e, e] - W_ae.swapaxes(1, 2) @ np.linalg.solve(self.W[:, a, a], W_ae)

    def condensed(self, i: int) -> Condensed:
        return Condensed(self.rows, self.W[i], self.delta_free[i], self.lam[i])
