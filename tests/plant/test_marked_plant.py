"""Markers on a robot of finite elements move with its surface."""

import numpy as np
import pytest
from support.blocks import bar

from cfem.plant.fem_plant import FemPlant
from cfem.plant.marked_plant import MarkedPlant
from cfem.plant.marker_noise import MarkerNoise
from cfem.plant.protocol import Measurement


@pytest.fixture(scope="module")
def robot():
    return bar(element="hex8", divisions=(4, 1, 1), cables=1)


def test_a_marker_on_a_node_is_that_node_and_one_between_is_between(robot):
    a, b = robot.facets[0][:2]
    X = robot.X
    # beside the surface by a little: the nearest point of it is meant
    places = np.array([X[a], X[b], (X[a] + X[b]) / 2])
    marked = MarkedPlant(FemPlant(robot), robot, places, X[[b]])
    seen = marked.step(np.array([1.0]))
    x = marked._plant.x
    assert np.abs(x - X).max() > 0.1 and not marked.moves
    np.testing.assert_allclose(seen.markers, [x[a], x[b], (x[a] + x[b]) / 2], atol=1e-9)
    np.testing.assert_allclose(seen.surface, x[[b]], atol=1e-9)


def test_what_has_not_converged_has_no_markers(robot):
    marked = MarkedPlant(FemPlant(robot), robot, robot.X[[0]], robot.X[[0]])
    assert marked.step(np.array([np.nan])).markers is None


def test_sensors_have_their_own_noise_and_streams_their_seeds():
    true = Measurement(np.zeros(3), np.zeros(4000), np.zeros(4000), 1, "converged", np.zeros((4000, 3)))
    seen = MarkerNoise(0.1, sensors=(0.2, 3.0), seed=4).seen(true)
    assert seen.delta_a.std() == pytest.approx(0.2, rel=0.05) and seen.lambda_a.std() == pytest.approx(3.0, rel=0.05)
    assert seen.markers.std() == pytest.approx(0.1, rel=0.05)
    again, other = (MarkerNoise(0.1, sensors=(0.2, 3.0), seed=seed).seen(true) for seed in (4, 5))
    np.testing.assert_array_equal(again.markers, seen.markers)
    assert np.abs(other.markers - seen.markers).max() > 0.1
    blind = MarkerNoise(0.1).seen(true)
    assert blind.delta_a is None and blind.lambda_a is None
    dark = MarkerNoise(0.1, sensors=(0.2, 3.0)).seen(Measurement(np.zeros(3), None, None, 1, "converged"))
    assert dark.delta_a is None and dark.lambda_a is None and dark.markers is None
