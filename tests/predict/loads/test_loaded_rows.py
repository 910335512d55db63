"""A force on a patch of the skin as a load of a model, against finite elements that carry it and its own energy."""

from types import SimpleNamespace

import numpy as np
import pytest

from cfem.constraint.patch import PatchLoad
from cfem.core.errors import InputError, SpecError
from cfem.equilibrium.contact.patch_effectors import patch_yield
from cfem.plant.fem_plant import FemPlant, pushed
from cfem.predict.load import build
from cfem.predict.loads.loaded import loaded, wrench_error
from cfem.predict.loads.loaded_rows import LoadedRows, _corrected
from cfem.predict.series.chebyshev import basis
from cfem.predict.series.few_states import patch_states

PLACE = np.array([1.5])
FORCE = np.array([0.3, 1.0, -1.0])
NONE = np.zeros(3)


def middle(model, size, share=0.6, name="push"):
    """A load on the upper side, at a share of the length."""
    rest = model.skin.rest
    low, high = rest.min(axis=0), rest.max(axis=0)
    at = [low[0] + share * (high[0] - low[0]), (low[1] + high[1]) / 2, high[2]]
    return PatchLoad(at, 6.0, size * FORCE, name)


def test_finite_elements_agree(model, robot):
    """The tip to what the modes of the skin leave, more near the root; and the force that holds the cable."""
    free = FemPlant(robot).at_displacement(PLACE)
    for share in (0.35, 0.6, 0.9):
        load = middle(model, 0.02, share)
        truth = FemPlant(pushed(robot, NONE, [load])).at_displacement(PLACE)
        found = loaded(model, patches=[load])
        here = found.at_displacement(PLACE)
        moved = np.linalg.norm(truth.delta_e - free.delta_e)
        off = np.linalg.norm(here.delta_e - truth.delta_e)
        assert moved > 0.1 and off < 0.07 * moved
        assert off < found.meta["wrench_error"]
        change = np.abs(truth.lambda_a - free.lambda_a).max()
        assert np.abs(here.lambda_a - truth.lambda_a).max() < 0.02 * change + 1e-5
        there = FemPlant(pushed(robot, NONE, [load]))
        there.at_displacement(PLACE)
        apart = np.linalg.norm(found.shape(PLACE) - there.x[model.skin.nodes], axis=1)
        assert np.median(apart) < 0.1 * moved


@pytest.fixture(scope="module")
def by_fe(model, robot):
    return patch_yield(robot, [middle(model, 1.0)], patch_states(model.domain, 1))


def test_with_finite_elements_at_a_few_states_it_is_of_the_second_order(model, robot, by_fe):
    """At a state that is none of them: twice the force, eight times the error of the tip."""
    assert np.abs(by_fe.states - PLACE).min() > 0.2
    off = []
    for size in (0.015, 0.03):
        load = middle(model, size)
        truth = FemPlant(pushed(robot, NONE, [load])).at_displacement(PLACE)
        found = loaded(model, patches=[load], by_fe=by_fe)
        here = found.at_displacement(PLACE)
        moved = np.linalg.norm(truth.delta_e - model.at_displacement(PLACE).delta_e)
        off.append(np.linalg.norm(here.delta_e - truth.delta_e))
        assert off[-1] < 1e-3 * moved and off[-1] < found.meta["wrench_error"] < 30 * off[-1]
        change = np.abs(truth.lambda_a - model.at_displacement(PLACE).lambda_a).max()
        assert np.abs(here.lambda_a - truth.lambda_a).max() < 3e-3 * change
    assert 5 < off[1] / off[0] < 10


@pytest.mark.parametrize("known", [False, True])
def test_it_is_one_of_an_energy(model, by_fe, known):
    """Gradient and Hessian of the loaded potential, and its derivative by the load: where the patch is."""
    load, h = middle(model, 0.02), 1e-4
    by_fe = by_fe if known else None
    found = loaded(model, patches=[load], by_fe=by_fe)
    at = [found.parts(PLACE + one * h, np.zeros(0)) for one in (-1, 0, 1)]
    assert np.allclose(at[1]["gradient"], (at[2]["energy"] - at[0]["energy"]) / (2 * h), rtol=1e-6)
    assert np.allclose(at[1]["hessian"], (at[2]["gradient"] - at[0]["gradient"]) / (2 * h), rtol=1e-6)
    assert np.allclose(at[1]["effector_gradient"][:, 0], (at[2]["effector"] - at[0]["effector"]) / (2 * h), rtol=1e-5)
    more, less = (
        loaded(model, patches=[PatchLoad(load.at, load.radius, load.force + one * np.eye(3)[1])], by_fe=by_fe)
        for one in (1e-3, -1e-3)
    )
    work = (more.parts(PLACE, np.zeros(0))["energy"] - less.parts(PLACE, np.zeros(0))["energy"]) / 2e-3
    shares = load.shares(model.skin.rest, model.skin.triangles, model.skin.weights)
    place = shares @ (found.shape(PLACE) - model.skin.rest)
    assert work[0] == pytest.approx(-place[1], rel=0.2 if known else 1e-6)  # which has a dent beside the modes


def test_loads_on_patches_and_effectors_add_up(model):
    """As first order in each, but for their product in the energy, which is in both orders the same."""
    tip, one, other = np.array([0, 0.01, 0.0]), middle(model, 0.01), middle(model, -0.02, 0.8, "other")
    both = loaded(model, tip, [one, other])
    again = loaded(loaded(loaded(model, tip), patches=[one]), patches=[other])
    for states in (np.array([0.5]), np.array([3.0])):
        a, b = both.at_displacement(states), again.at_displacement(states)
        assert np.allclose(a.delta_e, b.delta_e, rtol=0, atol=1e-10)
        assert np.allclose(a.lambda_a, b.lambda_a, rtol=1e-10)
        assert np.allclose(both.shape(states), again.shape(states), atol=1e-9)


def test_a_push_at_the_end_is_nearly_one_on_the_effector_there(model):
    """The tip is a point within the body; the patch is all of the end's surface."""
    tip = loaded(model, 0.02 * FORCE).at_displacement(PLACE).delta_e
    end = PatchLoad([model.skin.rest[:, 0].max(), *model.rest_e[1:]], 8.0, 0.02 * FORCE)
    free = model.at_displacement(PLACE).delta_e
    found = loaded(model, patches=[end]).at_displacement(PLACE).delta_e
    assert np.linalg.norm(found - tip) < 0.06 * np.linalg.norm(tip - free)


def test_too_large_a_force_says_how_much_is_taken(model):
    load = middle(model, 1.0, 0.9)
    with pytest.raises(InputError, match=r"wrong by about .* mm, and 0\.3 mm are allowed .*take at most \d+% of them"):
        loaded(model, patches=[load])
    assert wrench_error(model, NONE, [load]) > 0.3


def test_without_a_skin_it_says_what_to_do(model):
    bare = build(model.meta, model.arrays)
    with pytest.raises(InputError, match=r"has no skin.*sample it with"):
        loaded(bare, patches=[middle(model, 0.01)])


def test_a_patch_where_the_body_is_held_is_refused(model):
    at = [model.skin.rest[:, 0].min(), *model.rest_e[1:]]
    with pytest.raises(SpecError, match=r"loads.root: the body is held here"):
        loaded(model, patches=[PatchLoad(at, 5.5, FORCE, "root")])


@pytest.mark.parametrize("known", [False, True])
def test_finite_elements_correct_the_patches_alone(known):
    """At the states that they were solved at, rows of the patches are theirs and those of the effector the model's,
    whatever both say: two degrees of one actuator."""
    rng, n_e, r = np.random.default_rng(0), 3, 6
    states = np.array([[-0.5], [0.1], [0.6], [0.9]])
    indices = np.array([[0], [1], [2]])
    symmetric = rng.normal(size=(3, r, r))
    rows = LoadedRows(
        indices, rng.normal(size=(3, 1)), rng.normal(size=(3, r)), symmetric + symmetric.transpose(0, 2, 1),
        rng.normal(size=(3, r, r, r)) if known else None, True, True,
    )  # fmt: skip
    by_fe = SimpleNamespace(
        states=states, e=rng.normal(size=(4, r - n_e)), C=rng.normal(size=(4, r, r)), D=rng.normal(size=(4, r, r, r))
    )
    model = SimpleNamespace(rows=SimpleNamespace(n_e=n_e, n_a=1), box=lambda states: 2 * states)
    found = _corrected(model, rows, by_fe)
    before, after = basis(2 * states, indices), basis(2 * states, found.indices)
    own = np.zeros((r, r), bool)
    own[:n_e, :n_e] = True
    np.testing.assert_allclose(after @ found.psi, before @ rows.psi, atol=1e-12)
    e = after @ found.e
    np.testing.assert_allclose(e[:, :n_e], (before @ rows.e)[:, :n_e], atol=1e-12)
    np.testing.assert_allclose(e[:, n_e:], by_fe.e, atol=1e-12)
    C, mine = np.tensordot(after, found.C, 1), np.tensordot(before, rows.C, 1)
    np.testing.assert_allclose(C, np.where(own, mine, by_fe.C), atol=1e-11)
    D = np.tensordot(after, found.D, 1)
    theirs = by_fe.D.copy()
    if known:
        theirs[:, :n_e, :n_e, :n_e] = 0.0
        theirs += np.tensordot(before, rows.D, 1)
    np.testing.assert_allclose(D, theirs, atol=1e-11)
