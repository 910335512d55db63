"""Nodes that move as rigid bodies."""

from collections.abc import Sequence

import numpy as np

from cfem.core.errors import SpecError
from cfem.mechanics.mesh import Mesh
from cfem.robot.selection import Selection, select_nodes


def rigid_groups(mesh: Mesh, selections: Sequence[Selection], fixed: np.ndarray) -> tuple[np.ndarray, ...]:
    """Node indices of each rigid body. SpecError where a group has no three nodes off a line, shares nodes with
    another, or is held by `fixed` nodes."""
    groups = tuple(select_nodes(mesh, selection, f"rigid.{index}") for index, selection in enumerate(selections))
    for index, nodes in enumerate(groups):
        across = np.linalg.svd(mesh.X[nodes] - mesh.X[nodes].mean(axis=0), compute_uv=False)
        if len(nodes) < 3 or across[1] < 1e-6 * mesh.size:
            raise SpecError(
                f"{len(nodes)} nodes, all on one line, do not make a rigid body",
                where=f"rigid.{index}",
                do="select at least three nodes that are not on a line",
            )
        if (shared := np.intersect1d(nodes, fixed)).size:
            raise SpecError(
                f"shares {shared.size} of its {nodes.size} nodes with fixed",
                where=f"rigid.{index}",
                do="either list the whole of it under fixed, or select it apart from what is fixed",
            )
        for before in range(index):
            if (shared := np.intersect1d(nodes, groups[before])).size:
                raise SpecError(
                    f"shares {shared.size} nodes with rigid.{before}",
                    where=f"rigid.{index}",
                    do="make one group of the two, or select them apart",
                )
    return groups
