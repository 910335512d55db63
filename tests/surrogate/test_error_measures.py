"""Measures on cases which can be reckoned by hand."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.spatial.transform import Rotation
from surrogate.synthetic import dataset

from cfem.condensed import Rows
from cfem.predict.series.chebyshev import basis
from cfem.surrogate.error_measures import NEARLY_NONE, frame_loss, measure, of_loads, paper_loss, vectors


def test_a_perfect_prediction_has_no_error():
    test = dataset(30, 1)
    errors = measure(test, test.W, test.delta_free)
    assert errors["loss"] == 0
    assert errors["tip_mm"]["max"] < 1e-11 and errors["force_N"]["max"] < 1e-11


def test_predicting_the_mean_has_loss_one():
    test = dataset(50, 1)
    W, delta_free = (
        np.broadcast_to(test.W.mean(0), test.W.shape),
        np.broadcast_to(test.delta_free.mean(0), (50, 5)),
    )
    assert paper_loss(test.W, test.delta_free, W, delta_free)["loss"] == pytest.approx(1.0, rel=1e-12)


def test_constant_entries_are_left_out_and_counted():
    test = dataset(50, 1)
    test.W[:, 0, 1] = test.W[:, 1, 0] = 0.3 + 1e-13 * np.arange(50)
    wrong = test.W.copy()
    wrong[:, 0, 1] = wrong[:, 1, 0] = 7.0
    found = paper_loss(test.W, test.delta_free, wrong, test.delta_free)
    assert found == {"loss": 0.0, "entries": 19, "constant_entries": 1}


def test_the_frame_loss_of_a_turned_robot_is_the_same_and_that_of_the_mean_is_one():
    test = dataset(50, 1)
    rng = np.random.default_rng(0)
    noise = rng.standard_normal(test.W.shape)
    W, delta_free = test.W + noise + noise.transpose(0, 2, 1), test.delta_free + rng.standard_normal((50, 5))
    turn = block_diag(Rotation.from_euler("zyx", [37, -20, 65], degrees=True).as_matrix(), np.eye(2))
    turned = [
        turn @ one @ turn.T if one.ndim == 3 else one @ turn.T for one in (test.W, test.delta_free, W, delta_free)
    ]
    here = frame_loss(test.rows, test.W, test.delta_free, W, delta_free)
    assert here > 0 and frame_loss(test.rows, *turned) == pytest.approx(here, rel=1e-12)
    assert paper_loss(*turned)["loss"] != pytest.approx(here, rel=1e-2)
    mean = (np.broadcast_to(one.mean(0), one.shape) for one in (test.W, test.delta_free))
    assert frame_loss(test.rows, test.W, test.delta_free, *mean) == pytest.approx(1.0, rel=1e-12)


def test_legs_that_hardly_know_of_each_other_are_judged_by_their_own_compliance():
    """A robot of two legs, each as one that is known exactly; between them a little of noise, which no model has."""
    leg = dataset(50, 1)
    rows = Rows(("a.x", "a.y", "a.z", "b.x", "b.y", "b.z"), ("left", "right", "up", "down"))
    order = [0, 1, 2, 5, 6, 7, 3, 4, 8, 9]  # effectors of both legs first
    nothing, size = np.zeros_like(leg.W), np.sqrt(np.diagonal(leg.W, axis1=1, axis2=2).mean(axis=0))
    between = 1e-6 * np.outer(size, size) * np.random.default_rng(0).standard_normal(leg.W.shape)

    def both(leg_W, between):
        joined = np.block([[leg_W, between], [between.transpose(0, 2, 1), leg_W]])
        return joined[:, order][:, :, order]

    W, delta_free = both(leg.W, between), np.hstack([leg.delta_free, leg.delta_free])[:, order]
    assert frame_loss(rows, W, delta_free, both(leg.W, nothing), delta_free) < 1e-5
    off = frame_loss(leg.rows, leg.W, leg.delta_free, 1.1 * leg.W, leg.delta_free)
    wrong = frame_loss(rows, W, delta_free, both(1.1 * leg.W, nothing), delta_free)
    assert wrong == pytest.approx(off * 40 / 65, rel=1e-3)  # 20 entries of each leg, and 25 between them


def test_the_frame_loss_of_what_has_no_vectors_is_the_papers():
    test = dataset(50, 1)
    W = test.W + 0.1 * np.random.default_rng(0).standard_normal((50, 1, 1))
    rows = Rows(("skin.0", "skin.1", "skin.2"), test.rows.actuators)
    expected = paper_loss(test.W, test.delta_free, W, test.delta_free)["loss"]
    assert frame_loss(rows, test.W, test.delta_free, W, test.delta_free) == pytest.approx(expected, rel=1e-12)


def test_rows_that_turn_together():
    rows = Rows(("tip.x", "tip.y", "tip.z", "tip.rx", "tip.ry", "tip.rz", "skin.0"), ("left",), ("c.x", "c.y", "c.z"))
    assert vectors(rows) == [slice(0, 3), slice(3, 6), slice(6, 7), slice(7, 8), slice(8, 11)]


def test_a_shift_of_the_free_effector_is_the_tip_error():
    test = dataset(30, 1)
    delta_free = test.delta_free.copy()
    delta_free[:, :3] += [3.0, 0.0, 4.0]
    errors = measure(test, test.W, delta_free)
    assert errors["tip_mm"] == pytest.approx({"max": 5.0, "mean": 5.0, "rms": 5.0})
    assert errors["effectors_mm"]["tip"]["max"] == pytest.approx(5.0)
    assert errors["tip_percent_of_length"]["max"] == pytest.approx(500 / test.meta["length"])


def test_softer_actuators_err_in_force_by_the_same_share():
    test = dataset(30, 1)
    W = test.W.copy()
    W[:, 3:, 3:] *= 1.25
    errors = measure(test, W, test.delta_free)
    lambda_free = np.linalg.solve(test.W[:, 3:, 3:], (test.delta_a - test.delta_free[:, 3:])[..., None])[..., 0]
    assert errors["force_N"]["max"] == pytest.approx(0.2 * np.abs(lambda_free).max())


def test_states_beyond_buckling_are_counted_and_the_loss_of_the_others_is_told():
    test = replace(dataset(30, 1), n_c=1)
    test.W[:3, 3:, 3:] -= 2 * np.linalg.eigvalsh(test.W[:3, 3:, 3:]).max() * np.eye(2)
    wrong = test.W.copy()
    wrong[0] += 1.0
    errors = measure(test, wrong, test.delta_free)
    assert errors["buckled_states"] == 3 and errors["loss"] > 0 and errors["loss_of_stable"] == 0


def test_an_entry_of_w_errs_by_a_share_of_the_root_of_its_diagonal_entries():
    test = dataset(30, 1)
    W = test.W.copy()
    W[:, 0, 4] += 0.1 * np.sqrt(W[:, 0, 0] * W[:, 4, 4])
    n = W.shape[-1]
    expected = {"max": 10.0, "mean": 10.0 / n**2, "rms": 10.0 / n}
    assert measure(test, W, test.delta_free)["W_percent"] == pytest.approx(expected)


def test_an_entry_of_w_that_is_nothing_does_not_count():
    test = dataset(30, 1)
    test.W[:, 0], test.W[:, :, 0] = 0.0, 0.0
    assert measure(test, test.W, test.delta_free)["W_percent"] == {"max": 0.0, "mean": 0.0, "rms": 0.0}


def test_multipliers_err_by_a_share_of_the_largest_of_their_actuator():
    test = dataset(30, 1)
    delta_free = test.delta_free.copy()
    largest = np.abs(test.lambda_a).max(axis=0)
    delta_free[:, 3:] -= np.einsum("mij,j->mi", test.W[:, 3:, 3:], 0.02 * largest)
    expected = {"max": 2.0, "mean": 2.0, "rms": 2.0}
    assert measure(test, test.W, delta_free)["force_percent"] == pytest.approx(expected)


def test_derivatives_by_loads_err_more_where_a_model_extrapolates():
    """Of a model 1 % off where it extrapolates by 1, and by its square elsewhere; where there is nearly none of what is
    asked for, the error is relative to a share of what there is elsewhere."""
    z, indices = np.random.default_rng(0).uniform(-1, 1, size=(60, 2)), np.array([[0, 0], [1, 0], [0, 1]])
    series = np.random.default_rng(1).normal(size=(4, 3)) + [3.0, 0, 0]
    values, L = basis(z, indices) @ series.T, np.linspace(0.5, 2.0, 60)
    true = values / (1 + 0.01 * L**2)[:, None]
    arrays = {"third": series, "indices": indices}
    (bound,) = of_loads(SimpleNamespace(dC=true, d2C=None), arrays, z, L)["of_loads"].values()
    assert bound["factor"] == pytest.approx(0.01, rel=1e-6) and bound["power"] == pytest.approx(2.0, abs=1e-6)
    true[0] = 0.0
    largest = np.linalg.norm(values[0]) / (NEARLY_NONE * np.sqrt(np.mean(np.linalg.norm(true, axis=1) ** 2)))
    (bound,) = of_loads(SimpleNamespace(dC=true, d2C=None), arrays, z, np.ones(60))["of_loads"].values()
    assert largest > bound["everywhere"] == pytest.approx(0.01 * L[-2] ** 2)  # the 58th of 61
    assert of_loads(SimpleNamespace(dC=0 * true, d2C=None), arrays, z, L) == {}
