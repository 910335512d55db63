"""Parameters found again, what cannot be found said, and intervals that cover the truth as often as they claim."""

from dataclasses import replace

import numpy as np
import pytest
from identify.robot.truth import PULLS, measured
from parametric.synthetic import Arc, Halves
from support.fast_cases import fast_are

from cfem.core.errors import InputError, NumericalError
from cfem.identify.robot.calibration import calibrate, coverage
from cfem.identify.robot.measurements import Measurements
from cfem.identify.robot.residuals import Noise

L, NU, E = 0, 1, 2
TRUTH = np.array([40.0, 0.47, 3.0])
STARTS = np.array([[40.0, nu, 3.0] for nu in (0.42, 0.45, 0.49)])


def run(found, find, noise=None, starts=STARTS, family=None, **more):
    return calibrate(family or Arc(), found, find, starts[0], starts, noise, **more)


def test_poisson_is_found_from_three_positions_and_from_every_start():
    found = run(measured(TRUTH), [NU])
    assert found.estimates[0].value == pytest.approx(0.47, abs=1e-10)
    for one in found.fits:
        assert found.problem.p(one.u)[NU] == pytest.approx(0.47, abs=1e-8)
        assert one.failure is None and len(one.costs) <= 12
    assert np.abs(found.residuals).max() < 1e-11
    assert found.sentences == ["poisson: identifiable"]


def test_the_modulus_cannot_be_found_from_displacements_and_can_from_a_force():
    blind = run(measured(TRUTH), [NU, E])
    assert blind.unseen == ("young",) and blind.p[E] == 3.0
    assert [one.name for one in blind.estimates] == ["poisson"]
    assert "young cannot be found from displacements alone" in blind.lost[0]
    assert "measure a force" in blind.lost[0]
    starts = STARTS * [1, 1, 2.5]
    seeing = run(measured(TRUTH, dual=True), [NU, E], starts=starts)
    assert seeing.unseen == () and seeing.p == pytest.approx(TRUTH, rel=1e-9)
    driven = run(measured(TRUTH, np.array([[2.0], [5.0], [9.0]]), "force"), [NU, E], starts=starts)
    assert driven.p == pytest.approx(TRUTH, rel=1e-8)


def test_the_modulus_alone_from_displacements_is_no_fit_at_all():
    found = run(measured(TRUTH), [E])
    assert found.estimates == () and found.unseen == ("young",) and np.array_equal(found.p, STARTS[0])
    assert len(found.residuals) == 9 and found.fits == ()


def test_parameters_that_only_act_together_are_named_together():
    """A force at one pull: length, Poisson's ratio and modulus enter as one product. Poisson's ratio changes it by 5 %,
    the modulus, whose range is a factor of ten, by no more than that in a hundredth of its range."""
    found = run(measured(TRUTH, np.array([[8.0]]), positions=False, dual=True), [L, NU, E], Noise(0.1, 0.05, True))
    assert found.uncertainty.information.rank == 1 and len(found.lost) == 2
    assert "poisson cannot be found: small changes of young hide it" in found.lost and found.sentences == []
    assert any(sentence.startswith("only together: a change along 1 length +0.22 young") for sentence in found.lost)
    assert all(one.interval == (None, None) and one.deviation is None for one in found.estimates)


@pytest.mark.parametrize("wrong", [0.0, 1e-3, 1e-2])
def test_of_two_moduli_displacements_tell_the_ratio_and_a_force_or_a_weight_both(wrong):
    truth, u = np.array([0.8, 4.0]), np.array([[2.0], [5.0], [9.0]])
    starts = np.array([[1.0, 3.0], [0.6, 5.0]])

    def found(dual, family, real):
        states = real.at("displacement", u, np.tile(truth, (3, 1)))
        no_e, no_a = np.full((3, 3), np.nan), np.full((3, 1), np.nan)
        data = Measurements("displacement", u, states.x_e, no_e, states.lam if dual else no_a)
        return calibrate(family, data, [0, 1], starts[0], starts, with_profile=False)

    blind = found(False, Halves(wrong), Halves())
    (sentence,), (ratio,) = blind.lost, blind.combinations
    assert sentence.startswith("A and B cannot be found: c A and c B") and sentence.endswith("measure a force")
    assert blind.sentences == [] and all(one.interval == (None, None) for one in blind.estimates)
    value = 0.2 if ratio.name == "A/B" else 5.0
    assert ratio.value == pytest.approx(value, rel=0.05 if wrong else 1e-6)
    for seeing in (found(True, Halves(wrong), Halves()), found(False, Halves(wrong, 1.0), Halves(weight=1.0))):
        assert seeing.lost == [] and seeing.combinations == []
        assert seeing.p == pytest.approx(truth, rel=0.1 if wrong else 1e-6)


def test_a_weak_parameter_is_called_weak_and_its_interval_ends_with_its_range():
    found = run(measured(TRUTH), [L, NU], Noise(0.5, 1.0, True))
    assert found.estimates[1].interval == pytest.approx((0.40, 0.499))
    assert ["poisson is weakly identifiable" in one for one in found.sentences] == [True]


@pytest.mark.parametrize("known", fast_are({False}, [True, False]))
def test_intervals_cover_the_truth_as_often_as_they_claim(known):
    """200 noisy repeats; 90 % of 200 are 180 +- 4.2, so below 168 or above 192 is three deviations off."""
    u, noise = np.linspace(0, 12, 7)[:, None], (0.05, 0.02)
    stated = Noise(*noise, True) if known else None
    family, covered, profiled = Arc(), 0, 0
    if not known:
        noise = (0.05, 0.05 * 0.4)  # both are estimated in one proportion
    for seed in range(200):
        found = run(
            measured(TRUTH, u, dual=known, noise=noise, seed=seed),
            [NU],
            stated,
            STARTS[:1],
            family,
            confidence=0.9,
            with_profile=seed < 100,
        )
        low, high = found.estimates[0].interval
        covered += low <= 0.47 <= high
        if seed < 100:
            ends = found.estimates[0].profile
            profiled += (ends[0] or 0.0) <= 0.47 <= (ends[1] or 0.5)
    assert 168 <= covered <= 192
    assert 81 <= profiled <= 99


def test_simulated_repeats_count_how_often_the_interval_covers():
    noise = Noise(0.05, 0.02, True)
    found = run(measured(TRUTH, dual=True), [NU, E], noise, STARTS * [1, 1, 2], with_profile=False)
    for confidence in (0.5, 0.9):
        shares = coverage(found, noise, confidence, 100)
        assert shares.shape == (2,) and np.abs(shares - confidence).max() < 0.15


def test_profiles_agree_with_the_covariance_where_the_noise_is_small():
    found = run(measured(TRUTH, dual=True, noise=(1e-3, 1e-3)), [NU, E], Noise(1e-3, 1e-3, True), STARTS * [1, 1, 2])
    for one in found.estimates:
        assert np.array(one.profile) == pytest.approx(np.array(one.interval), rel=2e-3)


def test_residuals_beyond_the_noise_widen_the_intervals():
    honest = run(measured(TRUTH, noise=(0.2, 0)), [NU], Noise(0.2, 1, True))
    proud = run(measured(TRUTH, noise=(0.2, 0)), [NU], Noise(0.01, 1, True))
    assert honest.uncertainty.scale == 1.0 and honest.uncertainty.chance > 1e-3
    assert proud.uncertainty.chance < 1e-3 and proud.uncertainty.scale > 5
    assert proud.estimates[0].deviation > honest.estimates[0].deviation / 3


def test_the_noise_is_estimated_where_it_is_not_stated():
    u = np.linspace(1, 12, 60)[:, None]
    found = run(measured(TRUTH, u, noise=(0.05, 0.0)), [NU])
    assert found.noise.effectors == pytest.approx(0.05, rel=0.2)


def test_as_many_numbers_as_parameters_have_no_interval_without_a_noise():
    few = measured(TRUTH, np.array([[8.0]]), positions=False, dual=True)
    starts = np.array([[40.0, 0.47, 2.0], [40.0, 0.47, 5.0]])
    alone = run(few, [E], starts=starts)
    assert alone.p[E] == pytest.approx(3.0) and alone.estimates[0].interval == (None, None)
    assert run(few, [E], Noise(1, 0.1, True), starts).estimates[0].interval != (None, None)


def test_an_answer_at_the_end_of_the_range_is_marked():
    found = run(measured([40.0, 0.3992, 3.0]), [NU])
    assert found.estimates[0].at_end and found.estimates[0].value == pytest.approx(0.40, abs=1e-4)


def test_starts_that_fail_are_named_and_the_others_serve():
    class Fussy(Arc):
        def at(self, kind, u, p):
            if (np.asarray(p)[:, NU] < 0.43).any():
                raise NumericalError("too soft")
            return super().at(kind, u, p)

    found = run(measured(TRUTH), [NU], family=Fussy(), starts=STARTS[::-1], with_profile=False)
    assert [one.failure for one in found.fits] == [None, None, "too soft"]
    assert found.estimates[0].value == pytest.approx(0.47, abs=1e-8)
    with pytest.raises(NumericalError, match="too soft"):
        run(measured(TRUTH), [NU], family=Fussy(), starts=STARTS[:1], with_profile=False)


def test_rows_that_nobody_measured_are_no_matter():
    data = measured(TRUTH)
    data = replace(data, x_e=np.where([False, True, True], data.x_e, np.nan))
    assert run(data, [NU]).estimates[0].value == pytest.approx(0.47, abs=1e-8)


def test_nothing_measured_is_an_error():
    with pytest.raises(InputError, match="holds no measurement"):
        run(measured(TRUTH, positions=False), [NU])


def test_one_query_serves_value_and_jacobian():
    family = Arc()
    found = run(measured(TRUTH, PULLS), [NU], family=family, with_profile=False)
    batch = 3 * (1 + 6)
    evaluations = sum(len(one.costs) for one in found.fits)
    assert family.asked == batch * (2 + evaluations + 1) + 3
