"""A force in a fixed direction: its row is the way along the force."""

import numpy as np
import pytest

from cfem.constraint.attachment import Attachment
from cfem.constraint.push import make_push


def test_value_and_gradient_are_of_the_mean_along_the_direction():
    X = np.random.default_rng(0).standard_normal((6, 3))
    points = [Attachment(np.array([0, 2]), np.array([0.25, 0.75]), 0.25 * X[0] + 0.75 * X[2])]
    points.append(Attachment(np.array([2, 5]), np.array([0.5, 0.5]), 0.5 * X[2] + 0.5 * X[5]))
    push = make_push(points, np.array([0.0, 3.0, 4.0]))
    assert push.value(X) == pytest.approx(push.rest)
    moved = X + [0.0, 1.0, 0.0]
    assert push.value(moved) - push.rest == pytest.approx(0.6)
    gradient = np.zeros((6, 3))
    gradient[push.nodes] = push.gradient(X)[0]
    np.testing.assert_allclose(gradient.sum(axis=0), [0, 0.6, 0.8])
    assert gradient[2] @ [0, 0.6, 0.8] == pytest.approx((0.75 + 0.5) / 2) and push.curvature(X) == ()
