"""Torch modules equal the NumPy predictors and can be differentiated."""

from itertools import product

import numpy as np
import pytest
import torch
from support.fast_cases import fast_are
from surrogate.synthetic import dataset

from cfem.predict.load import build
from cfem.surrogate.modules import module_of
from cfem.surrogate.spec import MlpSpec, SpectralSpec
from cfem.surrogate.stage import model_inputs, train_and_judge
from cfem.surrogate.torch_model import spd_inverse

TINY = MlpSpec(kind="mlp", width=16, depth=2, epochs=2)


@pytest.mark.parametrize("n_a", fast_are({1, 3}, [1, 2, 3, 4]))
@pytest.mark.parametrize(("spec", "tolerance"), [(SpectralSpec(kind="spectral", max_degree=6), 1e-10), (TINY, 1e-5)])
def test_it_equals_numpy(n_a, spec, tolerance):
    training, test = dataset(40, 1, n_a, unilateral=False), dataset(10, 2, n_a, unilateral=False)
    meta, arrays, _ = train_and_judge(training, test, spec)
    expected = build(meta, arrays).evaluate(test.delta_a)
    with torch.no_grad():
        found = module_of(meta, arrays)(torch.as_tensor(test.delta_a))
    for one, other in zip(found, expected, strict=True):
        assert one.dtype == torch.float64
        assert np.allclose(one.numpy(), other, rtol=0, atol=tolerance * np.abs(other).max())


def test_gradients_reach_the_inputs():
    training = dataset(40, 1)
    meta, arrays, _ = train_and_judge(training, training, SpectralSpec(kind="spectral", max_degree=5))
    states = torch.tensor(training.delta_a[:2], requires_grad=True)
    assert torch.autograd.gradcheck(module_of(meta, arrays), (states,))


@pytest.mark.parametrize(
    "form, parameters",
    fast_are([("displacement", False), ("force", True)], product(["displacement", "force"], [False, True])),
)
def test_every_output_by_every_input_against_finite_differences(form, parameters):
    training = dataset(60, 1, parameters=parameters)
    spec = SpectralSpec(kind="spectral", form=form, max_degree=6)
    meta, arrays, _ = train_and_judge(training, training, spec)
    model, predictor = module_of(meta, arrays), build(meta, arrays)
    inputs = model_inputs(predictor, training)[: 1 + parameters]
    points = tuple(torch.tensor(one[:3], requires_grad=True) for one in inputs)
    assert torch.autograd.gradcheck(model, points, rtol=1e-6, atol=1e-9)
    for one, other in zip(model(*points), predictor.evaluate(*(one[:3] for one in inputs)), strict=True):
        assert np.allclose(one.detach().numpy(), other, rtol=1e-11, atol=1e-12)


@pytest.mark.parametrize("n", [1, 2, 3, 5])
def test_bordering_inverts(n):
    factor = torch.randn(6, n, n, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    matrix = factor @ factor.transpose(1, 2) + 0.1 * torch.eye(n, dtype=torch.float64)
    assert torch.allclose(spd_inverse(matrix), torch.linalg.inv(matrix), rtol=1e-10)
