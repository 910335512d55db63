"""The transition of the moving robot's filter: its mean against the motion under the same forces, its covariance
against finite differences of that mean."""

import numpy as np
import pytest

import cfem.motion.estimation.transition as transition
from cfem.motion.altered import Altered
from cfem.motion.estimation.transition import MovingState, Transition
from cfem.motion.estimation.uncertainty import MotionUncertainty
from cfem.motion.load import load_motion
from cfem.motion.step import MotionCommand, at_rest, step
from cfem.predict.estimation.estimate import Estimator
from cfem.predict.estimation.kalman import Gaussian
from cfem.predict.estimation.markers import markers_near
from cfem.predict.load import load_model

TIP, DT, LARGEST, LASTS = ("tip.x", "tip.y", "tip.z"), 2e-3, 0.01, 0.05
KINDS = ["displacement", "force"]
LOADS, LOG = np.array([2e-3, 8e-3, -5e-3]), 0.05


@pytest.fixture(scope="module")
def parts(moving_bar):
    folder = moving_bar / "models" / "bar" / "spectral"
    model = load_model(folder)
    return Estimator(model, markers_near(model, 5), 0.1, TIP, LARGEST), load_motion(folder)


def forward(parts, kind, **given):
    sure = {"slip": 1e-9, "offset": 0.1, "swing": 2.0, "push": 1e-9, "wander": 0.0, "lasts": LASTS}
    return Transition(*parts, kind, MotionUncertainty(**sure | given))


def begun(parts, kind, made):
    """The robot in motion under the loads, as a motion and as a state of the filter, and the next command."""
    motion = parts[1]
    now = at_rest(motion, np.array([2.0]))
    u = now.q[:1] if kind == "displacement" else now.lam
    for k in range(4):
        now = step(motion, now, MotionCommand(**{kind: u * (1 + 0.02 * k)}, push=LOADS), DT)
    reached = now.q[:1] if kind == "displacement" else u * 1.06
    return now, state_of(made, now, reached), reached * 1.05


def state_of(made, now, reached, P=None):
    z = np.concatenate([now.q, now.p, now.memory.ravel()])
    n = len(z) + 4
    distribution = Gaussian(np.r_[z, LOADS, LOG], np.zeros((n, n)) if P is None else P)
    return MovingState(distribution, now.v, reached, np.zeros((len(z), 1)))


@pytest.mark.parametrize("kind", KINDS)
def test_its_mean_moves_as_the_robot_does_under_the_same_forces(parts, kind):
    """A robot of that stiffness under loads that fade, in a step so short that its vibrations need no scaling."""
    made, dt = forward(parts, kind), 1e-4
    now, state, u = begun(parts, kind, made)
    u = state.u + dt / DT * (u - state.u)
    after = made(state, u, dt)
    told = u if kind == "displacement" else (state.u + u) / 2
    true = step(Altered(parts[1], np.exp(LOG)), now, MotionCommand(**{kind: told}, push=LOADS), dt)
    n_q = parts[1].n_q
    for part, expected, before in ((slice(n_q), true.q, now.q), (slice(n_q, 2 * n_q), true.p, now.p)):
        change = expected - before
        np.testing.assert_allclose(after.z[part] - before, change, atol=1e-3 * np.abs(change).max())
    np.testing.assert_allclose(after.v, true.v, atol=1e-3 * np.abs(true.v).max())
    np.testing.assert_allclose(after.loads, LOADS * np.exp(-dt / LASTS))
    assert after.log == LOG and after.u == u
    assert np.array_equal(made(state, u, 0.0).z, state.z)  # no time, no motion


@pytest.mark.parametrize("kind", KINDS)
def test_its_covariance_spreads_as_its_mean_does(parts, kind):
    """Without noise: P' = F P F^T, F the slope of the mean."""
    made = forward(parts, kind, lasts=1e9)
    now, _, u = begun(parts, kind, made)
    n_z, n_q, motion = made.n_z, parts[1].n_q, parts[1]
    reached = u / 1.05
    size = np.r_[motion.scale, 1 / (200 * motion.scale), np.ones(n_z - 2 * n_q), np.full(3, LARGEST), 1.0]
    rng, held = np.random.default_rng(0), kind == "displacement"
    for _ in range(3):
        d = 1e-4 * size * rng.normal(size=n_z + 4)
        if held:
            d[n_q] = 0.0  # the momentum of what is held is the model's
        ends = []
        for sign in (1, -1):
            state = state_of(made, now, reached)
            mean = state.distribution.mean + sign * d
            moved = MovingState(Gaussian(mean, state.covariance), state.v, state.u, state.by_slip)
            ends.append(made(moved, u, DT).distribution.mean)
        slope = (ends[0] - ends[1]) / 2
        if held:
            slope[n_q] = 0.0
        found = made(state_of(made, now, reached, np.outer(d, d)), u, DT).covariance
        np.testing.assert_allclose(found / np.outer(size, size), np.outer(slope, slope) / np.outer(size, size),
                                   atol=3e-2 * np.abs(np.outer(slope / size, slope / size)).max())  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_the_slope_by_a_slip_is_that_of_the_command(parts, kind):
    made = forward(parts, kind)
    _, state, u = begun(parts, kind, made)
    h = 1e-4 * u
    # a slip grows evenly over the frame, as the command does
    ends = [made(state, u + sign * h, 3 * DT).z for sign in (1, -1)]
    expected = (ends[0] - ends[1]) / (2 * h)
    found = made(state, u, 3 * DT).by_slip[:, 0]
    n_q = parts[1].n_q
    for part in (slice(n_q), slice(n_q + (kind == "displacement"), 2 * n_q)):  # momenta of what is held are the model's
        np.testing.assert_allclose(found[part], expected[part], atol=3e-2 * np.abs(expected[part]).max())


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_learned_is_asked_in_the_middle_of_the_frame(parts, kind, monkeypatch):
    made, asked = forward(parts, kind), []
    _, state, u = begun(parts, kind, made)
    real = transition.places
    monkeypatch.setattr(transition, "places", lambda model, delta_a: asked.append(delta_a) or real(model, delta_a))
    made(state, u, DT)
    middle = state.z[:1] + DT / 2 * state.v[:1] if kind == "force" else state.z[:1] + (u - state.u) / 2
    np.testing.assert_allclose(asked, [[middle]])


def test_each_cause_of_uncertainty_adds_its_own(parts):
    """From a state that is known, in one step: the loads', the stiffness's, those of slip and pushes."""
    made = forward(parts, "displacement", stiffness=0.2, wander=0.5)
    _, state, u = begun(parts, "displacement", made)
    after = made(state, u, 1e-3).covariance
    fades = 1 - np.exp(-1e-3 / LASTS) ** 2
    np.testing.assert_allclose(np.diag(after)[-4:-1], fades * LARGEST**2, rtol=1e-9)
    assert after[-1, -1] == pytest.approx(1e-3 * (0.5 * 0.2) ** 2)
    n_q = parts[1].n_q
    for name in ("slip", "push"):
        one, twice = (forward(parts, "displacement", lasts=1e9, **{name: size})(state, u, 1e-3) for size in (0.1, 0.2))
        ratio = np.diag(twice.covariance)[1:n_q] / np.diag(one.covariance)[1:n_q]
        np.testing.assert_allclose(ratio, 4.0, rtol=1e-3)
        assert not one.covariance[n_q].any() and not one.covariance[:, n_q].any()
        if name == "slip":
            assert one.covariance[0, 0] == pytest.approx(0.1**2 * 1e-3)
        else:
            assert one.covariance[0, 0] < 1e-12  # a held actuator is not pushed away


def test_a_frame_has_twelve_steps_a_period_or_more(parts):
    made = forward(parts, "displacement")
    period = 1 / made.first
    assert made.count(period) == 12 and made.count(1.01 * period) == 13
    assert made.count(period / 12) == 1 and made.count(1e-9) == 1
