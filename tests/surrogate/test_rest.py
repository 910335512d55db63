"""A model that is right at rest may be asked there, though no sample lies there, and states its error there."""

from dataclasses import replace

import numpy as np
import pytest
from surrogate.synthetic import REACH, dataset, energy

from cfem.predict.load import build
from cfem.surrogate.calibration import bound, calibrated
from cfem.surrogate.spec import SpectralSpec
from cfem.surrogate.stage import train_and_judge

ZERO = np.zeros(2)


def pulled(rows, seed, **meta):
    """States that pull all cables by a fifth of their reach at least."""
    states = dataset(rows, seed)
    (stiffness,) = energy(ZERO[None])[2]
    states = replace(states, meta={**states.meta, "compliance": np.linalg.inv(stiffness).tolist(), **meta})
    return states.take(np.flatnonzero((states.delta_a > 0.2 * REACH).all(axis=1)))


def stating(training, test, **spec):
    """The model of these states, which states its error."""
    meta, arrays, _ = train_and_judge(training, test, SpectralSpec(kind="spectral", **spec))
    return build({**meta, "model_error": calibrated(build(meta, arrays), test)}, arrays)


@pytest.mark.parametrize("degree", [5, 8])
def test_rest_is_in_the_domain_and_its_error_within_the_stated_one(degree):
    model = stating(pulled(60, 1), pulled(60, 2), max_degree=degree)
    state = model.at_displacement(ZERO)
    stated = model.error(state)
    assert model.inside(state) and stated.inside
    assert np.linalg.norm(state.delta_e) <= stated.tip and (np.abs(state.lambda_a) <= stated.actuators).all()
    assert not model.inside(model.at_displacement(ZERO - 0.2 * REACH))
    fresh = pulled(300, 3)
    states, most = model.at_displacement(fresh.delta_a), model.error(model.at_displacement(fresh.delta_a))
    held = np.linalg.norm(states.delta_e - fresh.delta_e, axis=1) <= most.tip
    assert held.mean() > 0.9


def test_where_a_robot_hangs_under_its_weight_nobody_has_told():
    weight = {"gravity": {"acceleration": [0, 0, -9810]}}
    model = stating(pulled(60, 1, robot=weight), pulled(60, 2, robot=weight))
    assert not model.inside(model.at_displacement(ZERO))


def test_a_model_that_errs_at_rest_is_not_to_be_asked_there():
    model = stating(pulled(60, 1), pulled(60, 2), max_degree=2)
    state = model.at_displacement(ZERO)
    assert np.linalg.norm(state.delta_e) > 1e-3 * model.length and not model.inside(state)


def test_a_bound_grows_until_it_holds_for_a_known_error():
    rng = np.random.default_rng(0)
    L = rng.uniform(0.5, 2, 100)
    errors = 1e-3 * L**2 * rng.uniform(0.5, 1, 100)
    plain, raised = bound(errors, L), bound(errors, L, 1.0, 4.0)
    assert plain.at(np.array(4.0)) < 1.0 <= raised.at(np.array(4.0)) and raised.power > plain.power
    assert (errors <= raised.at(L)).mean() >= 0.95
