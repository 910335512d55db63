"""Which samples a filter accepts: against the chi-squared distribution, and what becomes of runs of bad ones."""

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.stats import chi2, norm

from cfem.predict.estimation.gate import FIRST, Gate, GateSpec, SampleVerdict

ACCEPTED, REJECTED, RESTART = SampleVerdict.ACCEPTED, SampleVerdict.REJECTED, SampleVerdict.RESTART


def settled(**given):
    gate = Gate(**given)
    gate.spread = 1.0
    return gate


@pytest.mark.parametrize("n", [1, 3, 12, 60])
def test_deviates_are_those_of_chi_squared(n):
    """The square that is `sigmas` away has about the probability of a normal deviate, within a fifth of a sigma."""
    for sigmas in (1.0, 2.0, 3.0):
        square = (sigmas + np.sqrt(2 * n - 1)) ** 2 / 2
        assert settled().deviate(square, n) == pytest.approx(sigmas)
        away = abs(norm.isf(chi2.sf(square, n)) - sigmas)
        assert away < (0.4 if n == 1 else 0.25) * sigmas**0.5


def test_all_samples_of_a_filter_that_is_right_are_accepted():
    rng, gate = np.random.default_rng(0), Gate()
    assert all(gate.judge(square, 3) is ACCEPTED for square in rng.chisquare(3, 20000))
    assert 1.0 <= gate.spread < 1.6


@pytest.mark.parametrize("larger", [4.0, 25.0, 400.0])
def test_samples_of_a_filter_that_states_too_little_are_accepted_after_a_while(larger):
    """Squares `larger` times as large as stated: a robot that is not the model's is not rejected for ever."""
    rng, gate = np.random.default_rng(1), Gate()
    accepted = np.array([gate.judge(larger * square, 3) is not REJECTED for square in rng.chisquare(3, 400)])
    assert accepted[200:].all() and 0.6 < gate.spread / larger < 1.6


@pytest.mark.parametrize("share", [0.02, 0.3])
def test_outliers_do_not_open_it(share):
    rng, gate = np.random.default_rng(2), settled()
    bad = rng.random(4000) < share
    squares = np.where(bad, 10.0 ** rng.uniform(2.5, 12, 4000), rng.chisquare(3, 4000))
    verdicts = [gate.judge(square, 3) for square in squares]
    assert all((verdict is REJECTED) == wrong for verdict, wrong in zip(verdicts, bad, strict=True))
    assert gate.spread < 2.0


def test_samples_that_agree_make_the_filter_begin_again():
    gate = settled(samples=5)
    said = [gate.judge(1e4 * (1 + 0.2 * k), 3) for k in range(6)]
    assert said == [REJECTED] * 4 + [RESTART, REJECTED] and gate.spread == FIRST
    gate = settled(samples=3)
    assert [gate.judge(square, 3) for square in (1e4, 1e4, 1.0, 1e4, 1e4, 1e4)][3:] == [REJECTED, REJECTED, RESTART]


def test_samples_that_contradict_each_other_never_do():
    gate = settled(samples=2)
    assert {gate.judge(square, 3) for square in 60 * [1e4, 1e6]} == {REJECTED} and gate.spread == 1.0


def test_a_gate_may_take_any_run_of_rejected_samples_for_agreeing():
    gate = settled(samples=3, alike=np.inf)
    assert [gate.judge(square, 3) for square in (1e4, 1e9, 1e6)] == [REJECTED, REJECTED, RESTART]


def test_a_restart_returns_to_the_stated_first_spread():
    gate = Gate(samples=2, first=1.5)
    assert gate.spread == 1.5
    assert [gate.judge(1e6, 3) for _ in range(2)] == [REJECTED, RESTART] and gate.spread == 1.5


def test_a_negative_square_is_of_a_filter_that_is_lost():
    gate = settled()
    assert gate.judge(-1e-9, 3) is RESTART and gate.spread == FIRST


def test_whether_a_sample_would_be_accepted_changes_nothing():
    gate = settled()
    before = (gate.spread, gate.agreeing, gate.last)
    assert gate.accepts(3.0, 3) and not gate.accepts(1e4, 3) and not gate.accepts(np.inf, 3) and gate.accepts(np.inf, 0)
    assert (gate.spread, gate.agreeing, gate.last) == before


def test_a_sample_without_an_answer_counts_as_one_that_does_not_fit():
    gate = settled(samples=3)
    assert [gate.judge(square, 3) for square in (np.inf, np.nan, np.inf)] == [REJECTED, REJECTED, RESTART]
    assert settled().judge(np.inf, 0) is ACCEPTED  # nothing was known of it
    assert np.isfinite(gate.spread)


@pytest.mark.parametrize("wrong", [{"sigmas": 0.0}, {"samples": 0}])
def test_what_is_not_positive_is_refused(wrong):
    with pytest.raises(ValidationError):
        GateSpec(**wrong)
