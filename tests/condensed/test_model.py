import numpy as np
import pytest
from support.arc_robot import ArcRobot
from surrogate.synthetic import dataset, energy, rows_of

from cfem.condensed import Condensed
from cfem.condensed.model import under_force, with_dual, with_duals
from cfem.core.errors import NumericalError
from cfem.predict.load import build
from cfem.surrogate.model_card import model_card
from cfem.surrogate.series.spectral import fit


@pytest.mark.parametrize("where", [[0.0, 0.0], [3.0, 2.5], [12.0, 11.0], [19.0, 17.0]])
def test_equilibrium_is_where_the_forces_put_it(where):
    model = ArcRobot()
    there = model.at_displacement(np.array(where))
    model.queries = 0
    found = under_force(model, there.lambda_a, model.at_displacement(np.array([5.0, 5.0])))
    np.testing.assert_allclose(found.delta_a, where, atol=1e-10)
    assert model.queries <= 10


def test_a_warm_start_takes_a_few_queries():
    model = ArcRobot()
    there = model.at_displacement(np.array([6.3, 6.1]))
    near, model.queries = model.at_displacement(np.array([6.0, 6.0])), 0
    under_force(model, there.lambda_a, near)
    assert model.queries <= 4


def test_steps_beyond_what_the_model_knows_are_shortened():
    model = ArcRobot(limit=9.0)
    there = model.at_displacement(np.array([8.5, 8.4]))
    found = under_force(model, there.lambda_a, model.at_displacement(np.zeros(2)))
    np.testing.assert_allclose(found.delta_a, [8.5, 8.4], atol=1e-10)
    with pytest.raises(NumericalError, match="no state under"):
        under_force(model, 3 * there.lambda_a, there)


def test_a_state_that_the_model_refuses_costs_the_others_of_its_batch_nothing():
    """The first step of the second state ends beyond the limit, and so does the state of the third."""
    whole, model = ArcRobot(), ArcRobot(limit=8.55)
    there = [whole.at_displacement(np.array(where)) for where in ([3.0, 2.5], [8.5, 8.4], [12.0, 11.0])]
    wanted, rest = np.array([state.lambda_a for state in there]), whole.at_displacement(np.zeros(2))
    states, left = with_duals(
        lambda inputs, _: [model.at_displacement(row) for row in inputs], "displacement", wanted, [rest] * 3
    )
    np.testing.assert_allclose([state.delta_a for state in states[:2]], [[3.0, 2.5], [8.5, 8.4]], atol=1e-10)
    assert (left > 0).tolist() == [False, False, True]


def test_a_first_step_too_far_is_shortened():
    """The robot grows stiffer: Newton's first step from rest ends beyond the state, and beyond what the model knows."""
    there = ArcRobot().at_displacement(np.array([8.5, 8.4]))
    rest = ArcRobot().at_displacement(np.zeros(2))
    assert (rest.W_aa @ there.lambda_a).max() > 8.55
    found = under_force(ArcRobot(limit=8.55), there.lambda_a, rest)
    np.testing.assert_allclose(found.delta_a, [8.5, 8.4], atol=1e-10)


def test_a_model_of_the_forces_is_asked_once():
    class ByForce:
        form = "force"

        def at_force(self, lambda_a):
            return ("state under", lambda_a)

    assert under_force(ByForce(), 1.0, None) == ("state under", 1.0)


def test_a_learned_energy_inverts_its_own_forces():
    training = dataset(60, 1)
    model = build(model_card("spectral", training), fit(training).arrays)
    for delta_a in dataset(5, 7).delta_a:
        lambda_a = model.at_displacement(delta_a).lambda_a
        near = model.at_displacement(0.8 * delta_a)
        np.testing.assert_allclose(under_force(model, lambda_a, near).delta_a, delta_a, atol=1e-10)


def robot_of(delta_a, gradient, hessian):
    """State of a robot of an energy with this gradient and Hessian, whose effectors do not move."""
    rows, n_a = rows_of(len(delta_a)), len(delta_a)
    W, free = np.zeros((rows.n, rows.n)), np.zeros(rows.n)
    W[rows.a, rows.a] = np.linalg.inv(hessian)
    free[rows.a] = delta_a - W[rows.a, rows.a] @ gradient
    return Condensed(rows, W, free, gradient[:n_a])


@pytest.mark.parametrize("delta_a", np.random.default_rng(0).uniform(4.0, 14.0, (20, 2)))
def test_forces_of_an_energy_are_found_from_a_poor_start(delta_a):
    def evaluate(s):
        _, gradient, hessian = energy(s[None])
        return robot_of(s, gradient[0], hessian[0])

    found = with_dual(evaluate, "displacement", energy(delta_a[None])[1][0], evaluate(np.array([9.0, 9.0])))
    np.testing.assert_allclose(found.delta_a, delta_a, atol=1e-9)


def test_what_cannot_be_found_says_how_much_is_missing():
    """Forces s / sqrt(1 + s^2) stay below 1 N."""

    def evaluate(s):
        return robot_of(s, s / np.sqrt(1 + s**2), np.diag((1 + s**2) ** -1.5))

    with pytest.raises(NumericalError, match=r"under the forces \[2\.0\] N: 1(\.\d)? N are left"):
        with_dual(evaluate, "displacement", np.array([2.0]), evaluate(np.zeros(1)))


def test_a_search_that_stalls_counts_as_found_within_the_rounding_alone():
    """Displacements are known in steps of 1e-6 mm, as where other iterations make the state."""

    def evaluate(s):
        return robot_of(s, np.round(s, 6), np.eye(1))

    force, near = np.array([1.2345678]), evaluate(np.zeros(1))
    np.testing.assert_allclose(with_dual(evaluate, "displacement", force, near).delta_a, force, atol=1e-6)
    with pytest.raises(NumericalError, match="are left"):
        with_dual(evaluate, "displacement", force, near, rounding=1e-8)
