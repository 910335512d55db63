"""Named parts of a user's mesh: physical groups of .msh, and arrays 'set:<name>' (of nodes or facets) and
'cellset:<name>' (of cells) of 0 and 1 in any other file."""

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
        members = {index: own for index, own in enumerate(groups) if len(own)}
        if members.keys() <= first.keys():
            chosen = [first[index] + own for index, own in members.items()]
            cell_sets[name] = np.concatenate(chosen) if chosen else np.empty(0, dtype=int)
            continue
        blocks = [data.cells[index] for index in members]
        chosen = [block.data[own] for block, own in zip(blocks, members.values(), strict=True)]
        corners = [
            frozenset(cell[: _CORNERS.get(block.type, 1)])
            for block, cells in zip(blocks, chosen, strict=True)
            for cell in cells.tolist()
        ]
        if all(cell in boundary for cell in corners):
            facet_sets[name] = np.unique([boundary[cell] for cell in corners])
        else:
            node_sets[name] = np.flatnonzero(np.isin(used, np.concatenate([cells.ravel() for cells in chosen])))
    return tuple({name: own for name, own in sets.items() if len(own)} for sets in (node_sets, facet_sets, cell_sets))


def arrays(data: Mapping, prefix: str) -> Iterator[tuple[str, np.ndarray]]:
    """The arrays whose name has that prefix, by their name without it."""
    for name, flags in data.items():
        if name.startswith(prefix):
            yield name.removeprefix(prefix), flags


def _node_groups(data: meshio.Mesh) -> Iterator[tuple[str, np.ndarray]]:
    for name, nodes in data.point_sets.items():
        yield name, np.asarray(nodes, dtype=int)
    for name, flags in arrays(data.point_data, SET):
        yield name, np.flatnonzero(flags)


def _cell_groups(data: meshio.Mesh) -> Iterator[tuple[str, list[np.ndarray]]]:
    """Name and members, block by block."""
    for prefix in (SET, CELL_SET):
        for name, flags in arrays(data.cell_data, prefix):
            yield name, [np.flatnonzero(own) for own in flags]
    tags = data.cell_data.get("gmsh:physical", [])
    for name, (tag, dimension) in data.field_data.items():
        if name in data.cell_sets:  # of .msh 4, where an entity may be of several groups
            yield name, [np.asarray(own, dtype=int) for own in data.cell_sets[name]]
        elif len(tags) == len(data.cells):
            pairs = zip(data.cells, tags, strict=True)
            yield name, [np.flatnonzero((own == tag) & (block.dim == dimension)) for block, own in pairs]
