"""The compiled compliance of patches is what the formulas say, written out in array operations."""

import numpy as np
from support.patches import drawn_patches

from cfem.predict.contact.surface.patch_compliance import patch_compliance
from cfem.predict.contact.surface.patched_model import turn_cubic


def test_parts_of_chosen_patches():
    drawn = drawn_patches()
    chosen, modes, C, R, at, local, dented = drawn
    U, left, total, dents = patch_compliance(*drawn)
    L = np.tensordot(at, local[chosen[:, None], chosen], axes=(0, 2))
    turned = (R[:, None] @ L @ R[None].swapaxes(-1, -2)).swapaxes(1, 2).reshape(9, 9)
    np.testing.assert_allclose(left, turned, atol=1e-12)
    np.testing.assert_allclose(total, turned + U @ C @ U.T, atol=1e-12)
    np.testing.assert_array_equal(U, modes[chosen].reshape(9, 4))
    np.testing.assert_allclose(dents, turn_cubic(np.tensordot(at, dented[:, chosen], axes=1), R), atol=1e-12)
