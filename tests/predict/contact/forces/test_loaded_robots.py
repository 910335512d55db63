"""Robots that lie one after another in compiled loops do what each does alone."""

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.spatial.transform import Rotation
from support.forces import put

from cfem.predict.contact.forces.loaded_robots import LoadedRobots
from cfem.predict.contact.surface.surface_part import SurfacePart
from cfem.predict.contact.surface.surfaces import Surfaces


def test_robots_of_a_scene_do_what_each_does_alone(patched_bar):
    """Three of them, of which one has few points and one bears nothing."""
    rng, count = np.random.default_rng(0), len(patched_bar.patches)
    free = np.flatnonzero(~patched_bar.held_still)
    models = patched_bar, SurfacePart(patched_bar, free[2:9]), patched_bar
    deltas, R = [np.array([mm]) for mm in (1.0, 2.0, 3.0)], Rotation.random(3, rng=rng).as_matrix()
    points, forces = [free[:4], np.array([1, 3]), free[4:6]], [0.02 * rng.normal(size=(n, 3)) for n in (4, 2, 2)]
    forces[2][:] = 0.0
    surfaces = Surfaces(models)
    known = np.concatenate([mine + first for mine, first in zip(points, surfaces.ends, strict=False)])
    on_all = np.zeros((2 * count + 7, 3))
    on_all[known] = np.concatenate([mine @ turn.T for mine, turn in zip(forces, R, strict=True)])
    together = LoadedRobots(surfaces, deltas, [None] * 3, R, np.zeros((3, 3)), known, on_all)
    each = [LoadedRobots.of(model, delta) for model, delta in zip(models, deltas, strict=True)]
    for alone, mine, pressed in zip(each, points, forces, strict=True):
        put(alone, mine, pressed)
    np.testing.assert_allclose(together.places, np.concatenate([alone.places for alone in each]), atol=1e-12)
    np.testing.assert_allclose(
        np.concatenate(together.rows), np.concatenate([alone.rows[0] for alone in each]), atol=1e-12
    )
    for under_forces in (True, False):
        turned = []
        for alone, turn, mine in zip(each, R, points, strict=True):
            every = np.kron(np.eye(len(mine)), turn)
            turned.append(every @ alone.compliance(under_forces) @ every.T)
        np.testing.assert_allclose(together.compliance(under_forces), block_diag(*turned), atol=1e-10)
    found, expected = together.answers, [alone.answers for alone in each]
    assert found.stored == pytest.approx(sum(alone.stored for alone in expected), rel=1e-9)
    assert found.error == pytest.approx(max(alone.error for alone in expected), rel=1e-9) and found.error > 0
    for name in ("displaced", "pull", "rows"):
        joined = np.concatenate([getattr(alone, name) for alone in expected])
        np.testing.assert_allclose(getattr(found, name), joined, atol=1e-12)
    relief, moved = zip(*(np.split(alone.work, [1]) for alone in expected), strict=True)
    np.testing.assert_allclose(found.work, np.concatenate([*relief, *moved]), atol=1e-12)
    assert np.abs(np.concatenate(relief)).max() > 1e-3 and np.abs(np.concatenate(moved)).max() > 1e-3


@pytest.mark.parametrize(("size", "apart"), [(0.0, 1e-5), (0.3, 0.04)])
def test_forces_relieve_actuators_by_as_much_as_these_move_the_patches(patched_bar, size, apart):
    """By one energy the derivative of the relief by a force is that of the patch's place by the actuator. The second
    order in the forces changes it by 0.055; dents, whose change with the actuators the relief leaves out, by 0.035."""
    free = np.flatnonzero(~patched_bar.held_still)[[2, 5, 8]]
    forces, step = size * np.random.default_rng(1).normal(size=(3, 3)), 1e-3

    def under(mm, forces):
        robot = LoadedRobots.of(patched_bar, np.array([mm]))
        put(robot, free, forces)
        return robot

    by_force = []
    for unit in np.eye(9).reshape(9, 3, 3):
        ahead, behind = (under(2.0, forces + way * step * unit).answers.work[0] for way in (1, -1))
        by_force.append((ahead - behind) / (2 * step))
    ahead, behind = (under(2.0 + way * step, forces).places[free] for way in (1, -1))
    by_actuator = (ahead - behind) / (2 * step)
    np.testing.assert_allclose(np.ravel(by_force), by_actuator.ravel(), atol=apart)
