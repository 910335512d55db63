from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cfem.condensed import Condensed, Rows, pack_upper, unpack_upper

ROWS = Rows(("tip.x", "tip.y"), ("left", "right"), ("touch",))


def condensed():
    A = np.random.default_rng(0).standard_normal((5, 5))
    return Condensed(ROWS, A @ A.T, np.arange(5.0), np.array([1.0, 2.0, 3.0]))


@given(n=st.integers(1, 8), seed=st.integers(0, 1000))
def test_packing_is_undone(n, seed):
    A = np.random.default_rng(seed).standard_normal((3, n, n))
    A = A + np.swapaxes(A, 1, 2)
    np.testing.assert_array_equal(unpack_upper(pack_upper(A)), A)


def test_packing_goes_row_by_row_and_refuses_what_is_no_triangle():
    assert pack_upper(np.array([[1, 2], [2, 3]])).tolist() == [1, 2, 3]
    with pytest.raises(ValueError, match="no upper triangle"):
        unpack_upper(np.zeros(4))


def test_blocks_follow_the_order_e_a_c():
    value = condensed()
    assert ROWS.names == ("tip.x", "tip.y", "left", "right", "touch")
    np.testing.assert_array_equal(value.W_ea, value.W[:2, 2:4])
    np.testing.assert_array_equal(value.W_aa, value.W[2:4, 2:4])
    np.testing.assert_allclose(value.delta, value.W @ [0, 0, 1, 2, 3] + value.delta_free)
    np.testing.assert_array_equal(value.lambda_a, [1.0, 2.0])


def test_effector_jacobian_maps_active_displacements():
    value = condensed()
    step = np.array([0.1, -0.2, 0.3])
    multipliers = np.linalg.solve(value.W[2:, 2:], step)
    np.testing.assert_allclose(value.effector_jacobian @ step, value.W[:2, 2:] @ multipliers)


def test_goal_shifts_the_free_effector_displacement_and_nothing_else():
    value = condensed()
    shifted = value.towards(np.array([1.0, -1.0]))
    np.testing.assert_allclose(shifted.delta_free, value.delta_free - [1, -1, 0, 0, 0])
    assert shifted.W is value.W


def test_what_is_derived_is_computed_once_and_cannot_be_overwritten():
    rows = Rows(("e.x",), ("left", "right"))
    condensed = Condensed(rows, np.diag([1.0, 2.0, 4.0]), np.zeros(3), np.array([1.0, 0.5]))
    assert condensed.delta is condensed.delta and condensed.effector_jacobian is condensed.effector_jacobian
    with pytest.raises(ValueError, match="read-only"):
        condensed.delta_a[0] = 1.0
    moved = replace(condensed, lam=np.array([2.0, 1.0]))
    np.testing.assert_allclose(moved.delta_a, 2 * condensed.delta_a)
