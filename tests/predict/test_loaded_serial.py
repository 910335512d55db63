"""Modules in a row under loads: derivatives against differences, and the unloaded row (FE: surrogate/test_serial)."""

import numpy as np
import pytest

from cfem.core.errors import InputError, NumericalError
from cfem.predict.energy import layout, unpacking
from cfem.predict.load import build
from cfem.predict.loaded import loaded
from cfem.predict.loaded_serial import row_of
from cfem.predict.serial import joined
from cfem.predict.series import differentiated
from cfem.surrogate.chebyshev import index_set

AXES = ("x", "y", "z", "rx", "ry", "rz")
REST = np.array([0.0, 0.0, 40.0])
CENTRE = np.array([1.0, 0.0, 21.0])


def series(heavy, seed=0, n_a=2):
    """Coefficients of a module that bends about x and y as its actuators go, positive definite all over."""
    indices, _ = index_set(np.ones(n_a), 1000, 3)
    rng, n_e = np.random.default_rng(seed), 9 if heavy else 6
    psi, e = 0.02 * rng.normal(size=(len(indices), 1)), 0.02 * rng.normal(size=(len(indices), n_e))
    C = 1e-3 * rng.normal(size=(len(indices), n_e * (n_e + 1) // 2))
    degree = indices.sum(axis=1)
    psi[(degree == 2) & (indices.max(axis=1) == 2)] += 3.0
    C[degree == 0] += np.diag([8.0, 8, 0.5, 0.01, 0.01, 0.005, 2, 2, 0.2][:n_e])[np.triu_indices(n_e)]
    bends = np.array([[3.0, 0, 0.1, 0, 0.2, 0, 1, 0, 0], [0, 3.0, 0.1, -0.2, 0, 0.05, 0, 1, 0]])
    e[degree == 1] += bends[np.arange(n_a) % 2, :n_e]
    to_box = np.eye(n_a) / 4
    D = 1e-4 * rng.normal(size=(n_e * (n_e + 1) * (n_e + 2) // 6, len(indices)))
    return {
        "indices": indices,
        "to_box": to_box,
        "offset": np.zeros(n_a),
        "series": differentiated(indices, to_box, n_a, psi, e, C),
        "third": D,
    }


def card(effectors, n_a, rest, **more):
    return {
        "kind": "spectral",
        "scene": "row",
        "form": "displacement",
        "rows": {"effectors": effectors, "actuators": tuple(f"a{i}" for i in range(n_a))},
        "row_units": [["mm", "N"]] * (len(effectors) + n_a),
        "parameters": [],
        "rest_e": list(rest),
        "reach": [[-3, 3]] * n_a,
        "length": float(rest[2]),
        "domain": {
            "delta_a": [[-4] * n_a, [4] * n_a],
            "lambda_a": [[-4] * n_a, [4] * n_a],
            "p": [[], []],
            "states": [[0] * 2 * n_a],
        },
        **more,
    }


def chain(wrench=None, softer=(1.0, 1.5, 0.8), heavy=True, mixed=True):
    """Three modules: the middle one is another, of three actuators and another mass, where they are mixed."""
    axes = [f"end.{axis}" for axis in AXES] + [f"body.{axis}" for axis in "xyz"] * heavy
    rest = [*REST, 0, 0, 0, *CENTRE][: len(axes)]
    modules = [card(axes, 2, rest, masses={"body": 2e-6}), card(axes, 3, rest, masses={"body": 1e-6})][: 1 + mixed]
    k, which = len(softer), [i % 2 if mixed else 0 for i in range(len(softer))]
    shares = np.array([modules[one]["masses"]["body"] for one in which])
    centre = shares @ (CENTRE + np.arange(k)[:, None] * REST) / shares.sum()
    tip = [f"tip.{axis}" for axis in "xyz"] + [f"body.{axis}" for axis in "xyz"] * heavy
    n_a = sum(len(modules[one]["rows"]["actuators"]) for one in which)
    row = [{"model": one, "softer": soft} for one, soft in zip(which, softer, strict=True)]
    meta = card(tip, n_a, [*(k * REST), *centre][: len(tip)], modules=modules, row=row)
    meta |= {"kind": "serial"} | ({} if wrench is None else {"wrench": np.asarray(wrench)[: len(tip)].tolist()})
    return build(meta, joined([series(heavy), series(heavy, 7, 3)][: 1 + mixed]))


WRENCH = np.array([0.05, -0.04, 0.06, 0.02, -0.03, -0.05])
DELTA = np.array([1.0, -0.5, 0.3, 1.2, -0.6, -1.0, 0.8])


@pytest.mark.parametrize("shares", [None, np.array([0.2, 0.5, 0.3])])
def test_the_effectors_and_their_derivatives_against_differences(shares):
    rng, h, p = np.random.default_rng(1), 1e-5, 6 if shares is None else 9
    e, rests = rng.normal(size=(3, p)), np.tile([*REST, 0, 0, 0, *CENTRE][:p], (3, 1))
    row = row_of(e, rests, shares)
    for n in range(3 * p):
        step = h * np.eye(3 * p)[n].reshape(3, p)
        ahead, behind = row_of(e + step, rests, shares), row_of(e - step, rests, shares)
        assert np.allclose(row.B[:, n], (ahead.y - behind.y) / (2 * h), atol=1e-7)
        assert np.allclose(row.H[:, :, n], (ahead.B - behind.B) / (2 * h), atol=1e-6)


@pytest.mark.parametrize("mixed", [False, True])
@pytest.mark.parametrize("heavy", [False, True])
def test_without_forces_it_is_the_unloaded_row(heavy, mixed):
    """Whose derivatives are those of differences: two ways to one row."""
    bare, h = chain(heavy=heavy, mixed=mixed), 1e-5
    at = DELTA[: bare.rows.n_a]
    W, free = chain(np.zeros(6), heavy=heavy, mixed=mixed).learned(at, at[:0])
    expected_W, expected_free = bare.learned(at, at[:0])
    assert np.allclose(W, expected_W, rtol=1e-10, atol=1e-12)
    assert np.allclose(free, expected_free, rtol=1e-10, atol=1e-10)
    here = bare.at(at)
    for n, step in enumerate(h * np.eye(len(at))):
        moved = (bare.at(at + step).delta_e - bare.at(at - step).delta_e) / (2 * h)
        assert np.allclose(here.effector_jacobian[:, n], moved, atol=1e-6)


def test_jacobian_and_stiffness_against_differences():
    model, h = chain(WRENCH), 1e-5
    here = model.at(DELTA)
    for n, step in enumerate(h * np.eye(len(DELTA))):
        ahead, behind = (model.at(DELTA + sign * step) for sign in (1, -1))
        column = (ahead.lam - behind.lam) / (2 * h)
        assert np.allclose(np.linalg.inv(here.W_aa)[:, n], column, atol=1e-6)
        assert np.allclose(here.effector_jacobian[:, n], (ahead.delta_e - behind.delta_e) / (2 * h), atol=1e-6)


def test_compliance_and_work_against_one_more_force():
    """d lambda / dw = -(dy / d delta)^T (Maxwell and Betti), on the tip and on the centre of mass."""
    h = 1e-6
    here = chain(WRENCH).at(DELTA)
    locked = here.W[:6, :6] - here.effector_jacobian @ here.W_aa @ here.effector_jacobian.T
    for axis, more in enumerate(h * np.eye(6)):
        ahead, behind = (chain(WRENCH + sign * more).at(DELTA) for sign in (1, -1))
        assert np.allclose(locked[:, axis], (ahead.delta_e - behind.delta_e) / (2 * h), rtol=1e-6, atol=1e-6)
        assert np.allclose((ahead.lam - behind.lam) / (2 * h), -here.effector_jacobian[axis], atol=1e-6)


def test_a_batch_is_its_states():
    model = chain(WRENCH)
    both = model.learned(np.array([DELTA, -DELTA]), np.zeros((2, 0)))
    for one, delta in enumerate((DELTA, -DELTA)):
        for found, expected in zip(both, model.learned(delta, delta[:0]), strict=True):
            assert np.array_equal(found[one], expected)


def test_a_load_that_the_row_cannot_carry_is_an_error():
    with pytest.raises(NumericalError, match="no equilibrium under these loads"):
        chain(1e3 * WRENCH).at(DELTA)


def test_a_load_beyond_the_domain_of_trust_is_refused():
    carrying = loaded(chain(), 0.02 * WRENCH)
    assert 0 < carrying.meta["wrench_error"] < 0.005 * carrying.length
    model = chain()
    without = {name: one for name, one in model.arrays.items() if not name.endswith(".third")}
    with pytest.raises(InputError, match=r"take at most .* of them"):
        loaded(build(model.meta, without), 2 * WRENCH)
    with pytest.raises(InputError, match="6 finite numbers"):
        loaded(chain(), np.full(6, np.nan))


def test_the_series_here_are_definite():
    for heavy, n_e in ((False, 6), (True, 9)):
        packed = series(heavy)["series"][layout(2, n_e)["effector_compliance"], 0]
        assert np.linalg.eigvalsh(packed[unpacking(n_e)])[0] > 0


@pytest.mark.parametrize("wrench", [None, WRENCH])
def test_without_the_skin_of_a_module_there_is_no_shape(wrench):
    with pytest.raises(InputError, match=r"has no skin.*train each module's model on samples with `skin"):
        chain(wrench).shape(DELTA)
