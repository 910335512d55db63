"""How nodes move with the unknowns: free nodes one by one, held nodes not at all, rigid groups by a frame of six.

A rigid group moves by x_i = c + exp(omega) (x_i0 - c0). Its unknowns are two pseudo-nodes appended to the mesh's: the
translation (mm), and the rotation vector omega times the group's radius of gyration (mm, so that all unknowns are of
one size). With T = dx/dq at the present pose and f the unbalanced nodal forces,

    A_q = T^T A T + sum_i sym(f_i r_i^T) - (f_i . r_i) 1     on the rotation, r_i = x_i - c

the last from the second derivative of exp(omega) r_i (Geradin and Cardona, Flexible Multibody Dynamics, ch. 4)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from cfem.mechanics.assembly import Pattern, add_blocks, make_pattern


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
    groups: the rigid ones; block_map: how blocks of `full` reach `pattern`."""

    X: np.ndarray
    pattern: Pattern
    full: Pattern
    groups: tuple[Group, ...]
    fixed: np.ndarray
    transfer: "_Transfer | None"

    @property
    def n_dof(self) -> int:
        return self.pattern.n_dof

    def reduce(self, x: np.ndarray, nodal: np.ndarray) -> np.ndarray:
        """T^T of nodal (n, 3) or (n, 3, k) at positions x: (n_dof,) or (n_dof, k)."""
        free = self.pattern.free
        if not self.groups:
            return nodal[free].reshape(self.n_dof, *nodal.shape[2:])
        out = np.zeros((len(free), *nodal.shape[1:]))
        plain = free < len(self.X)
        out[plain] = nodal[free[plain]]
        for group in self.groups:
            r, f = self._arm(group, x), nodal[group.nodes]
            translation, rotation = group.pseudo
            out[translation] = f.sum(axis=0)
            out[rotation] = (
                np.cross(r[:, :, None], f.reshape(len(r), 3, -1), axis=1).sum(axis=0).reshape(nodal.shape[1:])
                / group.radius
            )
        return out.reshape(self.n_dof, *nodal.shape[2:])

    def spread(self, x: np.ndarray, q: np.ndarray) -> np.ndarray:
        """T q: nodal motion (n, 3) to first order in the unknowns q (n_dof,)."""
        blocks, free = q.reshape(-1, 3), self.pattern.free
        out = np.zeros_like(self.X)
        plain = free < len(self.X)
        out[free[plain]] = blocks[plain]
        for group in self.groups:
            translation, rotation = blocks[group.pseudo]
            out[group.nodes] = translation + np.cross(rotation / group.radius, self._arm(group, x))
        return out

    def move(self, x: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Positions (n, 3) after the change q (n_dof,) of the unknowns: rigid groups stay rigid."""
        moved = x + self.spread(x, q)
        blocks = q.reshape(-1, 3)
        for group in self.groups:
            translation, rotation = blocks[group.pseudo]
            turn = Rotation.from_rotvec(rotation / group.radius)
            moved[group.nodes] = x[group.nodes].mean(axis=0) + translation + turn.apply(self._arm(group, x))
        return moved

    def hold(self, x: np.ndarray) -> np.ndarray:
        """The nearest admissible positions: held nodes at rest, groups rigid (Kabsch, Acta Cryst. A32, 1976). No
        residual would tell if a start had moved them otherwise."""
        held = x.copy()
        held[self.fixed] = self.X[self.fixed]
        for group in self.groups:
            centre = held[group.nodes].mean(axis=0)
            turn, _ = Rotation.align_vectors(held[group.nodes] - centre, group.arm)
            held[group.nodes] = centre + turn.apply(group.arm)
        return held

    def stiffness(self, x: np.ndarray, data: np.ndarray, unbalanced: np.ndarray) -> np.ndarray:
        """Data (lower triangle) of the matrix of the unknowns from that of all nodes; unbalanced: (n, 3) N, the nodal
        residual, of which rigid groups carry the moment."""
        if not self.groups:
            return data
        out = np.zeros(self.pattern.nnz)
        self.transfer.fill(self._nodal_T(x), data, out)
        for group, slots in zip(self.groups, self.transfer.own, strict=True):
            block = np.zeros((1, 6, 6))
            block[0, 3:, 3:] = self._turned(group, x, unbalanced)
            add_blocks(block, slots, out)
        return out

    def turning_form(self, x: np.ndarray, q: np.ndarray, unbalanced: np.ndarray) -> np.ndarray:
        """(k, k) N mm: of changes q (n_dof, k) of the unknowns, what the turning of rigid groups adds to the form of
        the nodal stiffness; unbalanced as in `stiffness`."""
        turns = [(group, q.reshape(-1, 3, q.shape[1])[group.pseudo[1]]) for group in self.groups]
        return sum((turn.T @ self._turned(group, x, unbalanced) @ turn for group, turn in turns), np.zeros(()))

    def _turned(self, group: Group, x: np.ndarray, unbalanced: np.ndarray) -> np.ndarray:
        """(3, 3) N/mm on the group's rotation, by the second derivative of its nodes' positions."""
        outer = unbalanced[group.nodes].T @ self._arm(group, x)
        return ((outer + outer.T) / 2 - np.trace(outer) * np.eye(3)) / group.radius**2

    def _arm(self, group: Group, x: np.ndarray) -> np.ndarray:
        return x[group.nodes] - x[group.nodes].mean(axis=0)

    def _nodal_T(self, x: np.ndarray) -> np.ndarray:
        """(n, 3, 6): T of each node; for a node of no group, its own motion in the first three columns."""
        T = np.zeros((len(self.X), 3, 6))
        T[:, range(3), range(3)] = 1.0
        for group in self.groups:
            r = self._arm(group, x) / group.radius
            for (i, j), sign in {(0, 1): 1, (1, 2): 1, (2, 0): 1, (1, 0): -1, (2, 1): -1, (0, 2): -1}.items():
                T[group.nodes, i, 3 + j] = sign * r[:, 3 - i - j]  # omega x r
        return T


@dataclass(frozen=True)
class _Transfer:
    """From nodal blocks to blocks of the unknowns. copy_from, copy_to: entries between nodes of no group; then blocks
    (row node a, column node b, slot (3,) in `full`) that touch a group, within one group and across; own: slots of
    each group's own block."""

    copy_from: np.ndarray
    copy_to: np.ndarray
    within: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
    across: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
    own: tuple[np.ndarray, ...]

    def fill(self, T: np.ndarray, data: np.ndarray, out: np.ndarray) -> None:
        np.add.at(out, self.copy_to, data[self.copy_from])
        a, b, slot, to = self.within
        B = np.einsum("kip,kij,kjq->kpq", T[a], _blocks(a, b, slot, data), T[b])
        B = np.where((a == b)[:, None, None], B, B + B.transpose(0, 2, 1))
        add_blocks(B, to, out)
        a, b, slot, to = self.across
        B = np.einsum("kip,kij,kjq->kpq", T[a], _blocks(a, b, slot, data), T[b])
        both = np.zeros((len(a), 12, 12))
        both[:, :6, 6:], both[:, 6:, :6] = B, B.transpose(0, 2, 1)
        add_blocks(both, to, out)


def _blocks(a: np.ndarray, b: np.ndarray, slot: np.ndarray, data: np.ndarray) -> np.ndarray:
    """(k, 3, 3) nodal blocks in full, those on the diagonal completed from their lower triangle."""
    index = slot[:, None, :] + np.arange(3)[None, :, None]
    diagonal = a == b
    upper = np.array([[False, True, True], [False, False, True], [False, False, False]])
    index[diagonal] = np.where(upper, index[diagonal].transpose(0, 2, 1), index[diagonal])
    return data[index]


def make_kinematics(
    X: np.ndarray, groups: Sequence[np.ndarray], fixed: np.ndarray, rigid: Sequence[np.ndarray] = ()
) -> Kinematics:
    """groups: of nodes (g, k) that the stiffness couples; rigid: disjoint groups (k,) of free nodes, not all on one
    line."""
    full = make_pattern(len(X), groups, fixed)
    if not rigid:
        return Kinematics(X, full, full, (), fixed, None)
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
    own_nodes = [pseudo[nodes[:1]] for nodes in rigid]
    pairs = np.stack([a[plain], b[plain]], axis=1)
    pairs[pairs[:, 0] == pairs[:, 1], 1] = -1
    held = np.concatenate([fixed, np.flatnonzero(owner >= 0)])
    total = len(X) + 2 * len(rigid)
    pattern = make_pattern(total, [pairs, within_nodes, across_nodes, *own_nodes], held)
    pair_slots, within_slots, across_slots, *own = pattern.slots
    copy_from, copy_to = _copies(slot[plain], a[plain] == b[plain], pair_slots)
    transfer = _Transfer(
        copy_from,
        copy_to,
        (a[same], b[same], slot[same], within_slots),
        (a[across], b[across], slot[across], across_slots),
        tuple(own),
    )
    made = []
    for number, nodes in enumerate(rigid):
        arm = X[nodes] - X[nodes].mean(axis=0)
        radius = float(np.sqrt((arm**2).sum(axis=1).mean()))
        made.append(Group(nodes, arm, radius, pattern_number(pattern, len(X) + 2 * number + np.arange(2))))
    return Kinematics(X, pattern, full, tuple(made), fixed, transfer)


def pattern_number(pattern: Pattern, nodes: np.ndarray) -> np.ndarray:
    return pattern.number[nodes]


def _copies(slot: np.ndarray, diagonal: np.ndarray, pair_slots: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Entry by entry, from the full pattern to the reduced one, whose node order keeps that of the plain nodes."""
    to = np.where(diagonal[:, None], pair_slots[:, 0, 0], pair_slots[:, 0, 1])
    entries_from, entries_to = slot[:, None, :] + np.arange(3)[:, None], to[:, None, :] + np.arange(3)[:, None]
    keep = ~diagonal[:, None, None] | (np.arange(3)[:, None] >= np.arange(3))
    return entries_from[keep], entries_to[keep]
