"""Learned robots that touch each other, against finite elements whose surfaces do the same."""

import numpy as np
import pytest

from cfem.core.errors import InputError
from cfem.equilibrium.meet import Meeting as MeetingInFe
from cfem.equilibrium.meet import Skinned
from cfem.equilibrium.patch_compliance import patch_response
from cfem.predict.load import load_model
from cfem.predict.meeting import PlacedModel, meet
from cfem.predict.touchable import Touchable, patches_of, touch_states
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh

OVER = np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, 16.0])  # the twin: upside down above, 6 mm away
HERE = np.eye(3), np.zeros(3)


@pytest.fixture(scope="module")
def robot(bar):
    return build_robot(*load_scene_and_mesh(bar / "pipelines" / "bar" / "scene.yaml"))


@pytest.fixture(scope="module")
def touchable(bar, robot):
    model = load_model(bar / "models" / "bar" / "spectral")
    patches, states = patches_of(model, 6.0), touch_states(model.domain, 1)
    return Touchable(model, patches, patch_response(robot, model.skin.watched, patches, states))


@pytest.fixture(scope="module")
def twins(touchable):
    return [PlacedModel(touchable, *pose) for pose in (HERE, OVER)]


def test_apart_they_are_free(twins, touchable):
    found = meet(twins, [[0.4], [0.3]])
    assert found.converged and found.pressed == 0.0 and found.gap > 1.0
    for delta, e, lam in zip((0.4, 0.3), found.delta_e, found.lambda_a, strict=True):
        free = touchable.model.at_displacement([delta])
        assert np.array_equal(e, free.delta_e) and lam == pytest.approx(free.lambda_a, rel=1e-12)


def test_two_that_press_each_other_do_as_finite_elements_do(twins, robot, touchable):
    deltas = [1.0], [0.9]
    found, skin = meet(twins, deltas), touchable.model.skin
    fe = [Skinned(robot, skin.nodes, skin.triangles, touchable.patches, *pose) for pose in (HERE, OVER)]
    truth = MeetingInFe(fe).go(deltas)
    assert found.converged and truth.converged and truth.pressed > 0.002
    assert found.pressed == pytest.approx(truth.pressed, rel=0.02)
    assert min(found.gap, truth.gap) > -1e-6 * robot.length
    for delta, e, lam, solved in zip(deltas, found.delta_e, found.lambda_a, truth.solved, strict=True):
        free = touchable.model.at_displacement(delta)
        assert np.linalg.norm(e - solved.delta_e) < 0.1 * np.linalg.norm(solved.delta_e - free.delta_e)
        assert lam == pytest.approx(solved.lambda_a, abs=0.1 * np.abs(solved.lambda_a - free.lambda_a).max())


def test_forces_and_moments_balance_and_the_way_does_not_matter(twins):
    found = meet(twins, [[1.0], [0.9]])
    forces, places = found.forces, found.places
    assert np.abs(forces.sum(axis=0)).max() < 1e-9 * found.pressed
    assert np.abs(np.cross(places, forces).sum(axis=0)).max() < 1e-4 * found.pressed
    onwards = meet(twins, [[1.0], [0.9]], meet(twins, [[0.95], [0.85]]))
    assert onwards.pressed == pytest.approx(found.pressed, rel=1e-4)


def test_a_straight_robot_does_not_touch_itself(touchable):
    found = meet([PlacedModel(touchable)], [[2.0]])
    assert found.converged and found.pressed == 0.0
    assert np.array_equal(found.delta_e[0], touchable.model.at_displacement([2.0]).delta_e)


def test_robots_that_overlap_at_first_are_refused(touchable):
    inside = PlacedModel(touchable, OVER[0], np.array([0.0, 0.0, 9.0]))
    with pytest.raises(InputError, match=r"overlap by (0\.[89]\d*|1(\.\d+)?) mm where their actuators are at 0"):
        meet([PlacedModel(touchable), inside], [[0.1], [0.1]])
