"""Modules in a row under loads: derivatives against differences, and the unloaded row (FE: surrogate/test_serial)."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from support.serial_rows import CENTRE, DELTA, REST, WRENCH, chain, series

from cfem.condensed.packing import unpacking
from cfem.core.errors import InputError, NumericalError
from cfem.predict.load import build
from cfem.predict.loads.loaded import loaded
from cfem.predict.loads.wrench_series import NEAR, STIFF, Held, softening
from cfem.predict.rows.loaded_serial import STATES, row_of
from cfem.predict.series.energy import layout


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


def test_the_size_of_a_row_is_that_of_its_largest_module_at_end_and_centre_of_mass():
    """A module has six coordinates of its end before the three of its centre of mass; those of turning are none."""
    row = chain(np.zeros(6), heavy=True)
    first, second = np.arange(9.0), np.full(9, 3.5)
    row.models = [SimpleNamespace(sizes=sizes) for sizes in (first, second)]
    np.testing.assert_array_equal(row._sizes, [3.5, 3.5, 3.5, 6, 7, 8])
    row.models[0].sizes = None
    assert row._sizes is None


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


@pytest.mark.parametrize("curved", [False, True])
def test_jacobian_and_stiffness_against_differences(curved):
    model, h = chain(WRENCH, curved=curved), 1e-5
    here = model.at(DELTA)
    for n, step in enumerate(h * np.eye(len(DELTA))):
        ahead, behind = (model.at(DELTA + sign * step) for sign in (1, -1))
        column = (ahead.lam - behind.lam) / (2 * h)
        assert np.allclose(np.linalg.inv(here.W_aa)[:, n], column, atol=1e-6)
        assert np.allclose(here.effector_jacobian[:, n], (ahead.delta_e - behind.delta_e) / (2 * h), atol=1e-6)


@pytest.mark.parametrize("curved", [False, True])
def test_compliance_and_work_against_one_more_force(curved):
    """d lambda / dw = -(dy / d delta)^T (Maxwell and Betti), on the tip and on the centre of mass."""
    h = 1e-6
    here = chain(WRENCH, curved=curved).at(DELTA)
    locked = here.W[:6, :6] - here.effector_jacobian @ here.W_aa @ here.effector_jacobian.T
    for axis, more in enumerate(h * np.eye(6)):
        ahead, behind = (chain(WRENCH + sign * more, curved=curved).at(DELTA) for sign in (1, -1))
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


def test_the_stated_error_is_of_third_order_and_of_what_the_models_are_off():
    """And it is of the state that is asked."""
    small, large = (chain(share * WRENCH).error_at(DELTA) for share in (0.01, 0.02))
    assert large / small == pytest.approx(8.0, rel=0.1)
    curved = [chain(share * WRENCH, curved=True) for share in (0.01, 0.02)]
    least, more = (one.error_at(DELTA) for one in curved)
    assert more / least == pytest.approx(16.0, rel=0.1)
    curved[0].models[0].meta["errors"] = {"of_loads": {"d2C": {"everywhere": 2.0, "factor": 2.0, "power": 0.0}}}
    assert curved[0].error_at(DELTA) > 1.5 * least
    rough = chain(0.01 * WRENCH)
    for one in rough.models:
        one.meta["errors"] = {"frame_loss": 1e-4}
    bare = chain().at(DELTA).delta_e
    moved = np.linalg.norm((chain(0.01 * WRENCH).at(DELTA).delta_e - bare)[:3])
    assert 0.02 * moved < rough.error_at(DELTA) - small < 0.2 * moved
    assert rough.error_at(DELTA) != rough.error_at(-DELTA)
    both = rough.load_error(np.array([[DELTA, -DELTA]]))
    assert both.tolist() == [[rough.error_at(DELTA), rough.error_at(-DELTA)]] and rough.load_error(DELTA) == both[0, 0]


def test_the_series_here_are_definite():
    for heavy, n_e in ((False, 6), (True, 9)):
        packed = series(heavy)["series"][layout(2, n_e)["effector_compliance"], 0]
        assert np.linalg.eigvalsh(packed[unpacking(n_e)])[0] > 0


@pytest.mark.parametrize("wrench", [None, WRENCH])
def test_without_the_skin_of_a_module_there_is_no_shape(wrench):
    with pytest.raises(InputError, match=r"has no skin.*train each module's model on samples with `skin"):
        chain(wrench).shape(DELTA)


COMPLIANCE, CRITICAL = 5.0, 0.8  # mm/N, N


def column(along):
    """A module without actuators that a force along x makes softer across, as a column does."""
    C, D = np.zeros((1, 2, 2)), np.zeros((1, 2, 2, 2))
    C[0, 1, 1] = COMPLIANCE
    D[0, 0, 1, 1] = D[0, 1, 0, 1] = D[0, 1, 1, 0] = COMPLIANCE / CRITICAL
    return Held(np.zeros(1), np.zeros((1, 2)), C, D, 0).under(np.array([along, 0.03]))


@pytest.mark.parametrize("share", [-2.0, 0.1, 0.5])
def test_a_column_is_known_up_to_half_of_what_buckles_it(share):
    """e_y = C w_y / (1 - w_x / w_c), and e_x by reciprocity."""
    found, softer = column(share * CRITICAL), 1 / (1 - share)
    assert found.ratio == pytest.approx(share)
    assert found.e[1] == pytest.approx(COMPLIANCE * 0.03 * softer, rel=1e-12)
    assert found.e[0] == pytest.approx(COMPLIANCE * 0.03**2 * softer**2 / (2 * CRITICAL), rel=1e-12)
    assert found.C[1, 1] == pytest.approx(COMPLIANCE * softer, rel=1e-12)


def test_its_softening_goes_on_smoothly_where_it_is_not_believed():
    h = 1e-5
    for r in (-4.0, STIFF, -1.0, 0.3, NEAR, 0.9, 3.0):
        ahead, behind = softening(r + h), softening(r - h)
        for order in (0, 1):
            tolerance = 30 * h if r in (NEAR, STIFF) else 1e-7  # its third derivative jumps there
            assert (ahead[order] - behind[order]) / (2 * h) == pytest.approx(softening(r)[order + 1], abs=tolerance)


@pytest.mark.parametrize("curved", [False, True])
@pytest.mark.parametrize(("changing", "believed"), [(1, True), (300, True), (1000, False)])
def test_a_module_under_a_wrench_is_of_one_energy(changing, believed, curved):
    """Pose and forces are derivatives of one function of wrench and actuators, also beyond where it is believed."""
    series, h = chain(WRENCH, curved=curved)._series[0], 1e-6
    at, w = DELTA[:2], np.array([0.05, -0.04, 0.06, 0.3, -0.5, 0.2, 0.02, -0.03, -0.05])

    def under(s, w):
        held = series.at(s)
        return replace(held, D=changing * held.D).under(w)

    here = under(at, w)
    if not curved:
        assert (here.ratio <= NEAR) == believed
    for n, step in enumerate(h * np.eye(9)):
        ahead, behind = (under(at, w + sign * step) for sign in (1, -1))
        assert np.allclose(here.C[:, n], (ahead.e - behind.e) / (2 * h), rtol=1e-6, atol=1e-6)
        assert np.allclose(-here.G[n], (ahead.lam - behind.lam) / (2 * h), rtol=1e-6, atol=1e-6)
    for n, step in enumerate(h * np.eye(2)):
        ahead, behind = (under(at + sign * step, w) for sign in (1, -1))
        assert np.allclose(here.G[:, n], (ahead.e - behind.e) / (2 * h), rtol=1e-6, atol=1e-6)
        assert np.allclose(here.K[:, n], (ahead.lam - behind.lam) / (2 * h), rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize(
    ("lam", "expected"),
    [
        ([[1, -5], [0, 1], [-1e-9, 1], [2, -1]], 4.0),  # the third would push
        ([[-1, 1], [-2, 1], [-3, 1], [-4, 1]], 4.0),  # all would: the worst of all
        ([[1, 1], [0, 1], [-1, 1], [-1, 1]], 2.0),
        ([[-1, 1], [-1, 1], [5, 1], [-1, 1]], 3.0),
    ],
)
def test_the_stated_error_leaves_out_states_in_which_what_only_pulled_would_push(lam, expected):
    """In training the first actuator never pushed, at 0 N neither, and the second did."""
    model = chain(WRENCH)
    states = np.array([[0.1, 0, 0, -1], [0.2, 0, 3, 2], [0.3, 0, 1, 1], [0.4, 0, 2, 1]], float)
    known = {round(state[0], 1): (i + 1.0, np.array(lam[i], float)) for i, state in enumerate(states)}
    model.rows, model.domain = SimpleNamespace(n_a=2), SimpleNamespace(states=states)
    model.error_at = lambda state: known[round(state[0], 1)][0]
    model.at = lambda state: SimpleNamespace(lam=known[round(state[0], 1)][1])
    assert model.wrench_error() == expected


def test_the_stated_error_is_of_some_states_spread_over_all():
    model, asked = chain(WRENCH), []
    model.rows = SimpleNamespace(n_a=1)
    model.domain = SimpleNamespace(states=np.column_stack([np.arange(3 * STATES + 2.0), np.ones(3 * STATES + 2)]))
    model.error_at = lambda state: asked.append(float(state[0])) or 1.0
    model.at = lambda state: SimpleNamespace(lam=np.ones(1))
    assert model.wrench_error() == 1.0
    assert asked == list(range(0, 3 * STATES + 2, 3))
