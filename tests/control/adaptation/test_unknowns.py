"""The vector of what a controller tracks, on a stand-in for a model with a sampled and an exact parameter."""

from types import SimpleNamespace

import numpy as np
import pytest
from surrogate.synthetic import POISSON, YOUNG

from cfem.control.adaptation.unknowns import CAMERA, DRIFT, LOSS, SD, SHARE, TrackedUnknowns
from cfem.core.errors import InputError

PARAMETERS = (POISSON, YOUNG)
MODEL = SimpleNamespace(parameters=PARAMETERS, rows=SimpleNamespace(n_a=2))
NAMES = [parameter.name for parameter in PARAMETERS]
EXACT = [parameter.exact for parameter in PARAMETERS]


def unknowns(find=None, loss=0.0, camera=(0.0, 0.0), forget=50.0):
    return TrackedUnknowns(MODEL, find, loss, camera, forget)


def test_the_first_values_are_the_references_and_nothing_is_lost_or_moved():
    tracked = unknowns(loss=0.4, camera=(2.0, 0.0))
    assert tracked.kinds.tolist() == [SHARE] * 2 + [LOSS] * 2 + [DRIFT] + [CAMERA] * 3
    np.testing.assert_allclose(tracked.p(tracked.first), [parameter.reference for parameter in PARAMETERS])
    assert not tracked.losses(tracked.first).any() and not tracked.camera(tracked.first).any()
    assert tracked.sd.tolist() == [SD, SD, 0.4, 0.4, SD / 1000, 2.0, 2.0, 2.0]


def test_shares_of_0_and_1_are_the_ends_of_a_parameter_s_range():
    tracked = unknowns()
    for n, parameter in enumerate(PARAMETERS):
        for share, end in ((0.0, parameter.low), (1.0, parameter.high)):
            x = tracked.first.copy()
            x[n] = share
            assert tracked.p(x)[n] == pytest.approx(end, rel=1e-9)
            others = np.arange(len(PARAMETERS)) != n
            np.testing.assert_allclose(tracked.p(x)[others], tracked.p(tracked.first)[others])
    assert (tracked.low[:2] == 0).all() and (tracked.high[:2] == 1).all()


def test_a_drift_moves_its_share_from_sample_to_sample():
    tracked = unknowns(loss=0.4)
    x = tracked.first + 0.01 * np.arange(len(tracked.first))
    after = tracked.transition @ x
    place, drift = EXACT.index(True), int(np.flatnonzero(tracked.kinds == DRIFT)[0])
    assert after[place] == pytest.approx(x[place] + x[drift])
    rest = np.arange(len(x)) != place
    np.testing.assert_array_equal(after[rest], x[rest])


def test_what_changes_is_forgotten_a_hundred_times_as_fast_as_what_does_not():
    """A sample counts for 1/e after `forget` samples: the covariance then has grown by e."""
    tracked = unknowns(loss=0.4, camera=(0.0, 0.1), forget=20.0)
    count = np.where([not EXACT[0], not EXACT[1], False, False, False, True, True, True], 2000, 20)
    np.testing.assert_allclose(tracked.growth ** (2 * count), np.e)


def test_losses_and_motions_are_bounded_by_three_deviations():
    tracked = unknowns(find=(NAMES[0],), loss=0.4, camera=(2.0, 0.1))
    beyond = tracked.kinds != SHARE
    np.testing.assert_allclose(tracked.high[beyond], 3 * tracked.sd[beyond])
    np.testing.assert_allclose(tracked.low[beyond], -3 * tracked.sd[beyond])
    assert tracked.moves.tolist() == [0, 1, 2, 3, 4, 5]


def test_a_rotation_alone_is_at_its_place():
    tracked = unknowns(camera=(0.0, 0.1))
    x = tracked.first.copy()
    x[tracked.kinds == CAMERA] = [0.01, 0.02, 0.03]
    assert tracked.camera(x).tolist() == [0.0, 0.0, 0.0, 0.01, 0.02, 0.03]


def test_nothing_to_track_and_names_that_are_none_are_refused():
    with pytest.raises(InputError, match="no parameter 'elasticity'"):
        unknowns(find=("elasticity",))
    empty = SimpleNamespace(parameters=(), rows=MODEL.rows)
    with pytest.raises(InputError, match="no parameters to track"):
        TrackedUnknowns(empty, None, 0.0, (0.0, 0.0), 50.0)
