"""How often intervals hold the truth, over hundreds of simulated calibrations."""

import numpy as np
import pytest
from identify.cases.linear import LinearRig, Sort, cases_of, coverage, trial

from cfem.identify.cases.fit import fit_cases
from cfem.identify.cases.left_out import LeftOut, leave_one_out
from cfem.identify.cases.scatter import Scatter

_SLOW = pytest.mark.slow


@pytest.mark.parametrize(
    ("m", "sort"),
    [
        (5, Sort(lacks=1.0, offset_sd=5.0)),
        pytest.param(4, Sort(lacks=1.0), marks=_SLOW),
        pytest.param(5, Sort(grows=None), marks=_SLOW),
        pytest.param(5, Sort(offset_sd=5.0), marks=_SLOW),
        pytest.param(8, Sort(lacks=1.0, offset_sd=5.0), marks=_SLOW),
        pytest.param(5, Sort(lacks=3.0, offset_sd=5.0), marks=_SLOW),
        pytest.param(5, Sort(grows=1.0), marks=_SLOW),
    ],
)
def test_intervals_cover_what_they_say(m, sort):
    """Whether the model is right, or lacks as much or three times as much as the noise, in one pattern a case, and
    whether or not the noise grows with the load."""
    coordinates, markers = coverage(200 if sort.lacks > 1 else 120, m, sort)
    assert 0.93 < coordinates < 0.97
    assert 0.90 < markers < 0.97  # errors of one pattern a case are along one axis, which the radius does not know


@pytest.mark.slow
@pytest.mark.parametrize(("lacks", "models"), [(1.0, 12), (0.0, 5)])
def test_intervals_cover_where_left_out_cases_chose_the_model(lacks, models):
    coordinates, markers = coverage(80, 5, Sort(lacks, 5.0, models=models))
    assert 0.93 < coordinates < 0.98 and 0.92 < markers < 0.985


def test_intervals_widen_to_loads_that_no_case_has():
    """Three times larger: right on average where nobody knows whether the noise grows, too wide where it does not."""
    small, large = (0.25, 0.35), (0.8, 1.0)
    coordinates, markers = coverage(60, 4, Sort(grows=None, given=small, asked=large))
    assert 0.93 < coordinates < 0.97 and 0.92 < markers < 0.97


def test_cases_that_err_as_one_count_as_few():
    sd = np.tile(np.eye(3), (4, 2, 1, 1))
    alike = LeftOut(np.ones((4, 2, 3)) * np.array([1.0, 1.01, 0.99, 1.0])[:, None, None], sd, ())
    unlike = LeftOut(np.ones((4, 2, 3)) * np.array([3.0, 0.1, 0.1, 0.1])[:, None, None], sd, ())
    assert alike.degrees(20.0) == 20 and unlike.degrees(20.0) == 3
    assert unlike.inflation == pytest.approx(np.sqrt((9 + 0.03) / 4))


def test_a_left_out_case_does_not_widen_its_own_interval():
    sd = np.tile(np.eye(3), (4, 2, 1, 1))
    left = LeftOut(np.ones((4, 2, 3)) * np.array([9.0, 1.0, 1.01, 0.99])[:, None, None], sd, ())
    assert left.covered(20.0, 0.95) == (0.75, 0.75)


def test_one_case_is_not_left_out_of_itself():
    rig = LinearRig(np.random.default_rng(0), 5.0)
    given = cases_of(np.array([1.0]), np.ones((1, 4, 3)))
    left = leave_one_out(rig, given, fit_cases(rig, given, Scatter(1.0)))
    assert left.failed == ("c0",) and left.inflation == 1 and left.degrees(3.0) == 1


def test_a_radius_is_that_of_a_normal_vector_where_much_is_known():
    found = trial(np.random.default_rng(1), 40, Sort(), new=1)
    assert found.radius[0, 0] == pytest.approx(2.8, rel=0.35) and found.half[0, 0, 0] == pytest.approx(1.96, rel=0.35)
