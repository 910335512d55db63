"""What the contact of a loaded robot takes for its local flexibility."""

import numpy as np

from cfem.predict.contact.loaded_robot import stiff_flexibility


def test_it_is_the_harmonic_mean_of_the_eigenvalues_and_zero_where_the_body_is_held():
    factors = np.random.default_rng(0).normal(size=(6, 3, 3))
    compliance = factors @ factors.swapaxes(1, 2)
    expected = 3 / (1 / np.linalg.eigvalsh(compliance)).sum(axis=1)
    np.testing.assert_allclose(stiff_flexibility(compliance), expected, rtol=1e-9)
    np.testing.assert_array_equal(stiff_flexibility(np.zeros((2, 3, 3))), [0.0, 0.0])
