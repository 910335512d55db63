"""How the work of constant forces on nodes changes as rigid groups turn: r x f is their moment, and r turns with the
group. Only the sums of r f^T over each group are needed."""

from itertools import pairwise

import numpy as np

from cfem.mechanics.rigid import Kinematics


def moments(kinematics: Kinematics, x: np.ndarray, nodes: np.ndarray, forces: np.ndarray) -> np.ndarray:
    """(g, k, 3, 3) N mm: sum of r f^T over each rigid group, r the arms from its mean at positions x (n, 3), of k sets
    of forces (k, m, 3) on nodes (m,)."""
    groups = kinematics.members
    place = np.full(len(x), -1)
    place[nodes] = np.arange(len(nodes))
    mine = np.flatnonzero(place[groups.nodes] >= 0)
    arms, own = kinematics.arms(x)[1][mine], forces.transpose(1, 0, 2)[place[groups.nodes[mine]]].reshape(len(mine), -1)
    ends = np.searchsorted(groups.owner[mine], np.arange(len(groups.start) + 1))
    found = np.stack([arms[a:b].T @ own[a:b] for a, b in pairwise(ends)])
    return found.reshape(len(found), 3, len(forces), 3).swapaxes(1, 2)


def change_of_work(kinematics: Kinematics, moments: np.ndarray, motion: np.ndarray, q: np.ndarray) -> np.ndarray:
    """(k, c) N mm: derivative of the work of forces with these `moments` on changes q (n_dof, c) of the unknowns, along
    the motion (n_dof,): t . ((w x r) x f) = t . (r (w . f) - w (r . f)), w and t the turns of a group."""
    groups = kinematics.members
    w = motion.reshape(-1, 3)[groups.rotation] / groups.radius
    t = q.reshape(-1, 3, q.shape[1])[groups.rotation] / groups.radius[:, None]
    trace = np.trace(moments, axis1=2, axis2=3)
    torque = np.einsum("gkij,gj->gki", moments, w) - trace[:, :, None] * w[:, None]
    return np.tensordot(torque, t, axes=((0, 2), (0, 1)))
