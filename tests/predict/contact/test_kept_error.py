"""The error of a model's contact is calibrated once and kept beside the model, which states it when it is read."""

import shutil

import pytest

from cfem.condensed.model_error import ContactError, ContactFactors
from cfem.predict.contact.kept_error import kept_contact_error
from cfem.predict.load import load_model

FACTORS = ContactFactors(probability=0.95, places=20, force=0.02, tip=0.01)


@pytest.fixture
def asked(bar, tmp_path, patched_bar):
    """A call, and the frictions of the calibrations; what they say is made up."""
    folder, solved = shutil.copytree(bar / "models" / "bar" / "spectral", tmp_path / "spectral"), []

    def ask(mu=0.0, places=20, **made_of):
        def solve():
            solved.append(mu)
            given = {"probability": 0.95, "left_out": 0, "most": 3, "points": 5, "off": [0.1], "friction": mu}
            return ContactError(**given, one=FACTORS, several=FACTORS) if places > 1 else None

        return kept_contact_error(patched_bar, folder, made_of, mu, places, solve)

    return ask, solved, folder


def test_it_is_calibrated_once_for_the_same_robot_friction_and_places(asked):
    ask, solved, _ = asked
    assert ask(scene="one") == ask(scene="one") and len(solved) == 1
    ask(scene="other")
    ask(0.5, scene="one")
    ask(places=30, scene="one")
    assert solved == [0.0, 0.0, 0.5, 0.0]


def test_the_model_states_what_is_kept_of_itself(asked):
    ask, _, folder = asked
    assert load_model(folder).contact_errors == ()
    ask(0.5, scene="one")
    ask(0.2, scene="one", loads={"weight": 1})
    ask(places=1, scene="one")
    (stated,) = load_model(folder).contact_errors
    assert stated.friction == 0.5 and stated.several == FACTORS


def test_what_no_place_told_is_not_asked_again(asked):
    ask, solved, _ = asked
    assert ask(places=1) is None and ask(places=1) is None and len(solved) == 1


def test_a_damaged_file_is_calibrated_again(asked):
    ask, solved, folder = asked
    ask()
    (kept,) = folder.parent.glob("contact-*.json")
    kept.write_text(kept.read_text()[:100])
    assert load_model(folder).contact_errors == ()
    ask()
    assert ask().one.places == 20 and len(solved) == 2
