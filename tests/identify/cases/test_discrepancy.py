"""What the model lacks, as a smooth function of the forces."""

from dataclasses import replace

import numpy as np
import pytest
from identify.cases.linear import K, LinearRig, Sort, cases_of, coverage, trial

from cfem.identify.cases.discrepancy import DiscrepancyPrior, discrepancy_of
from cfem.identify.cases.fit import fit_with_discrepancy
from cfem.identify.cases.scatter import Scatter


def test_there_is_none_without_load_and_no_more_beyond_the_calibration():
    lacking = DiscrepancyPrior(np.array([2.0, 3.0]), np.ones(K))
    features = lacking.features(np.array([[0.0, 0.0], [2.0, 0.0], [1.0, 3.0], [4.0, 0.0]]))
    assert lacking.terms == [(0,), (1,), (0, 0), (0, 1), (1, 1)]
    np.testing.assert_allclose(features, [[0, 0, 0, 0, 0], [1, 0, 1, 0, 0], [0.5, 1, 0.25, 0.5, 1], [1, 0, 1, 0, 0]])


def test_its_size_goes_with_how_far_the_markers_moved():
    places = np.zeros((2, 1, 3))
    places[:, 0, 0] = [10.0, 14.0]
    cases = replace(cases_of(np.array([0.0, 2.0]), places))
    assert discrepancy_of(cases).spread == pytest.approx([2.0])  # from their mean
    from_rest = replace(cases, rest=np.full((2, 1, 3), [8.0, 0.0, 0.0]))
    assert discrepancy_of(from_rest).spread == pytest.approx([np.sqrt((2**2 + 6**2) / 2)])  # from rest
    assert discrepancy_of(cases).largest == pytest.approx([2.0])


def _share(smooth: float, seed: int) -> float:
    """Share that is estimated of twelve cases of a model that lacks a multiple of the noise."""
    rng = np.random.default_rng(seed)
    rig, f = LinearRig(rng, 0.0), np.linspace(0.1, 1, 12)
    blank = cases_of(f, np.zeros((12, K, 3)))
    lacks = smooth * (
        rng.standard_normal((K, 3)) * f[:, None, None] + rng.standard_normal((K, 3)) * f[:, None, None] ** 2
    )
    places = rig.see(blank, rng.standard_normal(5), np.zeros(0)).y + lacks + rng.standard_normal((12, K, 3))
    cases = replace(blank, places=places)
    return fit_with_discrepancy(rig.with_discrepancy(discrepancy_of(cases)), cases, Scatter(1.0))[0].discrepancy.share


def test_its_share_is_small_where_the_model_lacks_nothing():
    right, wrong = np.mean([[_share(0.0, seed), _share(10.0, seed)] for seed in range(4)], axis=0)
    assert 5 * right < wrong


def test_it_corrects_predictions_and_narrows_intervals():
    """Of models that lack ten times the noise: errors of new cases at least halve, and intervals with them."""
    sort = Sort(smooth=10.0)
    distances, halves = [], []
    for kind in (sort, replace(sort, discrepancy=True)):
        predictions = [trial(np.random.default_rng([seed, 12]), 12, kind) for seed in range(12)]
        distances.append(np.mean([p.distance for p in predictions]))
        halves.append(np.median([p.half for p in predictions]))
    assert distances[1] < 0.5 * distances[0] and halves[1] < 0.5 * halves[0]


@pytest.mark.slow
def test_its_intervals_cover_what_they_say():
    coordinates, markers = coverage(40, 8, Sort(smooth=3.0, discrepancy=True))
    assert 0.93 < coordinates < 0.98 and 0.92 < markers < 0.98
