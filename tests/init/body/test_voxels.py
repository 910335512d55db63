"""A body as a lattice of cubes."""

import numpy as np
import pytest
from init.bodies import holed, tube

import cfem.init.body.voxels as module
from cfem.init.body.voxels import voxels


@pytest.mark.parametrize("pairs", [module._PAIRS, 1000])
@pytest.mark.parametrize("body", [holed, tube])
def test_cubes_are_inside_whose_middles_are_in_a_tetrahedron(body, pairs, monkeypatch):
    """However many are looked at together; each middle is also looked for in all tetrahedra."""
    monkeypatch.setattr(module, "_INSIDE", 800)
    monkeypatch.setattr(module, "_PAIRS", pairs)
    shape = body()
    found = voxels(shape.interior, float(np.abs(shape.mesh.volumes).sum()))
    middles = found.low + found.step * np.indices(found.inside.shape).reshape(3, -1).T
    expected = shape.interior.contains(middles, np.arange(len(shape.interior.low)))
    np.testing.assert_array_equal(found.inside.ravel(), expected)
    assert 500 < expected.sum() < 1200
