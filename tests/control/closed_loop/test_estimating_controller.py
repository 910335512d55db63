"""When a controller that sees markers estimates: once for each sample, and never without markers."""

from types import SimpleNamespace

import numpy as np

from cfem.control.closed_loop.estimated import EstimatingController
from cfem.plant.protocol import Measurement

REST = np.array([0.0, 0.0, 60.0])


class MotionFilter:
    """Filter that counts its calls, and always finds the same."""

    def __init__(self):
        self.predicted, self.corrected = [], []
        response = SimpleNamespace(locked=np.zeros((3, 1)), held=np.zeros((3, 1)))
        self.estimator = SimpleNamespace(response=lambda delta_a: response)

    def predict(self, command, period):
        self.predicted.append(command)

    def correct(self, markers, delta_a, command):
        self.corrected.append(command)
        return SimpleNamespace(converged=True, delta_e=np.ones(3), delta_a=np.ones(1), loads=np.zeros(1))


class Inner:
    """Controller whose command is the number of its tick."""

    def __init__(self):
        self.seen = []

    def tick(self, goal, measured, ahead):
        self.seen.append(measured)
        return SimpleNamespace(u=np.array([float(len(self.seen))]))


def sample(t, markers=True):
    seen = np.zeros((2, 3)) if markers else None
    return Measurement(x_e=np.full(3, np.nan), delta_a=None, lambda_a=None, t=t, status="converged", markers=seen)


def driven(*samples):
    inner, filtered = Inner(), MotionFilter()
    controller = EstimatingController(inner, filtered, REST, True, 0.05)
    for measured in samples:
        controller.tick(REST, measured)
    return inner, filtered, controller


def test_a_sample_that_comes_again_is_estimated_once():
    inner, filtered, controller = driven(None, sample(1), sample(1), sample(1))
    assert len(filtered.corrected) == 1 and controller.sample_tick == 1
    assert inner.seen[1] is inner.seen[2] is inner.seen[3]
    np.testing.assert_array_equal(inner.seen[1].x_e, REST + 1)


def test_each_tick_up_to_a_sample_is_predicted_with_its_own_command():
    _, filtered, _ = driven(None, sample(1), None, sample(3))
    assert [float(command[0]) for command in filtered.predicted] == [1.0, 2.0, 3.0]
    assert [float(command[0]) for command in filtered.corrected] == [1.0, 3.0]


def test_a_sample_without_markers_leaves_the_last_estimate():
    inner, filtered, controller = driven(None, sample(1, markers=False), sample(2), sample(3, markers=False))
    assert len(filtered.corrected) == 1 and controller.sample_tick == 2
    assert inner.seen[0] is None and np.isnan(inner.seen[1].x_e).all()
    assert inner.seen[3] is inner.seen[2]
