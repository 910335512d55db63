"""Averages of models: weights of stacking, what the intervals of an average hold, and the commands."""

import json

import numpy as np
import pytest
from identify.cases.lab import QUIET, lab
from identify.cases.linear import Sort, coverage
from scipy.optimize import minimize
from scipy.special import softmax

from cfem.core.errors import InputError
from cfem.identify.cases.average import Average, average_of, averaged, stacking_weights
from cfem.identify.cases.left_out import LeftOut
from cfem.identify.cases.prediction.predict import Prediction
from cfem.identify.cases.prediction.stage import run as predict
from cfem.identify.cases.stage import run as calibrate

SD = np.tile(np.eye(3), (4, 2, 1, 1))


def test_weights_are_those_that_a_search_finds():
    """Of the mean over the coordinates of each case of the mixture's log density, and a prior."""
    logs = np.random.default_rng(0).normal(size=(3, 6, 2, 3))
    alike = 0.3

    def lost(a):
        w = softmax(a)
        mixed = np.log(np.einsum("n,nmki->mki", w, np.exp(logs))).mean(axis=(1, 2)).sum()
        return -mixed - alike * np.log(w).mean()

    wanted = softmax(minimize(lost, np.zeros(3), tol=1e-12).x)
    np.testing.assert_allclose(stacking_weights(logs), wanted, atol=2e-4)


def test_a_model_that_predicts_better_weighs_more_and_one_that_fails_is_passed_over():
    good = LeftOut(np.full((4, 2, 3), 0.1), SD, ())
    bad = LeftOut(np.full((4, 2, 3), 4.0), SD, ())
    average, left_out = average_of([good, bad], [20, 20])
    assert average.weights[0] > 0.9
    assert np.abs(left_out.residuals).max() < 0.6
    residuals, covariance = good.residuals.copy(), SD.copy()
    residuals[1], covariance[1] = np.nan, np.nan
    _, left_out = average_of([LeftOut(residuals, covariance, ("c1",)), bad], [20, 20])
    np.testing.assert_allclose(left_out.residuals[1], 4.0)
    assert left_out.failed == ()


def test_an_average_has_the_spread_of_its_models():
    """Mean and variance of a mixture of two normal distributions, drawn."""
    w, means, sds = np.array([0.3, 0.7]), np.array([-1.0, 2.0]), np.array([0.5, 1.0])
    rng = np.random.default_rng(1)
    which = rng.choice(2, 400_000, p=w)
    drawn = rng.normal(means[which], sds[which])
    shape = (1, 1, 3)
    models = [
        Prediction(
            np.full(shape, m),
            np.ones(shape),
            np.ones((1, 1)),
            np.full(shape, m - 0.5),
            (None,),
            {},
            np.tile(s**2 * np.eye(3), (1, 1, 1, 1)),
        )
        for m, s in zip(means, sds, strict=True)
    ]
    found = averaged(models, Average(w, 1.0, 1e9), 0.95)
    np.testing.assert_allclose(found.y, drawn.mean(), atol=0.01)
    np.testing.assert_allclose(np.diagonal(found.covariance[0, 0]), drawn.var(), rtol=0.01)
    np.testing.assert_allclose(found.half, 1.96 * drawn.std(), rtol=0.01)
    np.testing.assert_allclose(found.y - found.error, 0.5)


def test_a_case_that_no_model_predicts_has_failed():
    nothing = np.full((2, 1, 3), np.nan)
    one = Prediction(
        nothing, nothing, nothing[..., 0], nothing, (None, None), {0: "no", 1: "no"}, np.full((2, 1, 3, 3), np.nan)
    )
    found = averaged([one, one], Average(np.array([0.5, 0.5]), 1.0, 10.0), 0.95)
    assert found.failed == {0: "no", 1: "no"} and np.isnan(found.y).all()


@pytest.mark.slow
@pytest.mark.parametrize(("m", "lacks"), [(5, 1.0), (5, 3.0), (8, 3.0)])
def test_intervals_of_an_average_hold_where_the_model_is_not_known(m, lacks):
    coordinates, markers = coverage(60, m, Sort(lacks, 5.0, models=12, average=True))
    assert 0.93 < coordinates < 0.99 and 0.92 < markers < 0.99


def test_predictions_are_averaged(tmp_path):
    folder = lab(tmp_path)
    compare = ["compare={straight: [young]}"]
    results = calibrate(folder / "cases.yaml", compare, None, QUIET)["results"]
    weights = results["average"]["weights"]
    assert sum(weights.values()) == pytest.approx(1) and weights["kept"] > 0.8
    assert any("their average is" in line for line in results["headline"])
    changed = [f"cases={folder / 'cases.yaml'}"]
    kept = predict(folder / "predict.yaml", changed, tmp_path / "kept", QUIET)["results"]
    mixed = predict(folder / "predict.yaml", [*changed, "average=true"], tmp_path / "mixed", QUIET)["results"]
    assert mixed["median_half_mm"] > kept["median_half_mm"]
    assert mixed["coordinates_within"] >= 0.9
    json.dumps(results, allow_nan=False)


def test_one_model_has_no_average(tmp_path):
    folder = lab(tmp_path)
    results = calibrate(folder / "cases.yaml", [], None, QUIET)["results"]
    assert results["average"] is None
    with pytest.raises(InputError, match="average"):
        predict(folder / "predict.yaml", ["average=true"], tmp_path / "mixed", QUIET)
