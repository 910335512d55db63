"""Bodies of plane sections in a row along x, joined by slices of hexahedra."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from cfem.mechanics.mesh import Mesh, boundary_facets

_SECTION = "section-"


def sliced_mesh(sections: Sequence[np.ndarray], quads: np.ndarray) -> Mesh:
    """Mesh of hexahedra between neighbouring sections (k, 3) mm of the same quadrilaterals (f, 4); each section is a
    node set."""
    k = len(sections[0])
    a, b, c, d = quads.T
    slice_cells = np.column_stack([a, a + k, b + k, b, d, d + k, c + k, c])
    cells = np.concatenate([slice_cells + k * number for number in range(len(sections) - 1)])
    node_sets = {f"{_SECTION}{number:03d}": k * number + np.arange(k) for number in range(len(sections))}
    return Mesh(np.concatenate(sections), cells, boundary_facets(cells), node_sets)


def steps(stops: Sequence[float], size: float) -> np.ndarray:
    """Ascending positions from the first stop to the last, through all, at most `size` apart."""
    spans = [
        np.linspace(start, end, int(np.ceil((end - start) / size - 1e-9)) + 1)[:-1] for start, end in pairwise(stops)
    ]
    return np.concatenate([*spans, stops[-1:]])


def sections_of(mesh: Mesh) -> list[np.ndarray]:
    """Node indices of each section, from the base on."""
    return [np.sort(mesh.node_sets[name]) for name in sorted(mesh.node_sets) if name.startswith(_SECTION)]
