"""Plain geometry of surfaces made of facets: what is connected, what is open, what winds around a point."""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

# The rim of a facet of so many nodes, from node to node.
_RIM = {3: [0, 1, 2], 6: [0, 3, 1, 4, 2, 5], 4: [0, 1, 2, 3]}


def components(groups: np.ndarray) -> tuple[int, np.ndarray]:
    """Number of the components that groups (m, k) form by the items that they share, and the component (m,) of each."""
    _, place = np.unique(groups, return_inverse=True)
    m = len(groups)
    size = m + place.max(initial=-1) + 1
    pairs = (np.repeat(np.arange(m), groups.shape[1]), m + place.ravel())
    count, label = connected_components(coo_array((np.ones(groups.size), pairs), shape=(size, size)), directed=False)
    return count, label[:m]


def edges(facets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Start and end (g, 3 | 6 | 4) of the edges of facets (g, 3 | 6 | 4) in the direction of their rims; the edges of
    a quadratic triangle are six halves."""
    start = facets[:, _RIM[facets.shape[1]]]
    return start, np.roll(start, -1, axis=1)


def unmatched_edges(facets: np.ndarray) -> np.ndarray:
    """Edges (m, 2) that are not used exactly once in either direction: none where the surface is closed, without
    branches, and oriented."""
    start, end = (part.ravel() for part in edges(facets))
    base = facets.max() + 1
    keys, uses = np.unique(start * base + end, return_counts=True)
    start, end = np.divmod(keys, base)
    reverse = end * base + start
    place = np.minimum(np.searchsorted(keys, reverse), len(keys) - 1)
    matched = (keys[place] == reverse) & (uses == 1) & (uses[place] == 1)
    return np.unique(np.sort(np.column_stack([start, end])[~matched], axis=1), axis=0)


def solid_angles(corners: np.ndarray) -> np.ndarray:
    """Signed solid angles (m,), seen from the origin, of facets (m, 3 | 4, 3), quadrilaterals as two triangles;
    positive where the normal points away (van Oosterom and Strackee, IEEE Trans. Biomed. Eng. 30, 1983, eq. 8)."""
    if corners.shape[1] == 4:
        return solid_angles(corners[:, [0, 1, 2]]) + solid_angles(corners[:, [0, 2, 3]])
    a, b, c = corners.swapaxes(0, 1)
    la, lb, lc = np.linalg.norm(corners, axis=2).T
    below = la * lb * lc + (a * b).sum(axis=1) * lc + (a * c).sum(axis=1) * lb + (b * c).sum(axis=1) * la
    return 2 * np.arctan2((a * np.cross(b, c)).sum(axis=1), below)
