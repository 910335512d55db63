"""Forces on patches of modules in a row, by modules made by hand whose skin is the end that the next one begins at."""

import numpy as np
import pytest
from support.serial_rows import DELTA, REST, WRENCH, skinned

from cfem.constraint.patch import PatchLoad
from cfem.core.errors import InputError, SpecError
from cfem.predict.loads.loaded import loaded

FORCE = np.array([0.02, -0.03, 0.04])


def on(module, force=FORCE, name="push"):
    return PatchLoad((module + 1) * REST, 4.0, force, name)


def test_a_force_on_the_last_end_is_one_on_the_tip():
    model, w = skinned(), 0.05 * WRENCH
    on_tip = loaded(model, w + np.r_[0.1 * FORCE, 0, 0, 0], trusted=np.inf)
    on_patch = loaded(model, w, [on(2, 0.1 * FORCE)], trusted=np.inf)
    for delta in (DELTA, -DELTA):
        for one, other in zip(on_tip.evaluate(delta), on_patch.evaluate(delta), strict=True):
            assert np.allclose(one, other, rtol=1e-9, atol=1e-9)
        assert np.allclose(on_tip.shape(delta), on_patch.shape(delta), atol=1e-9)


@pytest.mark.parametrize("third", [False, True])
def test_jacobian_and_stiffness_against_differences(third):
    """Forces on two modules, two of them on one: the rows of each follow the frame at its base."""
    patches, h = [on(0), on(1, 0.5 * FORCE), on(1, np.array([0.0, 0.03, 0.0]))], 1e-5
    model = loaded(skinned(third), WRENCH, patches, trusted=np.inf)
    here = model.at(DELTA)
    for n, step in enumerate(h * np.eye(len(DELTA))):
        ahead, behind = (model.at(DELTA + sign * step) for sign in (1, -1))
        column = (ahead.lam - behind.lam) / (2 * h)
        assert np.allclose(np.linalg.inv(here.W_aa)[:, n], column, atol=1e-6)
        assert np.allclose(here.effector_jacobian[:, n], (ahead.delta_e - behind.delta_e) / (2 * h), atol=1e-6)


def test_the_work_of_one_more_force_is_what_its_patch_moves():
    """d lambda / df = -d y / d delta of the patch (Maxwell and Betti), in the frame of the whole."""
    model, h = skinned(), 1e-5
    here = loaded(model, WRENCH, [on(1)], trusted=np.inf)
    mine = here.surface.owner == 1
    places = [here.shape(DELTA + step)[mine].mean(axis=0) for step in h * np.vstack([np.eye(7), -np.eye(7)])]
    moved = (np.array(places[:7]) - places[7:]) / (2 * h)
    for axis, more in enumerate(h * np.eye(3)):
        ahead, behind = (
            loaded(model, WRENCH, [on(1, FORCE + sign * more)], trusted=np.inf).at(DELTA) for sign in (1, -1)
        )
        assert np.allclose((ahead.lam - behind.lam) / (2 * h), -moved[:, axis], atol=1e-5)


def test_the_stated_error_grows_with_the_force_and_too_large_a_one_is_refused():
    model = skinned(third=True)
    small, large = (loaded(model, patches=[on(1, size * FORCE)]) for size in (0.01, 0.02))
    assert 0 < small.meta["wrench_error"] < large.meta["wrench_error"]
    with pytest.raises(InputError, match="wrong by about"):
        loaded(model, patches=[on(1, 0.02 * FORCE)], trusted=1e-7)


def test_a_patch_that_is_nowhere_and_modules_without_skins_are_refused():
    with pytest.raises(SpecError, match=r"loads.push: .* off the surface"):
        loaded(skinned(), patches=[PatchLoad([30.0, 0, 60], 4.0, FORCE, "push")])
    with pytest.raises(InputError, match=r"has no skin.*train each module's model"):
        loaded(skinned(skin=False), patches=[on(1)])


def test_the_last_nodes_move_with_the_actuators_as_the_tip_does():
    """Whose derivative is in closed form; the four nodes of an end have it for their mean."""
    last, n = np.arange(8, 12), len(DELTA)
    model = loaded(skinned(), 0.05 * WRENCH, trusted=np.inf)
    gradient = model.surface_gradient(DELTA, last)
    assert gradient.shape == (4, 3, n)
    expected = model.at(DELTA).effector_jacobian[:3]
    np.testing.assert_allclose(gradient.mean(axis=0), expected, atol=1e-5 * np.abs(expected).max())
    h = 1e-3
    for i, step in enumerate(h * np.eye(n)):  # nodes in another order
        moved = (model.shape(DELTA + step)[last[::-1]] - model.shape(DELTA - step)[last[::-1]]) / (2 * h)
        np.testing.assert_allclose(model.surface_gradient(DELTA, last[::-1])[..., i], moved, atol=1e-4)
    first = model.surface_gradient(DELTA, np.arange(4))
    assert np.abs(first[..., :2]).max() > 0.1 and np.abs(first[..., 2:]).max() < 0.1  # its own actuators, and the load


def test_without_loads_all_nodes_move_with_the_actuators_as_differences_say():
    """In closed form; a module's actuators move its own nodes and those after it, and none before."""
    model, h, n = skinned(), 1e-5, len(DELTA)
    nodes = np.array([5, 0, 11, 3, 7, 8])
    gradient = model.surface_gradient(DELTA, nodes)
    for i, step in enumerate(h * np.eye(n)):
        moved = (model.shape(DELTA + step)[nodes] - model.shape(DELTA - step)[nodes]) / (2 * h)
        np.testing.assert_allclose(gradient[..., i], moved, atol=1e-6)
    assert not gradient[nodes < 4][..., 2:].any() and not gradient[nodes < 8][..., 5:].any()
    tip = model.surface_gradient(DELTA, np.arange(8, 12)).mean(axis=0)
    np.testing.assert_allclose(tip, model.at(DELTA).effector_jacobian[:3], atol=1e-9)
