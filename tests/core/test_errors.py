"""How a message names its place."""

import pytest

from cfem.core.artefact.changes import LONGEST, in_words
from cfem.core.errors import InputError, StaleError, located


def test_a_path_that_goes_back_is_shown_direct(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "pipelines" / "bar").mkdir(parents=True)
    error = InputError("no such file", where="pipelines/bar/../../data/mesh")
    assert error.where == "data/mesh" and str(error) == "data/mesh: no such file"


def test_it_stays_where_a_link_leads_elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "deep" / "bar").mkdir(parents=True)
    (tmp_path / "bar").symlink_to("deep/bar")
    assert InputError("is damaged", where="bar/../data").where == "bar/../data"


@pytest.mark.parametrize("where", [None, "scene.yaml:12", "loads.a", "goal"])
def test_what_is_no_such_path_stays(where):
    assert InputError("is wrong", where=where).where == where


def test_an_error_without_a_place_gets_one_and_stays_what_it_is(tmp_path):
    for where, shown in ((None, str(tmp_path)), ("reach", "reach")):
        with pytest.raises(StaleError) as raised, located(tmp_path):
            raise StaleError("is old", where=where, do="make it again")
        assert (raised.value.where, raised.value.what, raised.value.do) == (shown, "is old", "make it again")


def test_long_values_are_counted_or_cut():
    cables = [{"kind": "cable", "name": f"cable-{number}", "reach": [0.0, 8.0]} for number in range(3)]
    assert in_words(None, (), cables) == "3 of them"
    assert in_words(None, (), [0.0, 8.0]) == "[0.0, 8.0]"
    cut = in_words(None, (), {"points": [0.0] * 50})
    assert cut.startswith("{'points': [0.0, 0.0") and cut.endswith(" ...") and len(cut) == LONGEST + 4
