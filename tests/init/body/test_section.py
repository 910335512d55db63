"""Cuts of bodies whose sections are known, and balls near walls that are."""

import numpy as np
import pytest
from init.bodies import box_shape, tapered, tube

from cfem.init.body.section import clear, cut


@pytest.mark.parametrize("share", [0.05, 0.5, 0.9])
def test_a_cut_across_a_bent_and_tapered_bar(share):
    shape = tapered(60.0, 12.0, 8.0, 0.5, 5.0)
    section = cut(shape.interior, 2, 60 * share)
    wide, thin = 12 * (1 - share / 2), 8 * (1 - share / 2)
    assert section.area == pytest.approx(wide * thin, rel=0.05)
    assert section.inscribed == pytest.approx(thin / 2, rel=0.1)
    assert section.slimness == pytest.approx((thin / wide) ** 2, rel=0.1)
    np.testing.assert_allclose(section.centre, [20 * share * (1 - share), 0, 60 * share], atol=0.15)
    np.testing.assert_allclose(np.abs(section.thin), [0, 1, 0], atol=0.05)


def test_a_hollow_body_is_cut_as_such():
    section = cut(tube(60.0, 12.0, 3.0).interior, 2, 31.0)
    assert section.area == pytest.approx(12**2 - 6**2, rel=0.05)
    np.testing.assert_allclose(section.centre, [6, 6, 31], atol=0.05)
    assert section.inscribed == pytest.approx(1.5 * 1.17, rel=0.15)  # at the corners there is more room than in a wall


def test_a_plane_beside_the_body_cuts_nothing():
    assert cut(box_shape().interior, 0, 61.0) is None


def test_balls_that_fit_and_balls_that_do_not():
    body = box_shape((60.0, 10.0, 10.0)).interior
    y = np.array([1.9, 2.3, 5.0, 7.7, 8.1])
    points = np.column_stack([np.full(5, 30.0), y, np.full(5, 5.0)])
    np.testing.assert_array_equal(clear(body, points, 2.0), [False, True, True, True, False])
    # in a corner the nearest wall lies off all 26 directions
    assert not clear(body, np.array([[1.99, 5.0, 5.0]]), 2.0).any()
