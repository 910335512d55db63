"""Named parts of a user's mesh: physical groups of .msh, sets of nodes and elements of .inp, and arrays 'set:<name>'
(of nodes or facets) and 'cellset:<name>' (of cells) of 0 and 1 in any other file."""

from collections.abc import Iterator, Mapping, Sequence

import meshio
import numpy as np

SET, CELL_SET = "set:", "cellset:"
_CORNERS = {"triangle": 3, "triangle6": 3, "quad": 4, "quad8": 4, "quad9": 4}

Sets = dict[str, np.ndarray]


def named_sets(
    data: meshio.Mesh, solid: Sequence[int], used: np.ndarray, facets: np.ndarray
) -> tuple[Sets, Sets, Sets]:
    """Node, facet and cell sets, name -> indices, without the empty ones: a group of solid cells is a cell set, one of
    facets on the boundary a facet set, and any other the set of its nodes.

    solid: the blocks of `data` that make up the cells, in order; used: (n,) its nodes that are kept, ascending;
    facets: (k, 3 | 4) of the boundary by nodes as kept."""
    node_sets, facet_sets, cell_sets = {}, {}, {}
    boundary = {frozenset(facet): index for index, facet in enumerate(used[facets].tolist())}
    first = dict(zip(solid, np.cumsum([0] + [len(data.cells[index]) for index in solid]), strict=False))
    for name, nodes in _node_groups(data):
        node_sets[name] = np.flatnonzero(np.isin(used, nodes))
    for name, groups in _cell_groups(data):
        by_block = {index: members for index, members in enumerate(groups) if len(members)}
        if by_block.keys() <= first.keys():
            numbers = [first[index] + members for index, members in by_block.items()]
            cell_sets[name] = np.concatenate(numbers) if numbers else np.empty(0, dtype=int)
            continue
        blocks = [data.cells[index] for index in by_block]
        faces = [block.data[members] for block, members in zip(blocks, by_block.values(), strict=True)]
        corners = [
            frozenset(face[: _CORNERS.get(block.type, 1)])
            for block, block_faces in zip(blocks, faces, strict=True)
            for face in block_faces.tolist()
        ]
        if all(face in boundary for face in corners):
            facet_sets[name] = np.unique([boundary[face] for face in corners])
        else:
            nodes = np.concatenate([block_faces.ravel() for block_faces in faces])
            node_sets[name] = np.flatnonzero(np.isin(used, nodes))
    return tuple(
        {name: members for name, members in sets.items() if len(members)} for sets in (node_sets, facet_sets, cell_sets)
    )


def arrays(data: Mapping, prefix: str) -> Iterator[tuple[str, np.ndarray]]:
    """Arrays whose name begins with `prefix`, by their name without it."""
    for name, flags in data.items():
        if name.startswith(prefix):
            yield name.removeprefix(prefix), flags


def _node_groups(data: meshio.Mesh) -> Iterator[tuple[str, np.ndarray]]:
    for name, nodes in data.point_sets.items():
        yield name, np.asarray(nodes, dtype=int)
    for name, flags in arrays(data.point_data, SET):
        yield name, np.flatnonzero(flags)


def _cell_groups(data: meshio.Mesh) -> Iterator[tuple[str, list[np.ndarray]]]:
    """Name of each group of cells, and the indices of its members in each block."""
    for prefix in (SET, CELL_SET):
        for name, flags in arrays(data.cell_data, prefix):
            yield name, [np.flatnonzero(block_flags) for block_flags in flags]
    for name, members in data.cell_sets.items():
        if name not in data.field_data and not name.startswith("gmsh:"):
            yield name, [np.asarray(of_block, dtype=int) for of_block in members]
    tags = data.cell_data.get("gmsh:physical", [])
    for name, (tag, dimension) in data.field_data.items():
        if name in data.cell_sets:  # of .msh 4, where an entity may be of several groups
            yield name, [np.asarray(members, dtype=int) for members in data.cell_sets[name]]
        elif len(tags) == len(data.cells):
            pairs = zip(data.cells, tags, strict=True)
            yield name, [np.flatnonzero((tagged == tag) & (block.dim == dimension)) for block, tagged in pairs]
