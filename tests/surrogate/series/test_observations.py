"""Derivatives that samples state are those of the quantities themselves, in both forms and in any coordinates."""

from dataclasses import replace
from itertools import cycle, product

import numpy as np
import pytest
from support.fast_cases import fast_are
from surrogate.synthetic import dataset

from cfem.predict.series.energy import FORMS
from cfem.surrogate.series.chebyshev import design_rows
from cfem.surrogate.series.coordinates import box_coordinates
from cfem.surrogate.series.observations import Observations, in_box, inputs, observations
from cfem.surrogate.series.spectral import fit_quantity

QUANTITIES = ["potential", "effector", "effector_compliance"]


@pytest.mark.parametrize(
    "quantity, form, parameters",
    fast_are(zip(QUANTITIES, cycle(FORMS), cycle([True, False])), product(QUANTITIES, FORMS, [False, True])),
)
def test_derivatives_are_those_of_a_series_fitted_to_values_alone(quantity, form, parameters):
    states = dataset(400, 1, third_order=True, parameters=parameters)
    s, q = inputs(states, form)
    to_box, offset = box_coordinates(s, q, np.array([[2.0, 1.0], [1.0, 3.0]]))
    z = np.hstack([s, q]) @ to_box.T + offset
    observed = in_box(observations(states, form)[quantity], to_box)
    alone = Observations(((),), observed.values[:, :1], 2)
    series, _, records = fit_quantity(z, alone, 20, 300, 5)
    error = min(record["error"] for record in records)
    found = design_rows(z, series.indices, observed.derivatives) @ series.coefficients
    orders = np.array([len(one) for one in observed.derivatives])
    assert orders.max() == {"potential": 3, "effector": 2, "effector_compliance": 1}[quantity]
    middle = (np.abs(z) < 0.7).all(axis=1)  # differentiation magnifies the error of the series towards the ends
    for order in range(orders.max() + 1):
        off = (found - observed.values)[middle][:, orders == order]
        assert (
            np.abs(off).max() < 1e4 * 10**order * max(error, 1e-14) * np.abs(observed.values[:, orders == order]).max()
        )
    assert error < 1e-2


def test_orders_weigh_alike_and_parameters_on_their_own():
    states = dataset(50, 1, third_order=True, parameters=True)
    observed = observations(states, "displacement")["potential"]
    values, divisors = observed.scaled()
    for group in ([()], [(0,), (1,)], [(0, 0), (0, 1), (1, 1)], [(2,)]):
        members = [observed.derivatives.index(one) for one in group]
        assert values[:, members].std(axis=0).max() == pytest.approx(1.0)
        assert len(set(divisors[members])) == 1


def test_a_small_force_of_an_unlike_actuator_is_fitted_as_well_as_a_large_one():
    """Energy of a chamber with a kink in its stiffness, and a hundredth of it that of a cable beside it."""
    z = np.random.default_rng(0).uniform(-1, 1, (60, 2))

    def observed(z, unlike):
        x, y = z.T
        soft, kink = np.log(np.cosh(20 * x)) / 20, np.tanh(20 * x)
        values = [
            50 * x**2 + 10 * x * soft + y**2 * (1 + x / 3),
            100 * x + 10 * (soft + x * kink) + y**2 / 3,
            2 * y * (1 + x / 3),
        ]
        return Observations(((), (0,), (1,)), np.stack(values, axis=1)[..., None], 2, unlike)

    unseen = np.random.default_rng(1).uniform(-1, 1, (200, 2))
    off = []
    for unlike in (False, True):
        series, _, _ = fit_quantity(z, observed(z, unlike), 16, 300, 5)
        found = design_rows(unseen, series.indices, ((1,),)) @ series.coefficients
        off.append(np.abs(found - observed(unseen, unlike).values[:, 2:]).max())
    assert off[1] < off[0] / 3


def test_unlike_actuators_weigh_by_their_own_size():
    known = dataset(50, 1, third_order=True)
    alike = observations(known, "displacement")["potential"]
    scaled = replace(known, meta={**known.meta, "units": {"delta_a": ["mm^3", "mm"]}})
    unlike = {name: part.unlike for name, part in observations(scaled, "displacement").items()}
    assert not alike.unlike and unlike == {"potential": True, "effector": False, "effector_compliance": False}
    shrunk = replace(
        alike, values=alike.values * np.array([1e-3 ** axes.count(1) for axes in alike.derivatives])[:, None]
    )
    values, _ = replace(shrunk, unlike=True).scaled()
    first = [shrunk.derivatives.index(axes) for axes in ((0,), (1,))]
    assert values[:, first].std(axis=0).ravel() == pytest.approx([1.0, 1.0])
    again, _ = replace(alike, unlike=True).scaled()
    assert values[:, first] == pytest.approx(again[:, first])


def test_the_dual_potential_is_legendres():
    states = dataset(20, 1)
    psi = observations(states, "displacement")["potential"].values[:, 0, 0]
    dual = observations(states, "force")["potential"].values[:, 0, 0]
    assert np.allclose(psi + dual, (states.lambda_a * states.delta_a).sum(axis=1))


def test_without_third_order_there_is_none():
    known = observations(replace(dataset(10, 1)), "force")
    assert [max(map(len, one.derivatives)) for one in known.values()] == [2, 1, 0]


def test_an_order_that_is_rounding_has_no_weight():
    """Effectors that no parameter moves: what finite elements round is not fitted as if it were a derivative."""
    states = dataset(50, 1, parameters=True)
    noise = 1e-12 * np.random.default_rng(0).normal(size=states.ddelta_e_dp.shape)
    observed = observations(replace(states, ddelta_e_dp=noise), "displacement")["effector"]
    values, _ = observed.scaled()
    assert np.abs(values[:, observed.derivatives.index((2,))]).max() < 1e-3
