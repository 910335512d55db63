"""Parameters and the coordinates in which robots are smooth in them."""

import numpy as np
import pytest

from cfem.condensed.parameters import (
    Parameter,
    completed,
    coordinates,
    from_json,
    from_shares,
    references,
    sampled,
    shares,
    slopes,
    to_json,
    values,
    vector,
)
from cfem.core.errors import SpecError

YOUNG = Parameter("E", "material.young", "MPa", 1.0, 10.0, 3.0, "log", exact=True)
POISSON = Parameter("nu", "material.poisson", "1", 0.4, 0.499, 0.47, "log(1-2p)")
LENGTH = Parameter("l", "geometry.length", "mm", 38.0, 42.0, 40.0)
ALL = (YOUNG, POISSON, LENGTH)
P = np.array([[1.5, 0.41, 38.5], [9.0, 0.495, 41.0]])


def test_each_coordinate_is_the_function_it_is_named_after():
    expected = np.stack([np.log(P[:, 0]), np.log(1 - 2 * P[:, 1]), P[:, 2]], axis=1)
    np.testing.assert_allclose(coordinates(ALL, P), expected, rtol=1e-14)


@pytest.mark.parametrize("shape", [(3,), (2, 3), (2, 1, 3)])
def test_values_are_the_inverse_for_one_and_for_many(shape):
    p = np.broadcast_to(P[0], shape)
    q = coordinates(ALL, p)
    assert q.shape == shape and slopes(ALL, p).shape == shape
    np.testing.assert_allclose(values(ALL, q), p, rtol=1e-13)


def test_slopes_are_the_derivatives():
    h = 1e-6
    for i in range(3):
        step = h * np.eye(3)[i]
        difference = (coordinates(ALL, P + step) - coordinates(ALL, P - step))[:, i] / (2 * h)
        np.testing.assert_allclose(slopes(ALL, P)[:, i], difference, rtol=1e-6)


def test_they_are_kept_as_json_and_exact_ones_have_no_columns():
    assert from_json(to_json(ALL)) == ALL and sampled(ALL) == (POISSON, LENGTH)


def test_exact_ones_are_completed_by_their_reference():
    np.testing.assert_array_equal(completed(ALL, P[:, 1:]), np.column_stack([[3.0, 3.0], P[:, 1:]]))
    np.testing.assert_array_equal(completed(ALL, P[0, 1:]), [3.0, *P[0, 1:]])
    assert completed((), np.zeros((5, 0))).shape == (5, 0) and references(()).shape == (0,)


def test_none_at_all_have_no_coordinates_and_no_shares():
    none = np.zeros((4, 0))
    for function in (coordinates, values, slopes, shares, from_shares):
        assert function((), none).shape == (4, 0)


PARAMETERS = (
    Parameter("E", "material.young", "MPa", 1.0, 10.0, 3.0, "log", True),
    Parameter("L", "geometry.segment_length", "mm", 38.0, 42.0, 40.0),
    Parameter("nu", "material.poisson", "1", 0.4, 0.49, 0.47, "log(1-2p)"),
)


def test_what_is_left_out_is_the_scenes_own():
    np.testing.assert_allclose(vector(PARAMETERS, {"L": "4.1 cm", "nu": 0.45}, "design"), [3.0, 41.0, 0.45])
    np.testing.assert_allclose(vector(PARAMETERS, {"E": "5000 kPa"}, "design"), [5.0, 40.0, 0.47])


@pytest.mark.parametrize(
    ("design", "says"),
    [
        ({"H": "20 mm"}, "design: unknown parameter 'H'"),
        ({"L": "45 mm"}, r"design.L: 45 is out of the range \[38, 42\] mm"),
        ({"L": "45 kPa"}, "design.L"),
        ({"nu": "soft"}, "design.nu"),
    ],
)
def test_what_is_no_design_is_said_with_its_name(design, says):
    with pytest.raises(SpecError, match=says):
        vector(PARAMETERS, design, "design")
