"""The basis, against numpy's own Chebyshev polynomials."""

import numpy as np
import pytest
from numpy.polynomial import chebyshev

from cfem.predict.series.chebyshev import Basis, basis


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 8])
@pytest.mark.parametrize("leading", [(), (3,)])
def test_functions_are_products_of_polynomials(n, leading):
    rng = np.random.default_rng(n)
    indices = rng.integers(0, 6, (40, n))
    z = rng.uniform(-1.2, 1.2, (*leading, n))
    true = np.ones((*leading, 40))
    for axis in range(n):
        true *= chebyshev.chebval(z[..., axis], np.eye(6))[indices[:, axis]].T
    np.testing.assert_allclose(basis(z, indices), true, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(Basis(indices)(z), true, rtol=1e-12, atol=1e-12)
