"""Modules in a row under loads: derivatives against differences, and the unloaded row (FE: surrogate/test_serial)."""

import numpy as np
import pytest

from cfem.core.errors import InputError, NumericalError
from cfem.predict.energy import layout, unpacking
from cfem.predict.loaded_serial import LoadedSerialPredictor, row_of
from cfem.predict.serial import SerialPredictor
from cfem.predict.series import differentiated
from cfem.surrogate.chebyshev import index_set

AXES = ("x", "y", "z", "rx", "ry", "rz")
REST = np.array([0.0, 0.0, 40.0])


def series(n_a=2):
    """Coefficients of a module that bends about x and y as its two actuators go, positive definite all over."""
    indices, _ = index_set(np.ones(n_a), 1000, 3)
    rng = np.random.default_rng(0)
    psi, e = 0.02 * rng.normal(size=(len(indices), 1)), 0.02 * rng.normal(size=(len(indices), 6))
    C = 1e-3 * rng.normal(size=(len(indices), 21))
    degree = indices.sum(axis=1)
    psi[(degree == 2) & (indices.max(axis=1) == 2)] += 3.0
    C[degree == 0] += np.diag([8.0, 8, 0.5, 0.01, 0.01, 0.005])[np.triu_indices(6)]
    e[degree == 1] += np.array([[3.0, 0, 0.1, 0, 0.2, 0], [0, 3.0, 0.1, -0.2, 0, 0.05]])
    to_box = np.eye(n_a) / 4
    return {
        "indices": indices,
        "to_box": to_box,
        "offset": np.zeros(n_a),
        "series": differentiated(indices, to_box, n_a, psi, e, C),
    }


def meta(rows, rest, length, softer=None):
    n_a = len(rows["actuators"])
    found = {
        "kind": "spectral",
        "scene": "row",
        "form": "displacement",
        "rows": rows,
        "row_units": [["mm", "N"]] * (len(rows["effectors"]) + n_a),
        "parameters": [],
        "rest_e": rest,
        "reach": [[-3, 3]] * n_a,
        "length": length,
        "domain": {
            "delta_a": [[-4] * n_a, [4] * n_a],
            "lambda_a": [[-4] * n_a, [4] * n_a],
            "p": [[], []],
            "states": [[0] * 2 * n_a],
        },
    }
    return found if softer is None else {**found, "kind": "serial", "softer": softer}


def chain(forces=None, softer=(1.0, 1.5, 0.8)):
    rows = {"effectors": tuple(f"end.{axis}" for axis in AXES), "actuators": ("a", "b")}
    module = meta(rows, [*REST, 0, 0, 0], 40.0)
    k = len(softer)
    whole = {"effectors": ("tip.x", "tip.y", "tip.z"), "actuators": tuple(f"a{i}" for i in range(2 * k))}
    card = {**meta(whole, (k * REST).tolist(), 40.0 * k, list(softer)), "module": module}
    return SerialPredictor(card, series()) if forces is None else LoadedSerialPredictor(card, series(), forces)


FORCES = np.array([[0.02, 0, -0.03], [0.0, 0.01, 0], [0.05, -0.04, 0.06]])
DELTA = np.array([1.0, -0.5, 0.3, 1.2, -1.0, 0.8])


def test_the_ends_and_their_derivatives_against_differences():
    rng, h = np.random.default_rng(1), 1e-5
    e = rng.normal(size=(3, 6))
    row = row_of(e, REST)
    for n in range(18):
        step = h * np.eye(18)[n].reshape(3, 6)
        ahead, behind = row_of(e + step, REST), row_of(e - step, REST)
        assert np.allclose(row.B[:, :, n], (ahead.P - behind.P)[1:] / (2 * h), atol=1e-7)
        assert np.allclose(row.H[:, :, n], (ahead.B - behind.B) / (2 * h), atol=1e-6)


def test_without_forces_it_is_the_unloaded_row():
    W, free = chain(np.zeros((3, 3))).learned(DELTA, DELTA[:0])
    expected_W, expected_free = chain().learned(DELTA, DELTA[:0])
    assert np.allclose(W, expected_W, rtol=1e-10, atol=1e-12)
    assert np.allclose(free, expected_free, rtol=1e-10, atol=1e-10)


def test_jacobian_and_stiffness_against_differences():
    model, h = chain(FORCES), 1e-5
    here = model.at(DELTA)
    for n in range(6):
        ahead, behind = (model.at(DELTA + sign * h * np.eye(6)[n]) for sign in (1, -1))
        column = (ahead.lam - behind.lam) / (2 * h)
        assert np.allclose(np.linalg.inv(here.W_aa)[:, n], column, atol=1e-6)
        assert np.allclose(here.effector_jacobian[:, n], (ahead.delta_e - behind.delta_e) / (2 * h), atol=1e-6)


def test_compliance_against_one_more_force_at_the_tip():
    h = 1e-6
    here = chain(FORCES).at(DELTA)
    locked = here.W[:3, :3] - here.effector_jacobian @ here.W_aa @ here.effector_jacobian.T
    for axis in range(3):
        more = np.zeros((3, 3))
        more[2, axis] = h
        ahead, behind = (chain(FORCES + sign * more).at(DELTA) for sign in (1, -1))
        assert np.allclose(locked[:, axis], (ahead.delta_e - behind.delta_e) / (2 * h), rtol=1e-6, atol=1e-6)


def test_the_work_of_the_load_is_that_of_the_actuators():
    """d lambda / dF = -(dy / d delta)^T (Maxwell and Betti)."""
    h, more = 1e-6, np.zeros((3, 3))
    more[2, 0] = h
    ahead, behind = (chain(FORCES + sign * more).at(DELTA) for sign in (1, -1))
    assert np.allclose((ahead.lam - behind.lam) / (2 * h), -chain(FORCES).at(DELTA).effector_jacobian[0], atol=1e-6)


def test_a_batch_is_its_states():
    model = chain(FORCES)
    both = model.learned(np.array([DELTA, -DELTA]), np.zeros((2, 0)))
    for one, delta in enumerate((DELTA, -DELTA)):
        for found, expected in zip(both, model.learned(delta, delta[:0]), strict=True):
            assert np.array_equal(found[one], expected)


def test_a_load_that_the_row_cannot_carry_is_an_error():
    with pytest.raises(NumericalError, match="no equilibrium under these loads"):
        chain(1e3 * FORCES).at(DELTA)


@pytest.mark.parametrize("forces", [np.zeros((2, 3)), np.full((3, 3), np.nan)])
def test_forces_are_one_for_each_module(forces):
    with pytest.raises(InputError, match="3 modules"):
        chain(forces)


def test_the_series_here_is_definite():
    packed = series()["series"][layout(2, 6)["effector_compliance"], 0]
    assert np.linalg.eigvalsh(packed[unpacking(6)])[0] > 0


@pytest.mark.parametrize("forces", [None, FORCES])
def test_without_the_skin_of_a_module_there_is_no_shape(forces):
    with pytest.raises(InputError, match=r"has no skin.*train the module's model on samples with `skin"):
        chain(forces).shape(DELTA)
