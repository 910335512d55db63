"""How the work of constant forces on nodes changes as rigid groups turn: r x f is their moment, and r turns with the
group by w. Of each group only L, the sum of r f^T - (r . f) 1, is needed: (w x r) x f = r (w . f) - w (r . f)."""

from itertools import pairwise

import numpy as np

from cfem.mechanics.kinematics import Kinematics


def levers(kinematics: Kinematics, x: np.ndarray, nodes: np.ndarray, forces: np.ndarray) -> np.ndarray:
    """Levers L (k, g, 3, 3) N mm of each rigid group, r the arms from its mean at positions x (n, 3), of k sets of
    forces (k, m, 3) on nodes (m,)."""
    groups = kinematics.groups
    place = np.full(len(x), -1)
    place[nodes] = np.arange(len(nodes))
    loaded = np.flatnonzero(place[groups.nodes] >= 0)
    arms = groups.arms(x)[1][loaded]
    loads = forces.transpose(1, 0, 2)[place[groups.nodes[loaded]]].reshape(len(loaded), -1)
    ends = np.searchsorted(groups.owner[loaded], np.arange(len(groups.start) + 1))
    moments = np.stack([arms[a:b].T @ loads[a:b] for a, b in pairwise(ends)])
    outer = np.ascontiguousarray(moments.reshape(len(moments), 3, len(forces), 3).transpose(2, 0, 1, 3))
    return outer - np.trace(outer, axis1=2, axis2=3)[:, :, None, None] * np.eye(3)


def change_of_work(kinematics: Kinematics, levers: np.ndarray, motion: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Derivative (k, c) N mm of the work of forces with these `levers` on changes q (n_dof, c) of the unknowns, along
    the motion (n_dof,): the sum of t . L w over the groups, which turn by w and t."""
    groups = kinematics.groups
    w = motion.reshape(-1, 3)[groups.rotation] / groups.radius
    t = q.reshape(-1, 3, q.shape[1])[groups.rotation] / groups.radius[:, None]
    return (levers @ w[:, :, None]).reshape(len(levers), -1) @ t.reshape(-1, t.shape[2])
