"""Parts of an assembly: put in their places, and their meshes made one."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from cfem.mechanics.mesh import Mesh
from cfem.robot.cad import Box, Placed
from cfem.robot.geometry import Part, Turn


def place(mesh: Mesh, part: Part) -> Mesh:
    """The part's mesh, from the coordinates of its geometry to the scene's."""
    rotation, shift = motion_of(part.rotate, part.translate)
    return replace(mesh, X=mesh.X @ rotation.T + shift)


def place_back(mesh: Mesh, part: Part) -> Mesh:
    """The inverse of `place`."""
    rotation, shift = motion_of(part.rotate, part.translate)
    return replace(mesh, X=(mesh.X - shift) @ rotation)


def seen_from(box: Box, part: Part) -> Box | Placed:
    """A box in the scene's coordinates, in those of the part's geometry: the inverse of `place`."""
    rotation, shift = motion_of(part.rotate, part.translate)
    if np.abs(rotation - np.round(rotation)).max() < 1e-12:
        corners = (np.array([box.low, box.high]) - shift) @ np.round(rotation)
        return Box(tuple(corners.min(axis=0).tolist()), tuple(corners.max(axis=0).tolist()))
    return Placed(box, tuple(part.rotate.axis), -part.rotate.angle, tuple((-shift @ rotation).tolist()))


def join(parts: Mapping[str, Mesh]) -> Mesh:
    """One mesh of several with elements of one kind, none of whose nodes are merged. A part's name is that of its
    nodes, facets and cells; its sets `end` become `part.end`."""
    X, cells, facets, nodes, n_cells, n_facets = [], [], [], 0, 0, 0
    node_sets, facet_sets, cell_sets = {}, {}, {}
    for name, mesh in parts.items():
        X.append(mesh.X)
        cells.append(mesh.cells + nodes)
        facets.append(mesh.facets + nodes)
        for sets, part_sets, start, count in (
            (node_sets, mesh.node_sets, nodes, len(mesh.X)),
            (facet_sets, mesh.facet_sets, n_facets, len(mesh.facets)),
            (cell_sets, mesh.cell_sets, n_cells, len(mesh.cells)),
        ):
            sets[name] = start + np.arange(count)
            sets.update({f"{name}.{key}": start + members for key, members in part_sets.items()})
        nodes, n_cells, n_facets = nodes + len(mesh.X), n_cells + len(mesh.cells), n_facets + len(mesh.facets)
    return Mesh(np.concatenate(X), np.concatenate(cells), np.concatenate(facets), node_sets, facet_sets, cell_sets)


def motion_of(rotate: Turn | None, translate: Sequence[float] | None) -> tuple[np.ndarray, np.ndarray]:
    """Rotation (3, 3) and shift (3,) mm: x -> rotation @ x + shift."""
    return rotation_of(rotate), np.zeros(3) if translate is None else np.asarray(translate, float)


def rotation_of(turn: Turn | None) -> np.ndarray:
    """Rotation (3, 3) of a turn, none of None."""
    if turn is None:
        return np.eye(3)
    axis = np.asarray(turn.axis, float)
    return Rotation.from_rotvec(turn.angle * axis / np.linalg.norm(axis)).as_matrix()
