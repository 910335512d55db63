"""Row i depends on seed and i alone, fills the cube, and stands for the actuation it says."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError
from scipy.stats import qmc

from cfem.core.errors import SpecError
from cfem.sample.plan import actuation, unit_rows
from cfem.sample.spec import SampleSpec, SplitSpec


def split(method, rows, seed=0):
    return SplitSpec(method=method, rows=rows, seed=seed)


@pytest.mark.parametrize("method", ["scrambled-halton", "random"])
@given(seed=st.integers(0, 2**63 - 1), n_a=st.integers(1, 6), few=st.integers(1, 20), more=st.integers(1, 60))
def test_more_rows_extend_a_plan(method, seed, n_a, few, more):
    few, more = sorted((few, more))
    short, long = (unit_rows(split(method, rows, seed), n_a) for rows in (few, more))
    np.testing.assert_array_equal(short, long[:few])


@pytest.mark.parametrize("method", ["scrambled-halton", "random", "latin-hypercube", "grid"])
def test_rows_fill_the_unit_cube(method):
    u = unit_rows(split(method, 1024, 3), 2)
    assert u.shape == (1024, 2) and u.min() >= 0 and u.max() <= 1
    counts, _, _ = np.histogram2d(*u.T, bins=4, range=[[0, 1], [0, 1]])
    assert counts.min() > 32
    np.testing.assert_allclose(u.mean(axis=0), 0.5, atol=0.03)


@pytest.mark.parametrize("method", ["scrambled-halton", "random", "latin-hypercube"])
def test_seeds_differ(method):
    assert not np.isin(unit_rows(split(method, 50, 1), 2), unit_rows(split(method, 50, 2), 2)).any()


def test_halton_is_more_even_than_random():
    halton, random = (qmc.discrepancy(unit_rows(split(method, 256, 1), 2)) for method in ("scrambled-halton", "random"))
    assert halton < random / 5


def test_each_latin_hypercube_slice_holds_one_row():
    u = unit_rows(split("latin-hypercube", 40, 1), 3)
    np.testing.assert_array_equal(np.sort(np.floor(u * 40), axis=0), np.arange(40.0)[:, None].repeat(3, axis=1))


def test_a_grid_has_its_corners_and_says_which_sizes_there_are():
    np.testing.assert_array_equal(unit_rows(split("grid", 4), 2), [[0, 0], [0, 1], [1, 0], [1, 1]])
    with pytest.raises(SpecError, match="rows: 9"):
        unit_rows(split("grid", 10), 2)


def test_a_single_cable_at_half_share_is_pulled_by_half_its_reach_in_both_spaces():
    reach, compliance = np.array([[0.0, 20.0], [0.0, 10.0]]), np.array([[2.0, 0.5], [0.5, 1.0]])
    pulled = actuation("pulling", np.array([0.5, 0.0]), reach, compliance)
    np.testing.assert_allclose(np.array([10.0, 3.0]) @ pulled.C.T, pulled.target)
    boxed = actuation("displacement", np.array([0.5, 1.0]), reach, compliance)
    np.testing.assert_allclose(boxed.target, [10.0, 10.0])


@pytest.mark.parametrize("share", [[1.0, 0.0, 0.6], [0.3, 0.9, 0.9], [0.2, 0.2, 0.2], [0.0, 0.5, 1.0]])
def test_in_a_linear_robot_the_first_cable_to_come_near_its_end_goes_the_largest_share(share):
    """Three cables, the third of which pays out what the first takes in."""
    reach = np.array([[0.0, 20.0], [0.0, 10.0], [0.0, 15.0]])
    compliance = np.array([[2.0, 0.3, -1.5], [0.3, 1.0, 0.2], [-1.5, 0.2, 2.0]])
    pulled = actuation("pulling", np.array(share), reach, compliance)
    mu = pulled.target / (pulled.C @ compliance @ pulled.C.T)[0]
    delta = compliance @ (pulled.C.T @ mu)
    np.testing.assert_allclose((delta / reach[:, 1]).max(), max(share))


def test_train_and_test_may_not_share_their_rows():
    same = {"method": "random", "rows": 5, "seed": 1}
    with pytest.raises(ValidationError, match="different seeds"):
        SampleSpec(scene="s", mesh="m", out="o", splits={"train": same, "test": same | {"rows": 3}})
