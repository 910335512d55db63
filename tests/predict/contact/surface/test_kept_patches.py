"""How patches yield is solved once and kept beside the model."""

import numpy as np
import pytest

from cfem.equilibrium.contact.patch_compliance import PatchResponse
from cfem.predict.contact.surface import kept_patches
from cfem.predict.contact.surface.kept_patches import patched_model_of
from cfem.predict.load import load_model

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
