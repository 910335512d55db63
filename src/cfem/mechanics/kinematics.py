"""Kinematics of nodes by the unknowns: free nodes one by one, held nodes not at all, rigid groups by a frame of six.

With T = dx/dq at the present pose, A the stiffness by nodes and f the unbalanced nodal forces, the stiffness by
unknowns is

    A_q = T^T A T + sum_i sym(f_i r_i^T) - (f_i . r_i) 1     on the rotation of each rigid group, r_i = x_i - c

the last from the second derivative of exp(omega) r_i (rigid_groups.py)."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import scipy.sparse as sp

from cfem.mechanics.assembly import Pattern, add_blocks, make_pattern
from cfem.mechanics.rigid_groups import RigidGroups, make_rigid_groups
from cfem.mechanics.rod.sections import Sections
from cfem.mechanics.transfer import Transfer, copies

NO_JOINTS = np.zeros((0, 2), dtype=int)


@dataclass(frozen=True)
class Kinematics:
    """Motion of the nodes with the unknowns.

    pattern: of the unknowns, whose slots are those of the groups of nodes given, where no node is rigid
    full: the same for all nodes as if none were rigid (the same object where there is no group)
    groups: the rigid ones, None where no node is rigid
    transfer: how blocks of `full` reach `pattern`, None where no node is rigid
    joint_slots: (m, 4, 4, 3) of the joints between groups, their unknowns (translation a, rotation a, translation b,
    rotation b)
    row: sections that move together, of which the first is held and the others are groups, in this order"""

    X: np.ndarray
    pattern: Pattern
    full: Pattern
    groups: RigidGroups | None
    fixed: np.ndarray
    transfer: Transfer | None
    joint_slots: np.ndarray
    row: Sections | None = None

    @property
    def n_dof(self) -> int:
        return self.pattern.n_dof

    def reduce(self, x: np.ndarray, nodal: np.ndarray, only: np.ndarray | None = None) -> np.ndarray:
        """T^T of nodal (n, 3) or (n, 3, k) at positions x: (n_dof,) or (n_dof, k). only: (n,) nodes that count."""
        free, groups = self.pattern.free, self.groups
        if groups is None:
            return nodal[free].reshape(self.n_dof, *nodal.shape[2:])
        out = np.zeros((len(free), *nodal.shape[1:]))
        plain = free < len(self.X)
        out[plain] = nodal[free[plain]]
        nodes, r, _, start = groups.chosen(x, only)
        f = nodal[nodes].reshape(len(r), 3, -1)
        moment = np.add.reduceat(_cross(r[:, :, None], f), start) / groups.radius[:, None]
        out[groups.translation] = np.add.reduceat(f, start).reshape(-1, *nodal.shape[1:])
        out[groups.rotation] = moment.reshape(-1, *nodal.shape[1:])
        return out.reshape(self.n_dof, *nodal.shape[2:])

    def spread(self, x: np.ndarray, q: np.ndarray, only: np.ndarray | None = None) -> np.ndarray:
        """T q: nodal motion (n, 3) to first order in the unknowns q (n_dof,), (n, 3, k) of k changes (n_dof, k). only:
        (n,) nodes of groups that are asked for."""
        blocks, free, groups = q.reshape(len(q) // 3, 3, *q.shape[1:]), self.pattern.free, self.groups
        out = np.zeros((*self.X.shape, *q.shape[1:]))
        plain = free < len(self.X)
        out[free[plain]] = blocks[plain]
        if groups is not None:
            nodes, r, owner, _ = groups.chosen(x, only)
            by_group = blocks.reshape(len(blocks), 3, -1)
            turn = by_group[groups.rotation] / groups.radius[:, None]
            moved = by_group[groups.translation][owner] + _cross(turn[owner], r[:, :, None])
            out[nodes] = moved.reshape(len(r), *out.shape[1:])
        return out

    def move(self, x: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Positions (n, 3) after the change q (n_dof,) of the unknowns: rigid groups stay rigid."""
        blocks, free, groups = q.reshape(-1, 3), self.pattern.free, self.groups
        moved = x.copy()
        plain = free < len(self.X)
        moved[free[plain]] += blocks[plain]
        if groups is not None:
            moved[groups.nodes] = groups.moved(x, blocks[groups.translation], blocks[groups.rotation])
        return moved

    def advance(self, x: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Positions after changes q of the unknowns, as `move` to first order: where sections are in a row, each
        follows the one before (sections.py)."""
        if self.row is None:
            return self.move(x, q)
        groups, blocks = self.groups, q.reshape(-1, 3)
        motions = np.zeros((len(self.row.nodes), 6))
        motions[1:, :3], motions[1:, 3:] = blocks[groups.translation], blocks[groups.rotation] / groups.radius
        moved = x.copy()
        moved[self.row.nodes] = self.row.advanced(x, motions)
        return moved

    def hold(self, x: np.ndarray) -> np.ndarray:
        """The nearest admissible positions (n, 3): held nodes at rest, groups rigid. No residual would tell if a start
        had moved them otherwise."""
        held = x.copy()
        held[self.fixed] = self.X[self.fixed]
        if self.groups is not None:
            held[self.groups.nodes] = self.groups.nearest(x)
        return held

    def stiffness(self, x: np.ndarray, data: np.ndarray, unbalanced: np.ndarray) -> np.ndarray:
        """Data (lower triangle) of the matrix of the unknowns from that of all nodes; unbalanced: (n, 3) N, the nodal
        residual, of which rigid groups carry the moment."""
        if self.groups is None:
            return data
        out = np.zeros(self.pattern.nnz)
        if len(data):
            T = np.zeros((len(self.X), 3, 6))
            T[:, range(3), range(3)] = 1.0  # a node of no group: its own motion in the first three columns
            T[self.groups.nodes] = self.groups.nodal_motion(x)
            self.transfer.fill(T, data, out)
        turning = np.zeros((len(self.groups.start), 6, 6))
        turning[:, 3:, 3:] = self.groups.turning_stiffness(x, unbalanced)
        add_blocks(turning, self.transfer.diagonal, out)
        return out

    def transfer_matrix(self, x: np.ndarray) -> sp.csr_array:
        """Matrix T (3 n, n_dof): nodal motion, node by node, by the unknowns."""
        free = self.pattern.free
        plain = np.flatnonzero(free < len(self.X))
        rows = (3 * free[plain][:, None] + np.arange(3)).ravel()
        columns = (3 * plain[:, None] + np.arange(3)).ravel()
        values = np.ones(len(rows))
        if self.groups is not None:
            group_motion = self.groups.nodal_motion(x)
            group_unknowns = self.unknowns(self.groups.owner)
            place = (3 * self.groups.nodes[:, None] + np.arange(3))[:, :, None]
            rows = np.concatenate([rows, np.broadcast_to(place, group_motion.shape).ravel()])
            columns = np.concatenate([columns, np.broadcast_to(group_unknowns[:, None], group_motion.shape).ravel()])
            values = np.concatenate([values, group_motion.ravel()])
        return sp.csr_array(sp.coo_array((values, (rows, columns)), shape=(3 * len(self.X), self.n_dof)))

    def turning_form(self, x: np.ndarray, q: np.ndarray, unbalanced: np.ndarray) -> np.ndarray:
        """Form (k, k) N mm of changes q (n_dof, k) of the unknowns that the turning of rigid groups adds to that of the
        nodal stiffness; unbalanced as in `stiffness`."""
        turns = q.reshape(-1, 3, q.shape[1])[self.groups.rotation]
        return np.tensordot(turns, self.groups.turning_stiffness(x, unbalanced) @ turns, axes=((0, 1), (0, 1)))

    def unknowns(self, numbers: np.ndarray) -> np.ndarray:
        """Places (..., 6) among the unknowns of the groups with these numbers (...), -1 each of a group -1."""
        nodes = np.stack([self.groups.translation[numbers], self.groups.rotation[numbers]], axis=-1)
        places = (3 * nodes[..., None] + np.arange(3)).reshape(*np.shape(numbers), 6)
        return np.where(np.asarray(numbers)[..., None] >= 0, places, -1)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross product a x b along the second axis."""
    out = np.empty(np.broadcast_shapes(a.shape, b.shape))
    for k, (i, j) in enumerate(((1, 2), (2, 0), (0, 1))):
        np.multiply(a[:, i], b[:, j], out=out[:, k])
        out[:, k] -= a[:, j] * b[:, i]
    return out


def make_kinematics(
    X: np.ndarray,
    groups: Sequence[np.ndarray],
    fixed: np.ndarray,
    rigid: Sequence[np.ndarray] = (),
    joints: np.ndarray = NO_JOINTS,
    row: Sections | None = None,
) -> Kinematics:
    """Kinematics of nodes at rest at X (n, 3) mm.

    groups: of nodes (g, k) that the stiffness couples
    rigid: disjoint groups (k,) of free nodes, not all on one line
    joints: (m, 2) pairs of rigid groups whose unknowns are coupled, -1 for one that is held
    row: as in Kinematics, of all nodes"""
    full = make_pattern(len(X), groups, fixed)
    if not rigid:
        return Kinematics(X, full, full, None, fixed, None, np.zeros((0, 4, 4, 3), dtype=np.int32))
    pseudo = len(X) + np.arange(2 * len(rigid)).reshape(-1, 2)
    owner, movers = np.full(len(X), -1), np.full((len(X), 2), -1)  # movers: the nodes whose unknowns move a node
    movers[:, 0] = np.arange(len(X))
    for number, nodes in enumerate(rigid):
        owner[nodes], movers[nodes] = number, pseudo[number]
    a, b, slot = full.blocks()
    touched = (owner[a] >= 0) | (owner[b] >= 0)
    same = touched & (owner[a] == owner[b])
    across = touched & ~same
    plain = np.flatnonzero(~touched)
    pairs = np.stack([a[plain], b[plain]], axis=1)
    pairs[pairs[:, 0] == pairs[:, 1], 1] = -1
    joined = np.where(joints[:, :, None] >= 0, len(X) + 2 * joints[:, :, None] + np.arange(2), -1).reshape(-1, 4)
    coupled = [pairs, movers[a[same]], np.hstack([movers[a[across]], movers[b[across]]]), pseudo, joined]
    held = np.concatenate([fixed, np.flatnonzero(owner >= 0)])
    pattern = make_pattern(len(X) + pseudo.size, coupled, held)
    pair_slots, within_slots, across_slots, group_slots, joint_slots = pattern.slots
    transfer = Transfer(
        *copies(slot[plain], a[plain] == b[plain], pair_slots),
        (a[same], b[same], slot[same], within_slots),
        (a[across], b[across], slot[across], across_slots),
        group_slots,
    )
    rigid_groups = make_rigid_groups(X, rigid, pattern.number[pseudo])
    return Kinematics(X, pattern, full, rigid_groups, fixed, transfer, joint_slots, row)


def levers(kinematics: Kinematics, x: np.ndarray, nodes: np.ndarray, forces: np.ndarray) -> np.ndarray:
    """Levers L (k, g, 3, 3) N mm of each rigid group, the sum of r f^T - (r . f) 1 with r the arms from its mean at
    positions x (n, 3), of k sets of forces (k, m, 3) on nodes (m,). The moment r x f changes as r turns by w:
    (w x r) x f = r (w . f) - w (r . f)."""
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
