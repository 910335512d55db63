"""Modes of a surface from states: exact where the states have few, and the front of what is left."""

import numpy as np
import pytest
from support.blocks import block

from cfem.constraint.surface import outer_surface
from cfem.sample.skin import SkinSample, find_skin, patches, probed
from cfem.sample.spec import SkinSpec

BODY = block((1, 1, 4), (1, 1, 4))
SURFACE = outer_surface(BODY.X, BODY.facets)


def seen(count, motions, yields=None, seed=0):
    """States that are random combinations of motions (k, m, 3)."""
    mixes = np.random.default_rng(seed).normal(size=(count, len(motions)))
    return [SkinSample(np.tensordot(mix, motions, 1), np.moveaxis(motions, 0, -1), mix, yields) for mix in mixes]


def bends(count):
    z = SURFACE.rest[:, 2] / 4
    return np.stack([np.outer(z ** (2 + k), [1.0, 0.3 * k, 0.1]) for k in range(count)])


@pytest.mark.parametrize("yields", [None, np.moveaxis(bends(2), 0, -1)])
def test_states_of_three_motions_have_three_modes(yields):
    states = seen(9, bends(3), yields)
    skin = find_skin(SURFACE, states, SkinSpec(), 4.0)
    assert len(skin.modes) == 3
    for one in seen(4, bends(3), seed=1):
        assert skin.left(one.displacements)[1] < 1e-9
    products = np.einsum("m,kmi,lmi->kl", skin.weights, skin.modes, skin.modes)
    np.testing.assert_allclose(products, np.eye(3), atol=1e-12)


def test_the_front_is_what_modes_of_other_states_leave():
    states = seen(8, bends(4))
    skin = find_skin(SURFACE, states, SkinSpec(modes=4), 4.0)
    assert len(skin.modes) == 4 and skin.front.shape == (5, 2)
    everything = np.array([one.displacements for one in states])
    assert skin.front[0, 1] == pytest.approx(np.linalg.norm(everything, axis=2).max())
    assert (np.diff(skin.front[:, 0]) < 0).all() and skin.front[4, 1] < 1e-9
    loose = find_skin(SURFACE, states, SkinSpec(tolerance=f"{skin.front[2, 1] * 1.01} mm"), 4.0)
    assert len(loose.modes) == 2
    np.testing.assert_allclose(loose.modes, skin.modes[:2], atol=1e-9)


def test_a_tolerance_out_of_reach_takes_as_many_modes_as_allowed():
    skin = find_skin(SURFACE, seen(8, bends(6)), SkinSpec(tolerance="1e-9 mm", largest=2), 4.0)
    assert len(skin.modes) == 2 and skin.front[2, 1] > 1e-9


def test_patches_are_means_of_the_surface_around_them():
    pushed = patches(SURFACE)
    np.testing.assert_allclose(
        pushed.rows(np.tile([1.0, 2.0, 3.0], (len(SURFACE.nodes), 1))).reshape(-1, 3)[0], [1, 2, 3]
    )
    np.testing.assert_array_equal(probed(3), [0, 1, 2])
    assert len(probed(40)) == 6 and probed(40)[[0, -1]].tolist() == [0, 39]


def test_modes_and_a_tolerance_are_one_too_many():
    with pytest.raises(ValueError, match="leave one of them out"):
        SkinSpec(modes=3, tolerance="1 mm")
