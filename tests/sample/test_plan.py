"""Row i depends on seed and i alone, fills the cube, and stands for the actuation it says."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError
from scipy.stats import qmc

from cfem.core.errors import SpecError
from cfem.sample.plan import (
    actuation,
    borne,
    borne_together,
    shards,
    skeleton,
    unit_rows,
    walk,
    with_idle,
    within_reach,
)
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


OPPOSED = np.array([[2.0, 0.3, -1.5], [0.3, 1.0, 0.2], [-1.5, 0.2, 2.0]])
REACH = np.array([20.0, 10.0, 15.0])


def forces(share, amount):
    """(n_a,) N of the linear robot, from lambda = mu C^T with C W lambda = amount."""
    C = share / (share.sum() * REACH)
    return C * amount / (C @ OPPOSED @ C)


@pytest.mark.parametrize("share", [[1.0, 0.9, 1.0], [0.8, 0.7, 0.9], [1.0, 0.0, 1.0]])
def test_a_pull_of_several_carries_no_more_load_than_that_of_all_which_the_body_bears(share):
    share, everyone, alone = np.array(share), np.ones(3), REACH / np.diag(OPPOSED)
    whole = within_reach(share, REACH, OPPOSED)
    all_at_once = forces(everyone, 0.6 * within_reach(everyone, REACH, OPPOSED)) / alone
    amount = borne(share, REACH, OPPOSED, 0.6, whole)
    carried = (forces(share, amount) / alone).sum()
    assert amount < whole and carried == pytest.approx(max(1.0, all_at_once.sum()))
    assert borne(share, REACH, OPPOSED, 1.0, whole) == whole


@pytest.mark.parametrize("cable", range(3))
def test_one_actuator_alone_goes_its_whole_reach_however_little_all_can(cable):
    share = np.eye(3)[cable]
    whole = within_reach(share, REACH, OPPOSED)
    assert borne(share, REACH, OPPOSED, 0.05, whole) == pytest.approx(whole, rel=1e-12)


@pytest.mark.parametrize("critical", [0.3, 0.72, 0.99])
def test_all_are_pulled_at_once_less_than_what_buckles_the_body(critical):
    """A robot that is stable up to a share of the pull of all; what it says of its way is used, or not there."""
    end = within_reach(np.ones(3), REACH, OPPOSED)
    for says in (True, False):

        def solve(asked, says=says):
            share = asked.target[0] / end
            lost = critical / share if says else 1.0
            return SimpleNamespace(converged=share <= critical, path=lost)

        assert 0.4 * critical < borne_together(solve, REACH, OPPOSED) < 0.8 * critical


def test_robots_that_bear_all_at_once_are_pulled_as_they_were():
    def solve(asked):
        return SimpleNamespace(converged=True, path=1.0)

    assert borne_together(solve, REACH, OPPOSED) == 1.0


def test_a_pull_that_is_borne_beyond_one_that_is_not_does_not_count():
    """As on another branch beyond the load at which a body buckles."""
    end = within_reach(np.ones(3), REACH, OPPOSED)

    def solve(asked):
        share = asked.target[0] / end
        return SimpleNamespace(converged=not 0.6 < share < 0.9, path=1.0)

    assert 0.25 < borne_together(solve, REACH, OPPOSED) < 0.6


def test_a_robot_that_bears_no_pull_of_all_ends_the_search():
    def solve(asked):
        return SimpleNamespace(converged=False, path=0.0)

    assert 0.0 < borne_together(solve, REACH, OPPOSED) < 0.05


def test_idle_actuators_are_as_many_as_was_asked_and_parameters_stay():
    u = unit_rows(split("scrambled-halton", 4096, 1), 5)
    drawn = with_idle(u, 4, 0.2)
    np.testing.assert_allclose((drawn[:, :4] == 0.0).mean(axis=0), 0.2, atol=0.01)
    pulled = np.sort(drawn[:, 0][drawn[:, 0] > 0])
    np.testing.assert_allclose(pulled, np.linspace(0, 1, len(pulled)), atol=0.01)
    np.testing.assert_array_equal(drawn[:, 4], u[:, 4])
    np.testing.assert_array_equal(with_idle(u, 4, 0.0), u)


def test_idle_is_of_pulls():
    splits = {"train": {"method": "random", "rows": 5, "seed": 1}}
    with pytest.raises(ValidationError, match="idle needs space: pulling"):
        SampleSpec(scene="s", mesh="m", out="o", splits=splits, space="displacement", idle=0.2)


def test_train_and_test_may_not_share_their_rows():
    same = {"method": "random", "rows": 5, "seed": 1}
    with pytest.raises(ValidationError, match="different seeds"):
        SampleSpec(scene="s", mesh="m", out="o", splits={"train": same, "test": same | {"rows": 3}})


@given(st.integers(1, 150), st.integers(1, 4), st.integers(1, 30), st.integers(1, 60), st.integers(0, 9))
def test_skeleton_and_shards_hold_every_row_once(m, n_a, count, size, seed):
    u = np.random.default_rng(seed).random((m, n_a))
    first = skeleton(u, count)
    pieces = shards(u, np.setdiff1d(np.arange(m), first), size)
    assert len(first) == min(m, count) and all(0 < len(piece) <= size for piece in pieces)
    np.testing.assert_array_equal(np.sort(np.concatenate([first, *pieces])), np.arange(m))


def test_repeated_rows_are_visited_too():
    u = np.zeros((9, 2))
    assert sorted(np.concatenate(shards(u, np.arange(9), 2))) == list(range(9))
    assert len(set(skeleton(u, 9))) == 9


def test_the_skeleton_spreads():
    u = np.random.default_rng(0).random((400, 2))
    first = u[skeleton(u, 16)]
    nearest = np.sqrt(((u[:, None] - first) ** 2).sum(axis=2)).min(axis=1)
    assert nearest.max() < 0.25
    np.testing.assert_array_equal(first[0], u[(u**2).sum(axis=1).argmin()])  # a walk that begins at rest


def test_steps_within_a_shard_are_short():
    u = np.random.default_rng(0).random((400, 2))
    pieces = shards(u, np.arange(400), 50)
    steps = np.concatenate([np.linalg.norm(np.diff(u[piece], axis=0), axis=1) for piece in pieces])
    assert steps.mean() < 0.06  # random order: 0.52


def test_a_walk_along_a_line_goes_straight():
    u = np.random.default_rng(1).permutation(20)[:, None] / 20
    np.testing.assert_array_equal(u[walk(u, np.arange(20)), 0], np.arange(20) / 20)
