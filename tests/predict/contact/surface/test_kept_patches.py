"""How patches yield is solved once and kept beside the model."""

from copy import copy
from types import SimpleNamespace

import numpy as np
import pytest

from cfem.equilibrium.contact.node_compliance import NodeResponse
from cfem.equilibrium.contact.patch_compliance import PatchResponse
from cfem.predict.contact.surface import kept_patches
from cfem.predict.contact.surface.kept_patches import node_model_of, patched_model_of, yield_of
from cfem.predict.load import load_model
from cfem.predict.series.few_states import patch_states

FOLDER = "models/bar/spectral"


@pytest.fixture
def asked(bar, tmp_path, monkeypatch):
    """A call, and how often finite elements were solved; what they say is made up."""
    model, solved = load_model(bar / FOLDER), []

    def solve(robot, skin, patches, states):
        solved.append(len(patches))
        J, n = len(states), 3 * len(patches)
        nothing = np.zeros((J, 1, 4, 4))
        return PatchResponse(
            states,
            np.full((J, n, n), float(len(solved))),
            np.zeros((J, 3, n)),
            nothing,
            np.zeros((J, len(patches), 3, 3, 6)),
        )

    monkeypatch.setattr(kept_patches, "patch_response", solve)

    class Rows:
        n_a = 1

    class Robot:
        rows = Rows

    def ask(apart=20.0, **made_of):
        return patched_model_of(model, tmp_path / "spectral", Robot, made_of, apart)

    return ask, solved


def test_it_is_solved_once_for_the_same_robot_and_patches(asked):
    ask, solved = asked
    first, second = ask(scene="one"), ask(scene="one")
    assert len(solved) == 1 and np.array_equal(first.by_fe.own, second.by_fe.own)
    ask(scene="other")
    ask(scene="one", apart=8.0)
    assert len(solved) == 3


def test_a_damaged_file_is_solved_again(asked, tmp_path):
    ask, solved = asked
    ask()
    (kept,) = tmp_path.glob("patches-*.npz")
    kept.write_bytes(kept.read_bytes()[:100])
    assert ask().by_fe.own[0, 0, 0] == 2.0
    assert ask().by_fe.own[0, 0, 0] == 2.0 and len(solved) == 2


def test_every_node_is_asked_as_far_as_its_length_says_and_kept_in_fewer_bytes(bar, tmp_path, monkeypatch):
    """Near nodes are within 3 mm of a bar of 60 mm, and nodes dent each other within 1.68 mm."""
    model, asked = load_model(bar / FOLDER), []
    states = patch_states(model.domain, 1)
    m, J = len(model.skin.nodes), len(states)

    def response(robot, skin, states, local, modes, near, denting):
        asked.append((states, local, modes, near, denting))
        pairs, triples = np.array([[0, 0], [0, 1]]), np.array([[0, 0, 0]])
        return NodeResponse(
            states, np.full((3 * m, 2), 1 / 3), np.tile(np.eye(2), (J, 1, 1)), np.zeros((J, 3, 3 * m)),
            np.zeros((J, 1, 4, 4)), local, pairs, np.full((2, 2, 3, 3), 0.1), triples, np.zeros((1, 3, 3, 3)),
        )  # fmt: skip

    monkeypatch.setattr(kept_patches, "node_response", response)
    robot = SimpleNamespace(rows=SimpleNamespace(n_a=1))
    kept = [node_model_of(model, tmp_path / "spectral", robot, {"scene": name}) for name in ("one", "one", "other")]
    assert len(asked) == 2 and len(list(tmp_path.glob("nodes-*.npz"))) == 2
    seen, local, modes, near, denting = asked[0]
    np.testing.assert_array_equal(seen, states)
    ends = states[local][:, 0]
    assert {*ends} == {states.min(), states.max()}
    assert (modes, near, denting) == (80, pytest.approx(3.0), pytest.approx(1.68))
    for one in kept:
        assert one.by_fe.modes.dtype == one.by_fe.left.dtype == np.float16
        np.testing.assert_array_equal(one.by_fe.modes, np.float16(1 / 3))
        assert len(one.patches) == m


@pytest.mark.parametrize("change", ["form", "parameters", "kind"])
def test_what_few_states_do_not_tell_of_patches_is_not_asked(bar, monkeypatch, change):
    model = copy(load_model(bar / FOLDER))
    if change == "kind":
        model = SimpleNamespace(form="displacement", parameters=())
    else:
        monkeypatch.setattr(type(model), change, "force" if change == "form" else ("young",), raising=False)
        model.__dict__.pop(change, None)
    monkeypatch.delattr(kept_patches, "patch_yield")
    assert yield_of(model, bar / FOLDER, None, {}, []) is None
