"""What inner motions do to effectors and skin, against NumPy's Chebyshev series and finite differences."""

import numpy as np
import pytest
from numpy.polynomial.chebyshev import chebval2d

from cfem.core.errors import InputError
from cfem.motion.inner_skin import InnerSkin

N_E, N_R, MODES = 2, 3, 4
INDICES = np.array([[0, 0], [1, 0], [0, 1], [1, 1]])
SKIN = np.array([[i, j] for i in range(4) for j in range(4 - i)])


@pytest.fixture(scope="module")
def given():
    rng = np.random.default_rng(3)
    arrays = {
        "to_box": np.array([[0.5, 0.2], [0.1, -0.6]]),
        "offset": np.array([0.2, -0.1]),
        "indices": INDICES,
        "skin_indices": SKIN,
        "skin": rng.normal(size=(MODES * N_R, len(SKIN))),
    }
    return arrays, rng.normal(size=(N_E * N_R, len(INDICES)))


def expected(given, delta_a):
    arrays, H = given
    x, y = arrays["to_box"] @ delta_a + arrays["offset"]
    rows = []
    for series, indices in ((H, INDICES), (arrays["skin"], SKIN)):
        for one in series:
            c = np.zeros((4, 4))
            c[tuple(indices.T)] = one
            rows.append(chebval2d(x, y, c))
    return np.reshape(rows, (N_E + MODES, N_R))


def test_effectors_come_first_then_the_modes_of_the_skin(given):
    made, delta_a = InnerSkin(*given, N_R), np.array([0.7, -0.4])
    value, slopes = made(delta_a)
    np.testing.assert_allclose(value, expected(given, delta_a), atol=1e-12)
    h = 1e-6
    for slope, step in zip(slopes, h * np.eye(2), strict=True):
        difference = (expected(given, delta_a + step) - expected(given, delta_a - step)) / (2 * h)
        np.testing.assert_allclose(slope, difference, atol=1e-8)
    assert made.modes == MODES


def test_a_map_of_the_rows_maps_values_and_slopes(given):
    T, delta_a = np.random.default_rng(0).normal(size=(5, N_E + MODES)), np.array([0.1, 0.9])
    plain, slopes = InnerSkin(*given, N_R)(delta_a)
    value, by_delta = InnerSkin(*given, N_R).mapped(T)(delta_a)
    np.testing.assert_allclose(value, T @ plain, atol=1e-12)
    np.testing.assert_allclose(by_delta, T @ slopes, atol=1e-12)


def test_rows_that_are_not_so_many_for_each_motion_are_refused(given):
    arrays, H = given
    with pytest.raises(InputError, match="array 'skin' has 11 rows, not so many for each of 3 inner motions"):
        InnerSkin(arrays | {"skin": arrays["skin"][:-1]}, H, N_R)
