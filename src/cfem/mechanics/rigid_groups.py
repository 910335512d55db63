"""Groups of nodes that move as rigid bodies: x_i = c + exp(omega) (x_i0 - c0).

The unknowns of a group are two pseudo-nodes appended to the mesh's: the translation (mm), and the rotation vector
omega times the group's radius of gyration (mm, so that all unknowns are of one size)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation


@dataclass(frozen=True)
class RigidGroups:
    """Rigid groups of nodes: g groups, their N nodes one group after the other.

    nodes: (N,)
    owner: (N,) group of each node
    start, count: (g,) where a group begins, and (g, 1) nodes it has
    arm: (N, 3) mm from the group's mean, at rest
    radius: (g, 1) mm, of gyration
    translation, rotation: (g,) places of the two pseudo-nodes among the free nodes"""

    nodes: np.ndarray
    owner: np.ndarray
    start: np.ndarray
    count: np.ndarray
    arm: np.ndarray
    radius: np.ndarray
    translation: np.ndarray
    rotation: np.ndarray

    def sums(self, values: np.ndarray) -> np.ndarray:
        """Sums (g, ...) over each group of values (N, ...), one of each node."""
        return np.add.reduceat(values, self.start)

    def arms(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Means (g, 3) of the groups' nodes at x (n, 3), and the nodes (N, 3) from there, mm."""
        places = x[self.nodes]
        centre = self.sums(places) / self.count
        return centre, places - centre[self.owner]

    def chosen(self, x: np.ndarray, only: np.ndarray | None) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Nodes of groups, their arms, owners, and where each group begins: all of them, or those that `only` says."""
        r = self.arms(x)[1]
        if only is None:
            return self.nodes, r, self.owner, self.start
        kept = only[self.nodes]
        kept[self.start] = True  # a group without any would have no place of its own
        owner = self.owner[kept]
        return self.nodes[kept], r[kept], owner, np.searchsorted(owner, np.arange(len(self.start)))

    def moved(self, x: np.ndarray, translation: np.ndarray, rotation: np.ndarray) -> np.ndarray:
        """Positions (N, 3) mm of the nodes after translations (g, 3) mm, and rotations omega times radius, from x (n,
        3)."""
        centre, r = self.arms(x)
        return self._placed(centre + translation, Rotation.from_rotvec(rotation / self.radius).as_matrix(), r)

    def nearest(self, x: np.ndarray) -> np.ndarray:
        """Rigid positions (N, 3) mm nearest to x (n, 3) (Kabsch, Acta Cryst. A32, 1976)."""
        centre, r = self.arms(x)
        U, _, Vt = np.linalg.svd(self.sums(r[:, :, None] * self.arm[:, None]))
        handed = np.ones((len(U), 1, 3))
        handed[:, 0, 2] = np.sign(np.linalg.det(U @ Vt))
        return self._placed(centre, (U * handed) @ Vt, self.arm)

    def _placed(self, centre: np.ndarray, turn: np.ndarray, arm: np.ndarray) -> np.ndarray:
        return centre[self.owner] + (turn[self.owner] @ arm[:, :, None])[:, :, 0]

    def nodal_motion(self, x: np.ndarray) -> np.ndarray:
        """Motion (N, 3, 6) of each node by the six unknowns of its group, to first order at x (n, 3)."""
        T = np.zeros((len(self.nodes), 3, 6))
        T[:, range(3), range(3)] = 1.0
        r = self.arms(x)[1] / self.radius[self.owner]
        for (i, j), sign in {(0, 1): 1, (1, 2): 1, (2, 0): 1, (1, 0): -1, (2, 1): -1, (0, 2): -1}.items():
            T[:, i, 3 + j] = sign * r[:, 3 - i - j]  # omega x r
        return T

    def turning_stiffness(self, x: np.ndarray, unbalanced: np.ndarray) -> np.ndarray:
        """Stiffness (g, 3, 3) N/mm on the rotations that forces `unbalanced` (n, 3) N add by the second derivative of
        the nodes' positions at x (n, 3), sum_i sym(f_i r_i^T) - (f_i . r_i) 1 over the squared radius (Geradin and
        Cardona, Flexible Multibody Dynamics, ch. 4)."""
        outer = self.sums(unbalanced[self.nodes][:, :, None] * self.arms(x)[1][:, None])
        trace = np.trace(outer, axis1=1, axis2=2)[:, None, None]
        return ((outer + outer.swapaxes(1, 2)) / 2 - trace * np.eye(3)) / self.radius[:, None] ** 2


def make_rigid_groups(X: np.ndarray, groups: Sequence[np.ndarray], pseudo: np.ndarray) -> RigidGroups:
    """Rigid groups of disjoint nodes (k,) at rest positions X (n, 3) mm; pseudo: (g, 2) as in RigidGroups."""
    counts = np.array([len(nodes) for nodes in groups])
    arms = [X[nodes] - X[nodes].mean(axis=0) for nodes in groups]
    return RigidGroups(
        nodes=np.concatenate(groups),
        owner=np.repeat(np.arange(len(counts)), counts),
        start=np.cumsum(counts) - counts,
        count=counts[:, None],
        arm=np.concatenate(arms),
        radius=np.array([[np.sqrt((arm**2).sum(axis=1).mean())] for arm in arms]),
        translation=pseudo[:, 0],
        rotation=pseudo[:, 1],
    )
