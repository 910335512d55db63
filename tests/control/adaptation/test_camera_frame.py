"""A moved camera: what it shows against rigid motion, derivatives against differences, found from samples."""

import numpy as np
import pytest
from control.adaptation.test_tracker import NOISE, forces, reference
from scipy.spatial.transform import Rotation
from surrogate.stored import train_folder

from cfem.condensed import Rows
from cfem.condensed.model import under_force
from cfem.control.adaptation.camera_frame import CameraFrame
from cfem.control.adaptation.tracker import Tracker
from cfem.core.errors import InputError
from cfem.predict.at_parameters import AtParameters
from cfem.predict.load import load_model

MOVED = np.array([3.0, -2.0, 1.5, 0.03, 0.0, -0.02])


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    folder = train_folder(
        tmp_path_factory.mktemp("frame"), "{kind: spectral, max_degree: 8}", train=80, parameters=True
    )
    return load_model(folder)


@pytest.fixture
def camera():
    rows = Rows(("top.x", "top.y", "top.z", "top.rx", "tip.x", "tip.y", "tip.z"), ("a",))
    return CameraFrame.of(rows, np.array([0.0, 10.0, -50.0, 0.1, 1.0, 10.0, -120.0]))


def test_points_move_rigidly_and_other_rows_stay(camera):
    delta = np.array([5.0, -3.0, 2.0, 0.4, 20.0, 1.0, 9.0])
    shown = camera.shown(delta, MOVED)
    R = Rotation.from_rotvec(MOVED[3:]).as_matrix()
    for rows in ([0, 1, 2], [4, 5, 6]):
        assert shown[rows] + camera.rest_e[rows] == pytest.approx(R @ (camera.rest_e + delta)[rows] + MOVED[:3])
    assert shown[3] == delta[3]
    assert camera.true(shown, MOVED) == pytest.approx(delta)


def test_slopes_are_those_of_differences(camera):
    delta, h = np.array([5.0, -3.0, 2.0, 0.4, 20.0, 1.0, 9.0]), 1e-5
    found = camera.slopes(delta, MOVED)
    for n in range(6):
        step = h * np.eye(6)[n]
        assert found[:, n] == pytest.approx(
            (camera.shown(delta, MOVED + step) - camera.shown(delta, MOVED - step)) / (2 * h), abs=1e-6
        )
    J = np.random.default_rng(0).normal(size=(7, 2))
    ahead, behind = (camera.shown(delta + sign * h * J[:, 1], MOVED) for sign in (1, -1))
    assert camera.turned(J, MOVED)[:, 1] == pytest.approx((ahead - behind) / (2 * h), abs=1e-6)


def test_a_moved_camera_and_another_stiffness_are_told_apart(model):
    """Both from the same samples; nothing of the camera is used that the samples do not tell."""
    camera = CameraFrame.of(model.rows, model.rest_e)
    assert len(camera.points) == 1
    tracker = Tracker(model, "force", NOISE, frame=(5.0, 0.05), find=("young",))
    real, rng = AtParameters(model, reference(model)), np.random.default_rng(1)
    place = [one.name for one in model.parameters].index("young")
    real.p[place] *= 0.8
    near = model.at_displacement(0.2 * model.reach[:, 1], real.p)
    used = []
    for u in forces(model, 150):
        there = under_force(real, u, real.at_displacement(near.delta_a))
        seen = camera.shown(there.delta_e, MOVED) + NOISE * rng.normal(size=3)
        tracker.sample(u, seen, near)
        used.append(np.linalg.norm(tracker.true(seen) - there.delta_e))
        near = there
    assert tracker.used_p[place] == pytest.approx(real.p[place], rel=0.02)
    assert np.mean(used[-30:]) < 5 * NOISE < 0.2 * np.mean(used[:5])


def test_without_a_camera_nothing_is_taken_from_the_samples(model):
    tracker = Tracker(model, "force", NOISE)
    assert (tracker.used_f == 0).all() and tracker.true(np.array([1.0, 2.0, 3.0])).tolist() == [1, 2, 3]


def test_a_negative_motion_is_refused(model):
    with pytest.raises(InputError, match="frame not negative"):
        Tracker(model, "force", NOISE, frame=(-1.0, 0.0))
