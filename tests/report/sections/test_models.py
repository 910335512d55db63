import numpy as np
import pytest
from report.synthetic import trained
from scipy.stats import spearmanr

from cfem.report.sections.models import error_charts, looks, model_table, training_chart
from cfem.report.sections.trust import Trust, trust_chart, trust_summary
from cfem.report.spec import Published

MODELS = {
    "one": trained("spectral", losses=(1e-3, 1e-5, 0.0)),  # exact: no logarithm
    "two": trained("spectral", "force"),
    "three": trained("serial"),
    "four": trained("mlp", losses=(1.0,)),
    "five": trained("mlp"),
}


def test_every_model_has_a_look_of_its_own_and_kinds_share_a_colour():
    found = looks(MODELS)
    assert len({tuple(sorted(map(str, look.items()))) for look in found.values()}) == len(MODELS)
    assert found["one"]["color"] == found["two"]["color"] != found["three"]["color"]
    assert found["four"]["color"] == found["five"]["color"] and found["four"]["marker"] != found["five"]["marker"]


@pytest.mark.parametrize(
    "published, drawn",
    [
        (None, False),
        (Published(source="a paper", samples=6500, loss=4e-6), True),
        (Published(source="a paper", loss=4e-6, query_us=100.0), True),
        (Published(source="a paper", samples=6561), False),
    ],
)
def test_errors_are_drawn_against_samples_and_seconds_with_what_was_published(published, drawn):
    samples, total = error_charts(MODELS, published, "one", force="MPa")
    assert len(samples.panels) == len(total.panels) == 3 and "largest force error (MPa)" in samples.panels[2]
    assert ("a paper" in samples.legend) == ("a paper" in total.legend) == drawn


def test_no_errors_are_drawn_of_two_points_nor_seconds_of_one_model():
    assert error_charts({"two": MODELS["two"], "five": MODELS["five"]}) == []
    assert [one.name for one in error_charts({"one": MODELS["one"]})] == ["errors-samples"]


def test_a_published_model_has_dashes_where_nothing_is_known():
    table = model_table({"one": MODELS["one"]}, Published(source="a paper", loss=4e-6, query_us=100.0), force="MPa")
    assert table.rows[1] == ("a paper", "–", "–", "4.00·10⁻⁶", "–", "–", "–", "–", "100 µs")
    assert "force error, mean / max (MPa)" in table.head


def test_a_loss_over_test_states_that_do_not_differ_is_none():
    """A single state: its variance is 0, and so would be the loss."""
    single = {**MODELS["one"], "errors": {**MODELS["one"]["errors"], "states": 1, "entries": 0, "loss": 0.0}}
    both = model_table({"one": single, "two": MODELS["two"]})
    assert both.head[2] == "test states" and both.rows[0][2:4] == ("1", "–")
    assert "the paper's loss" not in model_table({"one": single}).head


def test_histories_of_series_and_of_networks_are_drawn():
    found = training_chart(MODELS)
    assert len(found.panels) == 5 and "validation" in found.legend


def states(inside: bool, error: float) -> Trust:
    return Trust(np.full(3, error), np.array([0.0, 1.0, 5.0]), np.full(3, inside), np.array([False, False, True]))


@pytest.mark.parametrize("error", [0.0, 1e-3, np.nan])
def test_trust_is_drawn_where_all_or_nothing_is_flagged_and_where_there_is_no_answer(error):
    assert len(trust_chart({"flagged": states(False, error), "not": states(True, 1e-2)}).panels) == 2


def test_the_rank_correlation_is_spearmans_with_ties():
    generator = np.random.default_rng(3)
    error, distance = generator.random(40), generator.integers(0, 8, 40) / 4
    found = trust_summary(Trust(error, distance, distance < 1, np.zeros(40, bool)))
    assert found["rank_correlation"] == pytest.approx(spearmanr(error, distance).statistic, abs=1e-12)
