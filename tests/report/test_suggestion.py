"""The page of a suggested robot draws a chamber by all edges of its wall."""

from itertools import pairwise
from types import SimpleNamespace

import numpy as np

from cfem.report.suggestion import _wire

OCTAHEDRON = np.array([[[x, 0, 0], [0, y, 0], [0, 0, z]] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])


def test_a_chamber_is_drawn_by_all_of_its_edges():
    walk = _wire(SimpleNamespace(corners=OCTAHEDRON))
    edges = {frozenset([tuple(a), tuple(b)]) for a, b in pairwise(walk)}
    assert len(edges) == 12
    assert np.allclose(np.linalg.norm(np.diff(walk, axis=0), axis=1), np.sqrt(2))
