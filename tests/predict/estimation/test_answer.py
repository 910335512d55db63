"""What an estimate says of itself."""

import numpy as np
import pytest

from cfem.predict.estimation.answer import Estimate, innovation_ratio
from cfem.predict.estimation.fit import EstimateStatus


def test_the_ratio_of_innovations_is_all_squares_over_all_numbers():
    assert innovation_ratio([(3.0, 2), (4.0, 1)]) == pytest.approx(7 / 3)
    assert innovation_ratio([(3.0, 2), (50.0, 0), (4.0, 1)]) == pytest.approx(7 / 3)  # a frame that shows nothing


@pytest.mark.parametrize("innovations", [[], [(5.0, 0)]])
def test_without_frames_there_is_no_ratio(innovations):
    assert innovation_ratio(innovations) is None


@pytest.mark.parametrize("status", EstimateStatus)
def test_deviations_are_the_roots_of_the_variances(status):
    none = np.zeros(0)
    P = np.array([[4.0, 1.0], [1.0, 9.0]])
    found = Estimate(status, none, none, P, none, none, (), (), 1.0, 1, (0.0, 0))
    np.testing.assert_allclose(found.deviation, [2.0, 3.0])
    assert found.converged == (status.name == "CONVERGED")
