"""The workspace: states that exist, that fill it, and whose slack cables carry nothing."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull
from surrogate.synthetic import dataset, effector, energy

from cfem.condensed import Rows
from cfem.core.errors import InputError
from cfem.predict.load import build
from cfem.predict.series.energy import FORMS
from cfem.predict.workspace import Workspace
from cfem.surrogate.model_card import model_card
from cfem.surrogate.series.spectral import fit


@pytest.fixture(scope="module", params=FORMS)
def model(request):
    training = dataset(120, 1)
    return build(model_card("spectral", training, request.param), fit(training, request.param).arrays)


def test_its_states_are_those_of_the_robot(model):
    space = model.workspace(200)
    _, forces, _ = energy(space.delta_a)
    assert len(space.x_e) == 200
    assert (np.abs(forces - space.lambda_a) < 2e-2 * np.abs(forces).max()).all()
    assert np.abs(space.x_e - space.rest_e - effector(space.delta_a)[0]).max() < 0.1
    assert (space.lambda_a >= 0).all() and (space.delta_a >= 0).all() and (space.delta_a <= 20).all()
    least, most = space.x_e[:, 0].min(), space.x_e[:, 0].max()
    assert repr(space).startswith(f"<workspace of 200 states: {model.rows.effectors[0]} {least:.4g} to {most:.4g}, ")


def test_its_states_are_searched_together_and_are_those_that_are_found_one_by_one(model, monkeypatch):
    evaluated, true = [], model.at
    monkeypatch.setattr(model, "at", lambda s, p=None: evaluated.append(len(s)) or true(s, p))
    space = model.workspace(200)
    assert 0 < len(evaluated) < 100 and sum(evaluated) >= 200
    monkeypatch.undo()
    for place in range(0, 200, 10):
        state = model.at_force(space.lambda_a[place])
        np.testing.assert_allclose(state.delta_a, space.delta_a[place], rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(model.rest_e + state.delta_e, space.x_e[place], rtol=1e-9, atol=1e-9)


def test_a_good_part_of_its_states_has_a_slack_cable(model):
    space = model.workspace(300)
    assert 0.1 < (space.lambda_a == 0).mean() < 0.4


def test_it_reaches_as_far_as_the_training_states(model):
    """Their hull, from states that share nothing with those drawn."""
    trained = effector(dataset(400, 5).delta_a)[0][:, :2]
    space = model.workspace(400)
    drawn = (space.x_e - space.rest_e)[:, :2]
    assert ConvexHull(drawn).volume > 0.9 * ConvexHull(trained).volume


def test_the_same_seed_gives_the_same_states(model):
    assert np.array_equal(model.workspace(20).x_e, model.workspace(20).x_e)
    assert not np.array_equal(model.workspace(20).x_e, model.workspace(20, seed=1).x_e)


def test_it_can_be_drawn(model, tmp_path):
    """Along each axis: all states, coloured by the largest share of a force, and the tip at rest."""
    space = model.workspace(50)
    figure = space.plot()
    figure.savefig(tmp_path / "workspace.png")
    shares = np.abs(space.lambda_a / np.abs(space.lambda_a).max(axis=0)).max(axis=1)
    for view, (i, j) in zip(figure.axes, [(0, 1), (0, 2), (1, 2)], strict=False):
        assert (view.get_xlabel(), view.get_ylabel()) == (f"tip.{'xyz'[i]} (mm)", f"tip.{'xyz'[j]} (mm)")
        (dots,), (rest,) = view.collections, view.lines
        np.testing.assert_allclose(dots.get_offsets(), space.x_e[:, [i, j]])
        np.testing.assert_allclose(dots.get_array(), shares)
        assert dots.get_clim() == (0, 1) and view.get_aspect() == 1.0
        np.testing.assert_allclose(rest.get_xydata(), [space.rest_e[[i, j]]])
        assert [text.get_text() for text in view.texts] == ["rest"] and view.texts[0].xy == tuple(space.rest_e[[i, j]])
    assert len(figure.axes) == 4  # the last is the bar of colours


def test_a_first_effector_of_one_coordinate_cannot_be_drawn():
    rows = Rows(("stop.x", "tip.x", "tip.y"), ("cable",))
    space = Workspace(rows, np.ones((2, 1)), np.ones((2, 1)), np.eye(3)[:2], np.zeros(3))
    with pytest.raises(InputError, match="effector 'stop' has fewer than two coordinates"):
        space.plot()


def test_no_states_are_an_error(model):
    with pytest.raises(InputError, match="at least one state, got 0"):
        model.workspace(0)
