"""The ground that carries a robot's weight: statics of a base on pads, in closed form."""

import numpy as np
import pytest

from cfem.contact.law.modes import Mode
from cfem.contact.obstacle import Plane
from cfem.equilibrium.contact.grasp import grasp_step
from cfem.equilibrium.contact.ground import Ground, Pads
from cfem.equilibrium.system.actuation import displacement

CORNERS = np.array([[-2.0, -1, 0], [2, -1, 0], [-2, 1, 0], [2, 1, 0]])
SOFT = 0.01


def standing(mass_at, weight=1.0, tilt=0.0):
    """Four pads on a plane; mass_at (3,) mm."""
    c, s = np.cos(tilt), np.sin(tilt)
    R = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    ground = Ground(Plane(R=R), np.zeros(3), np.array([0, 0, weight, 0, 0, 0]), mass_at=np.asarray(mass_at, float))
    return grasp_step([Pads(CORNERS, SOFT)], [displacement(np.zeros(0))], ground, "coulomb", 0.5)


def test_pads_share_the_weight_by_the_levers_of_its_centre():
    found = standing([0.5, 0.2, 3.0])
    assert found.converged
    x, y = CORNERS[:, 0] / 2, CORNERS[:, 1]
    share = (1 + 0.25 * x) * (1 + 0.2 * y) / 4
    force = found.solved[0].lambda_c.reshape(-1, 3)
    # rigid on four equal springs: linear in x and y
    np.testing.assert_allclose(force[:, 2], (1 + 0.25 * x + 0.2 * y) / 4, atol=1e-3)
    assert np.abs(force[:, 2] - share).max() > 5e-3  # which the product of both is not
    np.testing.assert_allclose(force[:, 2].sum(), 1.0, atol=1e-6)
    assert found.around.x[2] == pytest.approx(SOFT / 4, rel=0.05)


def test_weight_beyond_the_pads_tips_the_base_over_and_has_no_state():
    assert not standing([2.5, 0.0, 3.0]).converged


def test_the_weight_turns_with_the_ground_and_keeps_its_point_of_the_base():
    ground = Ground(Plane(), np.zeros(3), np.array([0, 0, 2.0, 0, 0, 0]), mass_at=np.array([0.0, 0.0, 5.0]))
    moved = ground.moved(np.array([1.0, 0, 0, 0, 0.1, 0]))
    force = 2.0 * np.array([np.sin(0.1), 0, np.cos(0.1)])
    np.testing.assert_allclose(moved.wrench[:3], force, atol=1e-12)
    np.testing.assert_allclose(moved.wrench[3:], np.cross([-1.0, 0, 5.0], force), atol=1e-12)
    np.testing.assert_allclose(moved.base_at(moved.now(np.array([[1.0, 2.0, 3.0]]))), [[1.0, 2.0, 3.0]], atol=1e-12)


def test_a_push_below_friction_sticks_and_modes_say_so():
    assert standing([0.0, 0.0, 1.0]).modes == (Mode.STICK,) * 4


@pytest.mark.parametrize("share", [-2.0, -0.8, 0.1, 0.8, 0.95])
def test_a_tall_base_tilts_more_and_one_that_hangs_less(share):
    """stiffness: of the pads against tilting (N mm), which a weight P at a height h lessens:
    tilt = P e / (stiffness - P h). The linearisation of a round knows the pads alone."""
    stiffness, off = (CORNERS[:, 1] ** 2).sum() / SOFT, 0.002
    found = standing([0.0, off, share * stiffness])
    assert found.converged and found.iterations < 12
    tilt = np.arcsin(found.around.R[2, 1])
    assert abs(tilt) == pytest.approx(off / (stiffness * (1 - share)), rel=2e-3)
