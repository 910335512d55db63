import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cfem.equilibrium.system.actuation import displacement, force, pull


def test_displacement_and_force_are_the_two_extremes():
    assert displacement([1.0, 2.0]).C.shape == (2, 2)
    assert force([1.0, 2.0]).C.shape == (0, 2)
    assert force([1.0, 2.0]).offset.tolist() == [1.0, 2.0]


@given(share=st.lists(st.floats(0.01, 1.0), min_size=1, max_size=4))
def test_pull_of_one_cable_alone_or_of_all_alike_is_its_share_of_the_reach(share):
    reach = np.full(len(share), 20.0)
    alike = pull(np.full(len(share), share[0]), reach)
    np.testing.assert_allclose(alike.C @ (share[0] * reach), alike.target)
    alone = pull(np.eye(len(share))[0] * share[0], reach)
    assert alone.C[0, 0] * share[0] * 20.0 == pytest.approx(alone.target[0])


def test_nothing_pulled_is_rest():
    assert pull(np.zeros(2), np.ones(2)).C.shape == (0, 2)


@given(
    pairs=st.lists(st.tuples(st.floats(0.01, 10.0), st.floats(0.01, 1.0)), min_size=1, max_size=4),
    reach=st.floats(1.0, 50.0),
)
def test_every_pulling_state_within_reach_is_a_point_of_the_cube(pairs, reach):
    lambda_a, part = np.array(pairs).T
    amount = lambda_a @ part / lambda_a.sum()
    share = lambda_a / lambda_a.max() * amount
    asked = pull(share, np.full(len(share), reach))
    assert share.max() <= 1.0 + 1e-12
    np.testing.assert_allclose(asked.C @ (part * reach), asked.target)
    np.testing.assert_allclose(asked.C[0] / asked.C[0].sum(), lambda_a / lambda_a.sum())
