"""How nodes move with the unknowns: free nodes one by one, held nodes not at all, rigid groups by a frame of six.

A rigid group moves by x_i = c + exp(omega) (x_i0 - c0). Its unknowns are two pseudo-nodes appended to the mesh's: the
translation (mm), and the rotation vector omega times the group's radius of gyration (mm, so that all unknowns are of
one size). With T = dx/dq at the present pose and f the unbalanced nodal forces,

    A_q = T^T A T + sum_i sym(f_i r_i^T) - (f_i . r_i) 1     on the rotation, r_i = x_i - c

the last from the second derivative of exp(omega) r_i (Geradin and Cardona, Flexible Multibody Dynamics, ch. 4)."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from scipy.spatial.transform import Rotation

from cfem.mechanics.assembly import Pattern, add_blocks, make_pattern
from cfem.mechanics.sections import Sections
from cfem.mechanics.transfer import Transfer, copies

NO_JOINTS = np.zeros((0, 2), dtype=int)


@dataclass(frozen=True)
class Group:
    """nodes (k,); arm (k, 3) mm from their mean, at rest; radius: of gyration, mm; pseudo: numbers of the two
    pseudo-nodes among the free."""

    nodes: np.ndarray
    arm: np.ndarray
    radius: float
    pseudo: np.ndarray


@dataclass(frozen=True)
class Kinematics:
    """pattern: of the unknowns, whose slots are those of the groups of nodes given, where no node is rigid;
    full: the same for all nodes as if none were rigid (the same object where there is no group);
    groups: the rigid ones; transfer: how blocks of `full` reach `pattern`; joint_slots: (m, 4, 4, 3) of the joints
    between groups, their unknowns (translation a, rotation a, translation b, rotation b); row: sections that move
    together, of which the first is held and the others are groups, in this order."""

    X: np.ndarray
    pattern: Pattern
    full: Pattern
    groups: tuple[Group, ...]
    fixed: np.ndarray
    transfer: "Transfer | None"
    joint_slots: np.ndarray
    row: Sections | None = None

    @property
    def n_dof(self) -> int:
        return self.pattern.n_dof

    def reduce(self, x: np.ndarray, nodal: np.ndarray, only: np.ndarray | None = None) -> np.ndarray:
        """T^T of nodal (n, 3) or (n, 3, k) at positions x: (n_dof,) or (n_dof, k). only: (n,) nodes that count."""
        free = self.pattern.free
        if not self.groups:
            return nodal[free].reshape(self.n_dof, *nodal.shape[2:])
        out = np.zeros((len(free), *nodal.shape[1:]))
        plain = free < len(self.X)
        out[plain] = nodal[free[plain]]
        all_ = self.members
        nodes, r, _, start = self._chosen(x, only)
        f = nodal[nodes].reshape(len(r), 3, -1)
        moment = np.add.reduceat(_cross(r[:, :, None], f), start) / all_.radius[:, None]
        out[all_.translation] = np.add.reduceat(f, start).reshape(-1, *nodal.shape[1:])
        out[all_.rotation] = moment.reshape(-1, *nodal.shape[1:])
        return out.reshape(self.n_dof, *nodal.shape[2:])

    def spread(self, x: np.ndarray, q: np.ndarray, only: np.ndarray | None = None) -> np.ndarray:
        """T q: nodal motion (n, 3) to first order in the unknowns q (n_dof,), (n, 3, k) of k changes (n_dof, k). only:
        (n,) nodes of groups that are asked for."""
        blocks, free = q.reshape(len(q) // 3, 3, *q.shape[1:]), self.pattern.free
        out = np.zeros((*self.X.shape, *q.shape[1:]))
        plain = free < len(self.X)
        out[free[plain]] = blocks[plain]
        if self.groups:
            all_ = self.members
            nodes, r, owner, _ = self._chosen(x, only)
            by_group = blocks.reshape(len(blocks), 3, -1)
            turn = by_group[all_.rotation] / all_.radius[:, None]
            moved = by_group[all_.translation][owner] + _cross(turn[owner], r[:, :, None])
            out[nodes] = moved.reshape(len(r), *out.shape[1:])
        return out

    def _chosen(self, x: np.ndarray, only: np.ndarray | None) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Nodes of groups, their arms, owners, and where each group begins: all of them, or those that `only` says."""
        all_, r = self.members, self.arms(x)[1]
        if only is None:
            return all_.nodes, r, all_.owner, all_.start
        kept = only[all_.nodes]
        kept[all_.start] = True  # a group without any would have no place of its own
        owner = all_.owner[kept]
        return all_.nodes[kept], r[kept], owner, np.searchsorted(owner, np.arange(len(all_.start)))

    def move(self, x: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Positions (n, 3) after the change q (n_dof,) of the unknowns: rigid groups stay rigid."""
        blocks, free = q.reshape(-1, 3), self.pattern.free
        moved = x.copy()
        plain = free < len(self.X)
        moved[free[plain]] += blocks[plain]
        if self.groups:
            all_ = self.members
            centre, r = self.arms(x)
            turn = Rotation.from_rotvec(blocks[all_.rotation] / all_.radius).as_matrix()
            shifted = centre + blocks[all_.translation]
            moved[all_.nodes] = shifted[all_.owner] + (turn[all_.owner] @ r[:, :, None])[:, :, 0]
        return moved

    def advance(self, x: np.ndarray, q: np.ndarray) -> np.ndarray:
        """As `move`, to first order: where sections are in a row, each follows the one before (sections.py)."""
        if self.row is None:
            return self.move(x, q)
        all_, blocks = self.members, q.reshape(-1, 3)
        motions = np.zeros((len(self.row.nodes), 6))
        motions[1:, :3], motions[1:, 3:] = blocks[all_.translation], blocks[all_.rotation] / all_.radius
        moved = x.copy()
        moved[self.row.nodes] = self.row.advanced(x, motions)
        return moved

    def hold(self, x: np.ndarray) -> np.ndarray:
        """The nearest admissible positions: held nodes at rest, groups rigid (Kabsch, Acta Cryst. A32, 1976). No
        residual would tell if a start had moved them otherwise."""
        held = x.copy()
        held[self.fixed] = self.X[self.fixed]
        if self.groups:
            all_ = self.members
            centre, r = self.arms(x)
            U, _, Vt = np.linalg.svd(np.add.reduceat(r[:, :, None] * all_.arm[:, None], all_.start))
            handed = np.ones((len(U), 1, 3))
            handed[:, 0, 2] = np.sign(np.linalg.det(U @ Vt))
            turn = (U * handed) @ Vt
            held[all_.nodes] = centre[all_.owner] + (turn[all_.owner] @ all_.arm[:, :, None])[:, :, 0]
        return held

    def stiffness(self, x: np.ndarray, data: np.ndarray, unbalanced: np.ndarray) -> np.ndarray:
        """Data (lower triangle) of the matrix of the unknowns from that of all nodes; unbalanced: (n, 3) N, the nodal
        residual, of which rigid groups carry the moment."""
        if not self.groups:
            return data
        out = np.zeros(self.pattern.nnz)
        if len(data):
            self.transfer.fill(self._nodal_T(x), data, out)
        own = np.zeros((len(self.groups), 6, 6))
        own[:, 3:, 3:] = self._turned(x, unbalanced)
        add_blocks(own, self.transfer.own, out)
        return out

    def transfer_matrix(self, x: np.ndarray) -> sp.csr_array:
        """(3 n, n_dof) T: nodal motion, node by node, by the unknowns."""
        free = self.pattern.free
        plain = np.flatnonzero(free < len(self.X))
        rows = (3 * free[plain][:, None] + np.arange(3)).ravel()
        columns = (3 * plain[:, None] + np.arange(3)).ravel()
        values = np.ones(len(rows))
        if self.groups:
            all_ = self.members
            own = self._nodal_T(x)[all_.nodes]
            mine = self.unknowns(all_.owner)
            place = (3 * all_.nodes[:, None] + np.arange(3))[:, :, None]
            rows = np.concatenate([rows, np.broadcast_to(place, own.shape).ravel()])
            columns = np.concatenate([columns, np.broadcast_to(mine[:, None], own.shape).ravel()])
            values = np.concatenate([values, own.ravel()])
        return sp.csr_array(sp.coo_array((values, (rows, columns)), shape=(3 * len(self.X), self.n_dof)))

    def turning_form(self, x: np.ndarray, q: np.ndarray, unbalanced: np.ndarray) -> np.ndarray:
        """(k, k) N mm: of changes q (n_dof, k) of the unknowns, what the turning of rigid groups adds to the form of
        the nodal stiffness; unbalanced as in `stiffness`."""
        turns = q.reshape(-1, 3, q.shape[1])[self.members.rotation]
        return np.tensordot(turns, self._turned(x, unbalanced) @ turns, axes=((0, 1), (0, 1)))

    def unknowns(self, numbers: np.ndarray) -> np.ndarray:
        """(..., 6) places among the unknowns of the groups with these numbers (...), -1 each of a group -1."""
        all_ = self.members
        nodes = np.stack([all_.translation[numbers], all_.rotation[numbers]], axis=-1)
        places = (3 * nodes[..., None] + np.arange(3)).reshape(*np.shape(numbers), 6)
        return np.where(np.asarray(numbers)[..., None] >= 0, places, -1)

    @cached_property
    def members(self) -> "Members":
        counts = np.array([len(group.nodes) for group in self.groups])
        pseudo = np.array([group.pseudo for group in self.groups])
        return Members(
            np.concatenate([group.nodes for group in self.groups]),
            np.repeat(np.arange(len(counts)), counts),
            np.cumsum(counts) - counts,
            counts[:, None],
            np.concatenate([group.arm for group in self.groups]),
            np.array([[group.radius] for group in self.groups]),
            *pseudo.T,
        )

    def _turned(self, x: np.ndarray, unbalanced: np.ndarray) -> np.ndarray:
        """(g, 3, 3) N/mm on the groups' rotations, by the second derivative of their nodes' positions."""
        all_ = self.members
        outer = np.add.reduceat(unbalanced[all_.nodes][:, :, None] * self.arms(x)[1][:, None], all_.start)
        trace = np.trace(outer, axis1=1, axis2=2)[:, None, None]
        return ((outer + outer.swapaxes(1, 2)) / 2 - trace * np.eye(3)) / all_.radius[:, None] ** 2

    def arms(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Of the groups: their nodes' means (g, 3), and all their nodes (N, 3) from there, mm."""
        all_ = self.members
        own = x[all_.nodes]
        centre = np.add.reduceat(own, all_.start) / all_.count
        return centre, own - centre[all_.owner]

    def _nodal_T(self, x: np.ndarray) -> np.ndarray:
        """(n, 3, 6): T of each node; for a node of no group, its own motion in the first three columns."""
        T = np.zeros((len(self.X), 3, 6))
        T[:, range(3), range(3)] = 1.0
        all_ = self.members
        r = self.arms(x)[1] / all_.radius[all_.owner]
        for (i, j), sign in {(0, 1): 1, (1, 2): 1, (2, 0): 1, (1, 0): -1, (2, 1): -1, (0, 2): -1}.items():
            T[all_.nodes, i, 3 + j] = sign * r[:, 3 - i - j]  # omega x r
        return T


@dataclass(frozen=True)
class Members:
    """The g groups one after the other: nodes (N,), each one's group `owner` (N,), where each begins, how many it has
    (g, 1), arms (N, 3) mm at rest, radii (g, 1) mm, places (g,) of the pseudo-nodes among the free."""

    nodes: np.ndarray
    owner: np.ndarray
    start: np.ndarray
    count: np.ndarray
    arm: np.ndarray
    radius: np.ndarray
    translation: np.ndarray
    rotation: np.ndarray


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """a x b along the second axis."""
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
    """groups: of nodes (g, k) that the stiffness couples; rigid: disjoint groups (k,) of free nodes, not all on one
    line; joints: (m, 2) pairs of rigid groups whose unknowns are coupled, -1 for one that is held;
    row: as in Kinematics, of all nodes."""
    full = make_pattern(len(X), groups, fixed)
    if not rigid:
        return Kinematics(X, full, full, (), fixed, None, np.zeros((0, 4, 4, 3), dtype=np.int32))
    owner = np.full(len(X), -1)
    for number, nodes in enumerate(rigid):
        owner[nodes] = number
    pseudo = np.full((len(X), 2), -1)
    for number, nodes in enumerate(rigid):
        pseudo[nodes] = len(X) + 2 * number + np.arange(2)
    pseudo[owner < 0, 0] = np.flatnonzero(owner < 0)
    # every block of the full pattern, as the pair of nodes that it couples
    starts = full.indptr[:-1].reshape(-1, 3)
    first = np.repeat(np.arange(len(full.free)), np.diff(full.indptr)[::3] // 3)
    place = np.arange(len(first)) - np.searchsorted(first, first)
    slot = starts[first] + np.where(place[:, None] == 0, -np.arange(3), 3 * place[:, None] - np.arange(3))
    b, a = full.free[first], full.free[full.indices[slot[:, 0]] // 3]
    touched = (owner[a] >= 0) | (owner[b] >= 0)
    same = touched & (owner[a] == owner[b])
    across = touched & ~same
    plain = np.flatnonzero(~touched)
    within_nodes, across_nodes = pseudo[a[same]], np.hstack([pseudo[a[across]], pseudo[b[across]]])
    own_nodes = len(X) + np.arange(2 * len(rigid)).reshape(-1, 2)
    pairs = np.stack([a[plain], b[plain]], axis=1)
    pairs[pairs[:, 0] == pairs[:, 1], 1] = -1
    held = np.concatenate([fixed, np.flatnonzero(owner >= 0)])
    total = len(X) + 2 * len(rigid)
    joined = np.where(joints[:, :, None] >= 0, len(X) + 2 * joints[:, :, None] + np.arange(2), -1).reshape(-1, 4)
    pattern = make_pattern(total, [pairs, within_nodes, across_nodes, own_nodes, joined], held)
    pair_slots, within_slots, across_slots, own, joint_slots = pattern.slots
    copy_from, copy_to = copies(slot[plain], a[plain] == b[plain], pair_slots)
    transfer = Transfer(
        copy_from,
        copy_to,
        (a[same], b[same], slot[same], within_slots),
        (a[across], b[across], slot[across], across_slots),
        own,
    )
    made = []
    for number, nodes in enumerate(rigid):
        arm = X[nodes] - X[nodes].mean(axis=0)
        radius = float(np.sqrt((arm**2).sum(axis=1).mean()))
        made.append(Group(nodes, arm, radius, pattern_number(pattern, len(X) + 2 * number + np.arange(2))))
    return Kinematics(X, pattern, full, tuple(made), fixed, transfer, joint_slots, row)


def pattern_number(pattern: Pattern, nodes: np.ndarray) -> np.ndarray:
    return pattern.number[nodes]
