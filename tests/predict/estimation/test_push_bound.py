"""The least error of a push that any estimate can promise: closed forms, and what the filter makes of frames."""

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest

from cfem.predict.estimation.estimate import Estimator
from cfem.predict.estimation.filter import Filter
from cfem.predict.estimation.markers import markers_near
from cfem.predict.estimation.push_bound import Seen, frames_for, push_error, push_errors
from cfem.predict.load import load_model

TIP = ("tip.x", "tip.y", "tip.z")
NOISE, LARGEST, AT = 0.1, 0.02, np.array([3.0])


@pytest.fixture(scope="module")
def estimator(bar):
    model = load_model(bar / "models" / "bar" / "spectral")
    return Estimator(model, markers_near(model, 5), NOISE, TIP, LARGEST, 0.05, 0.02)


def test_still_frames_add_their_information(estimator):
    """Against derivatives by differences, and the inverse of the sum."""
    x, h = np.r_[AT, 0.0, 0.0, 0.0], np.array([1e-4, 1e-5, 1e-5, 1e-5])
    J = np.stack(
        [(estimator.places(x + d) - estimator.places(x - d)).ravel() / (2 * d.max()) for d in np.diag(h)], axis=1
    )
    for frames in (1, 7, 200):
        information = np.diag(np.r_[1.0, np.full(3, LARGEST**-2)]) + frames * J.T @ J / NOISE**2
        least = np.sqrt(np.trace(np.linalg.inv(information)[1:, 1:]) / 3) / LARGEST
        assert push_error(estimator, AT, Seen(1e-12, 1.0), frames) == pytest.approx(least, rel=1e-5)


def test_the_filter_is_as_near_as_the_bound_says(estimator):
    """120 robots, 10 frames each, all drawn as assumed: its error is the bound's, to the scatter of 120."""
    seen, off = Seen(0.005, 0.3, 50.0, sensed=True, forces=True), []
    keeps = np.exp(-1 / seen.ticks)
    for seed in range(120):
        rng = np.random.default_rng(seed)
        x = np.r_[AT + seen.offset * rng.normal(size=1), LARGEST * rng.normal(size=3)]
        filtered = Filter(estimator, seen.slip, seen.ticks, seen.offset)
        for frame in range(10):
            if frame:
                x = np.r_[x[:1] + seen.slip * rng.normal(size=1), keeps * x[1:]]
                x[1:] += np.sqrt(1 - keeps**2) * LARGEST * rng.normal(size=3)
            places = estimator.places(x) + NOISE * rng.normal(size=(5, 3))
            sensed, forces = x[:1] + 0.05 * rng.normal(size=1), estimator.tensions(x) + 0.02 * rng.normal(size=1)
            found = filtered.tick(places, sensed, AT, forces)
        off.append(found.loads - x[1:])
    rms = np.sqrt(np.mean(np.square(off))) / LARGEST
    assert rms == pytest.approx(push_error(estimator, AT, seen, 10), rel=0.1)


def test_what_tells_more_needs_fewer_frames(estimator):
    plain = Seen(0.001, 1.0)
    bounds = list(islice(push_errors(estimator, AT, plain), 50))
    assert (np.diff(bounds) < 0).all() and bounds[0] < 1.0
    along = replace(estimator, along=np.array([0.0, 0.6, 0.8]))
    counts = [frames_for(estimator, AT, plain, 0.5), frames_for(along, AT, plain, 0.5)]
    assert counts[0] is None and counts[1] < 1000  # along the bar, a push moves nothing


def test_a_push_that_does_not_last_is_never_known(estimator):
    assert frames_for(estimator, AT, Seen(0.001, 1.0, ticks=2.0), 0.05) is None
