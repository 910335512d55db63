"""Patches drawn at random, as the compiled loops take them."""

import numpy as np
from scipy.spatial.transform import Rotation


def drawn_patches():
    """Arguments of `patch_compliance`: 3 of 6 patches, 4 modes, 2 effectors and 5 terms, with symmetric series."""
    rng = np.random.default_rng(0)
    local = rng.normal(size=(6, 6, 5, 3, 3))
    local = local + local.transpose(1, 0, 2, 4, 3)
    C = rng.normal(size=(4, 4))
    R = Rotation.random(3, rng=rng).as_matrix()
    chosen, at = np.array([1, 2, 5]), rng.normal(size=5)
    modes, dented = rng.normal(size=(6, 3, 4)), rng.normal(size=(5, 6, 3, 3, 5))
    return chosen, modes, C @ C.T, R, at, local, dented
