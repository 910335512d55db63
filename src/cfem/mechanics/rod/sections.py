"""Rigid plane sections in a row: their frames, and how they move together.

Sections that move each on their own by a linear step stretch what lies between them, the more the further they turn.
They are moved by their relative motions instead: those of `rod_element.stretch`, linear in the step, from the first
section to the last. A linear step of strains is then what it says, and equilibrium under pressure is one Newton step
away."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cfem.mechanics.rod.element import screw, stretch


@dataclass(frozen=True)
class Sections:
    """Rigid plane sections in a row. X: (n, 3) mm all nodes at rest; nodes: (s, k) those of each section, in planes
    across x, from the base on."""

    X: np.ndarray
    nodes: np.ndarray

    @cached_property
    def centres(self) -> np.ndarray:
        """Centres (s, 3) mm at rest."""
        return self.X[self.nodes].mean(axis=1)

    @cached_property
    def arm(self) -> np.ndarray:
        """Arms (s, k, 3) mm of the nodes from the centres, at rest."""
        return self.X[self.nodes] - self.centres[:, None]

    @cached_property
    def spacing(self) -> np.ndarray:
        """Distances (s - 1,) mm between neighbours."""
        return np.diff(self.centres[:, 0])

    @cached_property
    def radius(self) -> np.ndarray:
        """Radii of gyration (s,) mm of the nodes."""
        return np.sqrt((self.arm**2).sum(axis=2).mean(axis=1))

    @cached_property
    def outer(self) -> np.ndarray:
        """Outer radii (s,) mm, from the axis to the farthest node."""
        return np.sqrt((self.arm**2).sum(axis=2).max(axis=1))

    @cached_property
    def across(self) -> np.ndarray:
        """Matrices (s, 2, k) that take a section's nodes to its axes y and z."""
        arm = self.arm[:, :, 1:]
        return np.linalg.solve(arm.swapaxes(1, 2) @ arm, arm.swapaxes(1, 2))

    def frames(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Centres (s, 3) mm and rotations (s, 3, 3) since rest, of positions x (n, 3) that keep the sections rigid."""
        places = x[self.nodes]
        y, z = (self.across @ places).swapaxes(0, 1)
        first = np.stack([y[:, i] * z[:, j] - y[:, j] * z[:, i] for i, j in ((1, 2), (2, 0), (0, 1))], axis=1)
        return places.mean(axis=1), np.stack([first, y, z], axis=2)

    def advanced(self, x: np.ndarray, motions: np.ndarray) -> np.ndarray:
        """Positions (s, k, 3) after motions (s, 6), mm and rad, of the sections from x: the first stays where it is,
        the others follow from their relative motions, which are linear in `motions`."""
        c, R = self.frames(x)
        now = stretch(c[:-1], R[:-1], c[1:], R[1:], self.spacing)
        pairs = np.concatenate([motions[:-1], motions[1:]], axis=1)
        p, turn = screw(now.e + (now.gradient @ pairs[:, :, None])[:, :, 0], self.spacing)
        c, R = c.copy(), R.copy()
        for number in range(len(p)):
            c[number + 1] = c[number] + R[number] @ p[number]
            R[number + 1] = R[number] @ turn[number]
        return c[:, None] + self.arm @ R.swapaxes(1, 2)
