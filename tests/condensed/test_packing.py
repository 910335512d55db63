"""Upper triangles, row by row."""

import numpy as np
import pytest

from cfem.condensed import pack_upper, unpack_upper


def test_a_symmetric_matrix_comes_back_whatever_stands_before_it():
    W = np.arange(18.0).reshape(2, 3, 3)
    W = W + W.swapaxes(1, 2)
    packed = pack_upper(W)
    np.testing.assert_array_equal(packed[0], W[0][np.triu_indices(3)])
    np.testing.assert_array_equal(unpack_upper(packed), W)


@pytest.mark.parametrize("count", [2, 5, 7])
def test_a_count_that_is_no_triangle_is_named(count):
    with pytest.raises(ValueError, match=f"^{count} entries are no upper triangle"):
        unpack_upper(np.zeros((4, count)))
