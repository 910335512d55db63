"""The stiffness by unknowns of which some move many nodes, from the stiffness by nodes."""

from dataclasses import dataclass

import numpy as np

from cfem.mechanics.assembly import add_blocks


@dataclass(frozen=True)
class Transfer:
    """Map from nodal blocks to blocks of the unknowns.

    copy_from, copy_to: entries between nodes of no group
    within, across: blocks (row node a, column node b, slot (3,) in `full`) that touch a group, within one group and
    across
    diagonal: (g, 2, 2, 3) slots of each group's own block"""

    copy_from: np.ndarray
    copy_to: np.ndarray
    within: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
    across: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
    diagonal: np.ndarray

    def fill(self, T: np.ndarray, data: np.ndarray, out: np.ndarray) -> None:
        """Adds to `out`, entries by unknowns, those by nodes of `data`; T: (n, 3, 6) motion of the nodes."""
        np.add.at(out, self.copy_to, data[self.copy_from])
        a, b, slot, to = self.within
        B = np.einsum("kip,kij,kjq->kpq", T[a], _blocks(a, b, slot, data), T[b])
        B = np.where((a == b)[:, None, None], B, B + B.transpose(0, 2, 1))
        add_blocks(B, to, out)
        a, b, slot, to = self.across
        B = np.einsum("kip,kij,kjq->kpq", T[a], _blocks(a, b, slot, data), T[b])
        blocks = np.zeros((len(a), 12, 12))
        blocks[:, :6, 6:], blocks[:, 6:, :6] = B, B.transpose(0, 2, 1)
        add_blocks(blocks, to, out)


def _blocks(a: np.ndarray, b: np.ndarray, slot: np.ndarray, data: np.ndarray) -> np.ndarray:
    """Nodal blocks (k, 3, 3) in full, those on the diagonal completed from their lower triangle."""
    index = slot[:, None, :] + np.arange(3)[None, :, None]
    diagonal = a == b
    upper = np.array([[False, True, True], [False, False, True], [False, False, False]])
    index[diagonal] = np.where(upper, index[diagonal].transpose(0, 2, 1), index[diagonal])
    return data[index]


def copies(slot: np.ndarray, diagonal: np.ndarray, pair_slots: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Entry by entry, from the full pattern to the reduced one, whose node order keeps that of the plain nodes."""
    to = np.where(diagonal[:, None], pair_slots[:, 0, 0], pair_slots[:, 0, 1])
    entries_from, entries_to = slot[:, None, :] + np.arange(3)[:, None], to[:, None, :] + np.arange(3)[:, None]
    keep = ~diagonal[:, None, None] | (np.arange(3)[:, None] >= np.arange(3))
    return entries_from[keep], entries_to[keep]
