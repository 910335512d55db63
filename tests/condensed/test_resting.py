"""Where a pose rests, against minimising the energy by the coordinates that are free."""

import numpy as np
import pytest

from cfem.condensed.resting import resting


@pytest.mark.parametrize("free", [[2], [1, 3], [0, 1, 2, 3]])
def test_the_free_coordinates_carry_nothing(free):
    """The wrench that holds the pose under these forces vanishes on the free coordinates."""
    rng = np.random.default_rng(1)
    root = rng.normal(size=(6, 6))
    W, n_a, n = root @ root.T + np.eye(6), 2, 4
    forces, pose = rng.normal(size=n_a), rng.normal(size=n)
    pose[free] = 0.0
    pose += resting(W, n_a, free) @ np.concatenate([forces, pose])
    wrench = np.linalg.solve(W[n_a:, n_a:], pose - W[n_a:, :n_a] @ forces)
    np.testing.assert_allclose(wrench[free], 0.0, atol=1e-12)
