"""A model that is right at rest may be asked there, though no sample lies there."""

from dataclasses import replace

import numpy as np
from surrogate.synthetic import REACH, dataset

from cfem.predict.load import build
from cfem.surrogate.rest import domain_with_rest
from cfem.surrogate.spec import SpectralSpec
from cfem.surrogate.stage import train_and_judge


def pulled(training):
    """The states that pull all cables by a fifth of their reach at least."""
    return training.take(np.flatnonzero((training.delta_a > 0.2 * REACH).all(axis=1)))


def test_rest_is_in_the_domain_of_states_that_all_pull():
    training, test = pulled(dataset(60, 1)), dataset(20, 2)
    meta, arrays, _ = train_and_judge(training, test, SpectralSpec(kind="spectral"))
    model, zero = build(meta, arrays), np.zeros(len(training.rows.actuators))
    assert model.inside(model.at_displacement(zero))
    assert not model.inside(model.at_displacement(zero - 0.2 * REACH))
    alone = replace(training, meta={**training.meta, "robot": {"gravity": {"acceleration": [0, 0, -9810]}}})
    meta, arrays, _ = train_and_judge(alone, test, SpectralSpec(kind="spectral"))
    assert not build(meta, arrays).inside(model.at_displacement(zero))  # where it hangs, nobody has told


def test_a_model_that_errs_at_rest_is_not_to_be_asked_there():
    training, test = pulled(dataset(60, 1)), dataset(20, 2)
    meta, arrays, results = train_and_judge(training, test, SpectralSpec(kind="spectral", max_degree=2))
    wrong, exact = build(meta, arrays), {"tip_mm": {"max": 0.0}, "force_N": {"max": 0.0}}
    assert np.linalg.norm(wrong.at_displacement(np.zeros(2)).delta_e) > 1e-3 * wrong.length
    assert domain_with_rest(wrong, training, results["errors"] | exact) is None
