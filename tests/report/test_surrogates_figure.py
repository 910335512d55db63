import numpy as np
import pytest
from report.synthetic import epochs, point, trained

from cfem.report.spec import Published
from cfem.report.surrogates import Trust
from cfem.report.surrogates_figure import error_figure, looks, meshes_figure, sampling_figure, trust_figure
from cfem.report.training_figure import training_figure

PNG = b"\x89PNG\r\n\x1a\n"
MODELS = {
    "one": trained("spectral", losses=(1e-3, 0.0)),  # exact: no logarithm
    "two": trained("spectral", "force"),
    "three": trained("energy_net"),
    "four": trained("mlp", losses=(1.0,)),
    "five": trained("mlp"),
}


def test_every_model_has_a_look_of_its_own_and_kinds_share_a_colour():
    found = looks(MODELS)
    assert len({tuple(sorted(map(str, look.items()))) for look in found.values()}) == len(MODELS)
    assert found["one"]["color"] == found["two"]["color"] != found["three"]["color"]
    assert found["four"]["color"] == found["five"]["color"] and found["four"]["marker"] != found["five"]["marker"]


@pytest.mark.parametrize(
    "published",
    [
        None,
        Published(source="a paper", samples=6500, loss=4e-6),
        Published(source="a paper", loss=4e-6, query_us=100.0),
        Published(source="a paper", samples=6561),
    ],
)
def test_errors_are_drawn_with_what_was_published(published):
    assert error_figure(MODELS, published, "one").startswith(PNG)


def test_histories_of_series_and_of_networks_are_drawn():
    by_quantity = {**MODELS["three"], "history": epochs("effector") + epochs("potential")}
    assert training_figure({**MODELS, "six": by_quantity}).startswith(PNG)


def states(inside: bool, error: float) -> Trust:
    return Trust(np.full(3, error), np.array([0.0, 1.0, 5.0]), np.full(3, inside), np.array([False, False, True]))


@pytest.mark.parametrize("error", [0.0, 1e-3, np.nan])
def test_trust_is_drawn_where_all_or_nothing_is_flagged_and_where_there_is_no_answer(error):
    assert trust_figure({"flagged": states(False, error), "not": states(True, 1e-2)}).startswith(PNG)


def test_studies_are_drawn():
    rows = [
        {"method": method, "model": "spectral", "kind": "spectral", **point(samples, 1e-3)}
        for method in ("grid", "scrambled-halton")
        for samples in (36, 100)
    ]
    assert sampling_figure(rows).startswith(PNG)
    mesh = {"kind": "spectral", "curve": [point(30, 1e-3), point(100, 1e-5)], "steps_learned": 5e3, "steps_fe": 4.0}
    published = Published(source="a paper", samples=6500, loss=4e-6).model_dump()
    sizes = [{**mesh, "cells": cells, "published": known} for cells, known in ((1600, None), (9000, published))]
    assert meshes_figure(sizes).startswith(PNG)
