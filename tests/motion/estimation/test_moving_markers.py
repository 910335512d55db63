"""Where markers are on a skin that swings: derivatives, rest, and finite elements."""

import numpy as np
import pytest

from cfem.core.errors import InputError
from cfem.motion.estimation.moving_markers import MovingMarkers
from cfem.motion.load import load_motion
from cfem.predict.estimation.estimate import Estimator
from cfem.predict.estimation.markers import markers_near
from cfem.predict.load import load_model

TIP = ("tip.x", "tip.y", "tip.z")


@pytest.fixture(scope="module")
def parts(moving_bar):
    folder = moving_bar / "models" / "bar" / "spectral"
    model = load_model(folder)
    estimator = Estimator(model, markers_near(model, 5), 0.1, (*TIP, "skin.2"), 0.02)
    return estimator, load_motion(folder)


def test_derivatives_are_those_of_differences(parts):
    estimator, motion = parts
    markers, rng = MovingMarkers(estimator, motion), np.random.default_rng(0)
    y = np.r_[2.0, rng.normal(size=motion.n_r), 0.01 * rng.normal(size=4), 0.1]
    for of in (markers.seen, markers.modes):
        slope = of(y)[1]
        for n, h in enumerate(np.r_[1e-4, np.full(motion.n_r, 1e-4), np.full(4, 1e-5), 1e-4]):
            ahead, behind = (of(y + sign * h * np.eye(len(y))[n])[0] for sign in (1, -1))
            np.testing.assert_allclose(slope[:, n], (ahead - behind) / (2 * h), rtol=1e-5, atol=1e-6)


def test_at_rest_it_is_the_static_model(parts):
    """Forces that hold the robot still swing the inner motions by H_w^T w / kappa, and the rest follows at once."""
    estimator, motion = parts
    markers, w = MovingMarkers(estimator, motion), np.array([0.01, -0.02, 0.015, 0.01])
    eta = motion.skin(np.array([2.0]))[0][estimator.loaded_rows].T @ w / motion.stiffness
    static, _ = estimator.marker_series(np.array([2.0]), w)
    np.testing.assert_allclose(markers.seen(np.r_[2.0, eta, w, 0.0])[0], static, atol=1e-12)
    softer, _ = estimator.marker_series(np.array([2.0]), w / 0.8)
    np.testing.assert_allclose(markers.seen(np.r_[2.0, eta / 0.8, w, np.log(0.8)])[0], softer, atol=1e-12)


def test_effectors_and_skin_swing_alike(parts):
    """A marker at the tip goes where the effector goes."""
    estimator, motion = parts
    model, delta_a = estimator.model, np.array([2.0])
    rest, tip = model.skin.rest, model.rest_e[:3]
    near = np.argsort(np.linalg.norm(rest - tip, axis=1))[:6]
    H, _ = motion.paths(delta_a)
    moved = np.einsum("kni,kr->nir", model.skin.modes[:, near], motion.skin(delta_a)[0][len(H) :]).mean(axis=0)
    assert np.abs(moved - H).max() < 0.15 * np.abs(H).max()


def test_a_model_that_did_not_learn_it_is_refused(parts):
    estimator, motion = parts
    old = type(motion).__new__(type(motion))
    vars(old).update(vars(motion), skin=None)
    with pytest.raises(InputError, match="has not learned how its skin moves"):
        MovingMarkers(estimator, old)
