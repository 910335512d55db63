"""An FE robot held by a rigid patch, as a model of its actuators and the patch's pose."""

import numpy as np
import pytest
from support.blocks import bar

from cfem.core.errors import NumericalError
from cfem.plant.fem_patch import FemPatch


@pytest.fixture(scope="module")
def patch():
    return FemPatch(bar(element="hex8", divisions=(6, 1, 1), contact=True), turns=False)


def test_its_compliance_is_the_derivative_by_finite_differences(patch):
    at, h = np.array([0.5, 0.8, 0.1, -0.2, 0.3]), 1e-4
    here = patch.at_displacement(at)
    act = here.rows.active
    np.testing.assert_allclose(here.delta[act], at, atol=1e-9)
    stiffness = np.linalg.inv(here.W[act, act])
    for i, step in enumerate(h * np.eye(5)):
        ahead, behind = patch.at_displacement(at + step), patch.at_displacement(at - step)
        np.testing.assert_allclose((ahead.lam - behind.lam) / (2 * h), stiffness[:, i], atol=1e-5)


def test_a_question_asked_again_costs_nothing_and_a_new_one_a_solve(patch):
    at = np.array([0.5, 0.8, 0.0, 0.0, 0.1])
    first = patch.at_displacement(at)
    solves, factorizations = patch.solves, patch.factorizations
    assert patch.at_displacement(at) is first and patch.solves == solves
    patch.at_displacement(at + 1e-3)
    assert patch.solves == solves + 1 and factorizations < patch.factorizations <= factorizations + 3
    assert patch.seconds > 0


def test_another_pose_at_the_same_actuators_takes_the_factor_at_hand(patch):
    """And is the state of a robot that never knew it."""
    at, further = np.array([0.4, 0.6, 0.1, 0.0, 0.1]), np.array([0, 0, 1e-4, -2e-4, 1e-4])
    patch.at_displacement(at)
    factorizations = patch.factorizations
    found = patch.at_displacement(at + further)
    assert patch.factorizations == factorizations
    alone = FemPatch(bar(element="hex8", divisions=(6, 1, 1), contact=True), turns=False).at_displacement(at + further)
    np.testing.assert_allclose(found.W, alone.W, rtol=1e-8, atol=1e-9 * np.abs(alone.W).max())
    np.testing.assert_allclose(found.lam, alone.lam, atol=1e-9 * np.abs(alone.lam).max())


def test_what_has_no_state_is_an_error(patch):
    with pytest.raises(NumericalError, match="FE robot"):
        patch.at_displacement(np.full(5, np.nan))


def test_before_the_first_question_it_rests():
    robot = bar(element="hex8", divisions=(6, 1, 1), contact=True)
    fresh = FemPatch(robot, turns=False)
    assert fresh.state is None and fresh.solves == 0
    np.testing.assert_array_equal(fresh.x, robot.body.mesh.X)
