"""The network of an energy: what it reaches on a robot of closed form, and its predictor."""

import numpy as np
import pytest
import torch
from surrogate.synthetic import dataset

from cfem.export.onnx import onnx_bytes
from cfem.export.torchscript import torchscript_bytes
from cfem.predict.kinds.energy_net import EnergyNetPredictor
from cfem.predict.series.energy import FORMS, layout
from cfem.surrogate.error_measures import measure
from cfem.surrogate.model_card import model_card
from cfem.surrogate.networks.energy_net import fit, polynomial_parts
from cfem.surrogate.networks.energy_net_module import EnergyNet
from cfem.surrogate.spec import EnergyNetSpec

SPEC = EnergyNetSpec(kind="energy_net", width=12, iterations=40)


def trained(training, spec=SPEC, folder=None):
    arrays, facts, history = fit(training, spec, folder)
    return EnergyNetPredictor(model_card("energy_net", training, **facts), arrays), arrays, history


@pytest.fixture(scope="module")
def models():
    """By form: three inputs and a parameter, a few iterations."""
    training = dataset(40, 1, 3, unilateral=False, parameters=True)
    spec = SPEC.model_copy(update={"iterations": 10})
    return {form: trained(training, spec.model_copy(update={"form": form}))[:2] for form in FORMS}


def states(form):
    """(4, 3) inputs among those that `models` were trained on."""
    some = dataset(4, 1, 3, unilateral=False)
    return some.delta_a if form == "displacement" else some.lambda_a


def test_two_cables_from_sixty_states():
    training, test = dataset(60, 1), dataset(50, 2)
    model, _, history = trained(training)
    errors = measure(test, *model.evaluate(test.delta_a))
    assert errors["loss"] < 1e-7
    assert errors["tip_mm"]["max"] < 1e-3 and errors["force_N"]["max"] < 1e-3
    assert {record["quantity"] for record in history} == {"potential", "effector", "effector_compliance"}
    for name in {record["quantity"] for record in history}:
        records = [record for record in history if record["quantity"] == name]
        assert records[-1]["training"] < 1e-2 * records[0]["training"] and records[-1]["iteration"] <= SPEC.iterations


def test_third_order_data_stand_in_for_states():
    test, few = dataset(50, 2), {"m": 20, "seed": 1}
    losses = []
    for third_order in (False, True):
        model, _, _ = trained(dataset(**few, third_order=third_order))
        losses.append(measure(test, *model.evaluate(test.delta_a))["loss"])
    assert losses[1] < 0.3 * losses[0]


def test_the_force_form_and_a_parameter():
    training, test = dataset(100, 1, parameters=True), dataset(50, 2, parameters=True)
    model, _, _ = trained(training, SPEC.model_copy(update={"form": "force"}))
    p = np.hstack([test.p, np.full((50, 1), 3.0)])
    W, delta_free = model.evaluate(test.lambda_a, p)
    assert np.abs(W - test.W).max() < 0.02 * np.abs(test.W).max()
    assert np.abs(delta_free - test.delta_free).max() < 0.02 * np.abs(test.delta_free).max()
    softer = model.evaluate(test.lambda_a * 2, p * [1, 2])[0]  # twice Young's modulus carries twice the force
    assert np.allclose(2 * softer, W, rtol=1e-12)


@pytest.mark.parametrize("form", FORMS)
def test_each_part_is_the_derivative_of_its_potential(models, form):
    model, _ = models[form]
    s, q = states(form), np.full((4, 1), -1.0)
    part, h = model.parts(s, q), 1e-5 * np.ptp(s)
    for i, step in enumerate(h * np.eye(3)):
        ahead, behind = model.parts(s + step, q), model.parts(s - step, q)
        for whole, derivative in (
            ("energy", part["gradient"][:, i : i + 1]),
            ("gradient", part["hessian"][:, :, i]),
            ("effector", part["effector_gradient"][:, :, i]),
        ):
            expected = (ahead[whole] - behind[whole]) / (2 * h)
            assert np.allclose(derivative, expected, rtol=1e-6, atol=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize("form", FORMS)
def test_the_module_equals_the_predictor_and_can_be_differentiated(models, form):
    model, arrays = models[form]
    module = EnergyNet(form, model.rows, arrays)
    s, q = states(form), np.full((4, 1), -1.0)
    inputs = torch.tensor(s, requires_grad=True), torch.tensor(q, requires_grad=True)
    for one, other in zip(module(*inputs), model.learned(s, q), strict=True):
        assert np.allclose(one.detach().numpy(), other, rtol=0, atol=1e-10 * np.abs(other).max())
    assert torch.autograd.gradcheck(module, tuple(one[:1].detach().requires_grad_() for one in inputs), rtol=1e-6)


@pytest.mark.filterwarnings("ignore:.*torch.jit.load:DeprecationWarning")
def test_it_exports(tmp_path):
    import onnxruntime

    training = dataset(40, 1)
    model, arrays, _ = trained(training, SPEC.model_copy(update={"iterations": 5}))
    module, states = EnergyNet("displacement", model.rows, arrays), dataset(3, 2).delta_a
    expected = model.evaluate(states)
    meta = {**model.meta, "errors": {}, "dataset": {}}
    session = onnxruntime.InferenceSession(onnx_bytes(module, meta))
    found = session.run(None, {session.get_inputs()[0].name: states})
    path = tmp_path / "model.ts"
    path.write_bytes(torchscript_bytes(module, torch.tensor(states[:2])))
    traced = torch.jit.load(path)(torch.tensor(states))
    for one, two, reference in zip(found, traced, expected, strict=True):
        assert np.allclose(one, reference, rtol=0, atol=1e-10 * np.abs(reference).max())
        assert np.allclose(two.numpy(), reference, rtol=0, atol=1e-10 * np.abs(reference).max())


def test_equal_seeds_give_equal_networks_and_a_killed_fit_goes_on(tmp_path):
    training, spec = dataset(30, 1), SPEC.model_copy(update={"iterations": 6})
    arrays = [trained(training, one, folder)[1] for one, folder in ((spec, None), (spec, tmp_path), (spec, tmp_path))]
    other = trained(training, spec.model_copy(update={"seed": 1}))[1]
    assert len(list(tmp_path.iterdir())) == 3
    for name, value in arrays[0].items():
        assert np.array_equal(value, arrays[1][name]) and np.array_equal(value, arrays[2][name])
    assert not np.array_equal(arrays[0]["potential_weight_0"], other["potential_weight_0"])


@pytest.mark.parametrize("order", [0, 1, 2])
def test_derivatives_of_a_quadratic(order):
    rng = np.random.default_rng(0)
    coefficients, slopes = rng.standard_normal((10, 2 if order < 2 else 1)), rng.standard_normal((3, 2))
    parts = polynomial_parts(coefficients, slopes, order)

    def terms(s):
        """1, z_i, then z_i z_j, i <= j, of z = slopes s."""
        z = slopes @ s
        return np.concatenate([[1.0], z, np.outer(z, z)[np.triu_indices(len(z))]])

    s, h = rng.standard_normal(2), 1e-4
    q = coefficients.shape[1]
    value = lambda s: terms(s) @ coefficients  # noqa: E731
    assert np.allclose((terms(s) @ parts)[:q], value(s))
    steps = h * np.eye(2)
    if order >= 1:
        gradient = np.stack([(value(s + one) - value(s - one)) / (2 * h) for one in steps], axis=-1)
        assert np.allclose((terms(s) @ parts)[q : 3 * q], gradient.ravel(), atol=1e-7)
    if order == 2:
        second = [
            value(s + a + b) - value(s + a - b) - value(s - a + b) + value(s - a - b) for a in steps for b in steps
        ]
        hessian = np.ravel(second)[[0, 1, 3]] / (4 * h**2)
        assert np.allclose((terms(s) @ parts)[3:], hessian, atol=1e-5)
        assert parts.shape[1] == layout(2, 0)["hessian"].stop
