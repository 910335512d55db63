"""The filter of markers on the condensed dynamics: against the model's own motion, and against finite elements."""

from dataclasses import replace

import numpy as np
import pytest

from cfem.core.errors import InputError
from cfem.motion.altered import Altered
from cfem.motion.estimation.marker_filter import MarkerFilter, MarkerFrame
from cfem.motion.estimation.uncertainty import MotionUncertainty
from cfem.motion.load import load_motion
from cfem.motion.step import MotionCommand, at_rest, step
from cfem.plant.marked_plant import MarkedPlant
from cfem.plant.moving_plant import MovingFemPlant
from cfem.predict.estimation.estimate import Estimator
from cfem.predict.estimation.filter import Filter
from cfem.predict.estimation.markers import markers_near
from cfem.predict.load import load_model
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh

TIP = ("tip.x", "tip.y", "tip.z")
DT, NOISE, LARGEST = 2e-3, 0.1, 0.01


@pytest.fixture(scope="module")
def parts(moving_bar):
    folder = moving_bar / "models" / "bar" / "spectral"
    model = load_model(folder)
    return Estimator(model, markers_near(model, 5), NOISE, TIP, LARGEST), load_motion(folder)


def unknown(**given):
    return MotionUncertainty(**{"slip": 0.05, "offset": 0.1, "swing": 2.0} | given)


def moved(parts, filtered, seed, frames=60, kind="displacement", stiffness=1.0, push=(0.0, 0.0, 0.0), spoilt=None):
    """Frames of the model's own motion under a step; (error, error over deviation, answer, truth) of each. spoilt:
    (frame, markers) -> what is seen of them, and by how much (mm) the actuator is not where its command is."""
    estimator, motion = parts
    rng, real = np.random.default_rng(seed), Altered(motion, stiffness)
    u = np.array([2.0])
    now = at_rest(real, u)
    if kind == "force":
        u = now.lam
    found = []
    for frame in range(frames):
        target, astray = u * (1.0 if frame < 5 else 1.3), 0.0
        if spoilt is not None:
            astray = spoilt(frame, np.zeros((5, 3)))[1]
        for _ in range(4):
            now = step(real, now, MotionCommand(**{kind: target + astray}, push=np.array(push)), DT / 4)
        y = np.r_[now.q, push, np.log(stiffness)]
        seen = estimator.rest + filtered.markers.seen(y)[0].reshape(-1, 3)
        seen = seen + NOISE * rng.normal(size=seen.shape)
        if spoilt is not None:
            seen = spoilt(frame, seen)[0]
        answer = filtered.tick(seen, None, target, after=DT)
        off = np.r_[answer.delta_a, answer.loads] - np.r_[now.q[:1], push]
        found.append((off, off / answer.deviation, answer, now))
    return found


def test_it_follows_what_swings(parts):
    """Velocities too, which no marker tells in one frame."""
    filtered = MarkerFilter(*parts, "displacement", unknown())
    found = moved(parts, filtered, 0)
    n_q, motion = parts[1].n_q, parts[1]
    assert all(one[2].converged for one in found)
    swings = np.array([one[3].q[1:] for one in found])
    assert np.linalg.norm(swings, axis=1).max() > 1.0
    p, true = filtered.known.z[n_q + 1 : 2 * n_q], found[-1][3].p[1:]
    deviation = np.sqrt(np.diag(filtered.known.covariance))[n_q + 1 : 2 * n_q]
    assert (np.abs(p - true) < 4 * deviation).all()
    before = np.sqrt(motion.stiffness * np.diag(motion.at(np.array([2.6])).M)[1:]) * filtered.swing
    assert (deviation[:2] < 0.3 * before[:2]).all()


def test_intervals_hold_and_innovations_are_as_large_as_they_say(parts):
    """24 runs with pushes drawn as assumed: 95 % intervals hold in 92 to 98.5 % of 288 numbers, and the mean of the
    squares of the innovations is 1."""
    inside, squares = [], np.zeros(2)
    for seed in range(24):
        filtered = MarkerFilter(*parts, "displacement", unknown(slip=1e-3, offset=1e-3, stiffness=1e-3))
        push = LARGEST * np.random.default_rng(1000 + seed).normal(size=3)
        for off, z, answer, _ in moved(parts, filtered, seed, 16, push=push)[7::4]:
            assert np.isfinite(off).all()
            inside.append(np.abs(z) < 1.96)
            squares += answer.innovation
    assert 0.92 < np.mean(inside) < 0.985
    assert 0.85 < squares[0] / squares[1] < 1.15


@pytest.mark.parametrize("loaded", [TIP, ("tip.y", "skin.2"), ()])
@pytest.mark.parametrize("stiffness", [1.0, 0.8])
def test_effectors_at_rest_are_those_of_the_static_model(parts, loaded, stiffness):
    """Loads that hold the robot still swing the inner motions by H_w^T w / kappa and move the effectors by C w: a
    stiffer robot by less."""
    estimator, motion = replace(parts[0], loaded=loaded, reference=None), parts[1]
    filtered = MarkerFilter(estimator, motion, "displacement", unknown())
    delta_a, w = np.array([2.0]), 1e-3 * np.array([0.4, 1.0, -0.7])[: len(loaded)]
    eta = motion.skin(delta_a)[0][estimator.loaded_rows].T @ w / motion.stiffness / stiffness
    found = filtered.effectors(np.r_[delta_a, eta, w, np.log(stiffness)])
    still = estimator.effectors(delta_a, 0 * w)
    expected = (estimator.effectors(delta_a, w) - still) / stiffness
    np.testing.assert_allclose(
        found - still, expected, rtol=2e-3, atol=1e-12 + 2e-3 * np.abs(expected).max(initial=0.0)
    )


@pytest.mark.parametrize("kind", ["force", "displacement"])
def test_a_softer_robot_is_found_out(parts, kind):
    filtered = MarkerFilter(*parts, kind, unknown(stiffness=0.2))
    moved(parts, filtered, 1, 80, kind, stiffness=0.9)
    deviation = np.sqrt(filtered.known.covariance[-1, -1])
    assert deviation < 0.1 and abs(filtered.known.log - np.log(0.9)) < 3 * deviation


def test_outliers_lost_frames_and_cables_that_jump_are_survived(parts):
    def spoilt(frame, seen):
        seen = seen.copy()
        if frame == 8:
            seen[2] += 9.0
        if frame == 12:
            seen[:] = np.nan
        return seen, 0.4 if frame >= 30 else 0.0

    found = moved(parts, MarkerFilter(*parts, "displacement", unknown()), 5, spoilt=spoilt)
    answers = [one[2] for one in found]
    assert all(one.converged for one in answers)
    assert [frame for frame, one in enumerate(answers) if one.outliers] == [8] and answers[8].outliers == (2,)
    assert np.abs([one[0][0] for one in found[40:]]).max() < 0.1  # of an actuator 0.4 mm away from its command


def test_a_robot_that_is_lost_is_found_again(parts):
    estimator, _ = parts
    filtered, rng = MarkerFilter(*parts, "displacement", unknown()), np.random.default_rng(3)
    lost = 0
    for frame in range(25):
        x = np.r_[1.0 if frame < 5 else 4.0, 0.0, 0.0, 0.0]
        found = filtered.tick(estimator.places(x) + NOISE * rng.normal(size=(5, 3)), None, None, after=DT)
        lost += not found.converged
    assert lost <= 10 and found.converged and abs(found.delta_a[0] - 4.0) < 0.2


def filter_at_rest(parts, frames=10):
    """A filter after frames of a robot at rest, what it sees and its command."""
    filtered, u = MarkerFilter(*parts, "displacement", unknown()), np.array([2.0])
    y = np.r_[at_rest(parts[1], u).q, np.zeros(4)]
    places = parts[0].rest + filtered.markers.seen(y)[0].reshape(-1, 3)
    for _ in range(frames):
        assert filtered.tick(places, None, u, after=DT).converged
    return filtered, places, u


def test_a_frame_at_the_time_of_the_last_moves_nothing_on(parts):
    """Unless told how much later it is, a frame is of the same time."""
    (once, places, u), (again, _, _) = filter_at_rest(parts), filter_at_rest(parts)
    further = np.array([2.5])
    told, untold = once.tick(places, None, further, after=0.0), again.tick(places, None, further)
    np.testing.assert_array_equal(told.delta_a, untold.delta_a)
    np.testing.assert_allclose(untold.delta_a, u, atol=0.02)


@pytest.mark.parametrize("garbage", [1e9, -1e300, np.nan, np.inf])
def test_a_command_that_no_robot_reaches_is_not_followed(parts, garbage):
    filtered, places, u = filter_at_rest(parts)
    for command in (np.array([garbage]), u):
        answer = filtered.tick(places, None, command, after=DT)
        assert answer.converged
        np.testing.assert_allclose(answer.delta_a, u, atol=0.05)


def test_a_state_far_out_of_range_begins_again_at_once(parts):
    """Its innovations rise and fall as it rings, so no run of rejected frames would show it."""
    filtered, places, u = filter_at_rest(parts)
    mean = filtered.known.distribution.mean.copy()
    mean[1] = 1e12
    filtered.known = replace(filtered.known, distribution=replace(filtered.known.distribution, mean=mean))
    answer = filtered.tick(places, None, u, after=DT)
    assert answer.converged
    np.testing.assert_allclose(answer.delta_a, u, atol=0.05)


def test_finite_elements_that_ring(moving_bar, parts):
    """After a pull within a frame, the shape is several times nearer than that of a robot taken to be at rest."""
    estimator, _ = parts
    model = estimator.model
    robot = build_robot(*load_scene_and_mesh(moving_bar / "pipelines" / "bar" / "scene.yaml"))
    plant = MarkedPlant(MovingFemPlant(robot, DT, 2), robot, estimator.markers, model.skin.rest)
    plant.settle(np.array([2.0]))
    filters = MarkerFilter(*parts, "displacement", unknown()), Filter(estimator, 0.01, 500, 0.1)
    rng, errors = np.random.default_rng(4), []
    for frame in range(40):
        u = np.array([2.0 if frame < 3 else 4.0])
        true = plant.step(u)
        seen = true.markers + NOISE * rng.normal(size=true.markers.shape)
        answers = filters[0].tick(seen, None, u, after=DT), filters[1].tick(seen, None, u)
        apart = [model.skin.surface(one.rows) - true.surface for one in answers]
        errors.append([np.sqrt((one**2).sum(axis=1).mean()) for one in apart])
    moving, still = np.median(errors[4:], axis=0)
    assert moving < 0.1 and moving < still / 3


@pytest.mark.parametrize("kind", ["displacement", "force"])
def test_the_first_state_is_as_uncertain_as_is_stated(parts, kind):
    """Near a commanded displacement by `offset`; where it is not known, all over the reach. Swings and their momenta
    carry the same energy: kappa swing^2 of each mode of the learned mass."""
    estimator, motion = parts
    made, n_q = MarkerFilter(*parts, kind, unknown(stiffness=0.2)), motion.n_q
    places = estimator.places(np.array([2.0, 0.0, 0.0, 0.0]))
    u = np.array([2.05]) if kind == "displacement" else at_rest(motion, np.array([2.0])).lam
    first = made._first(MarkerFrame(places, None, u))
    P, mean = first.covariance, first.distribution.mean
    n_z = made.forward.n_z
    assert first.u == u and not first.v.any() and not first.by_slip.any()
    assert mean[0] == pytest.approx(2.05 if kind == "displacement" else 2.0, abs=0.05) and not mean[1:].any()
    deviation = 0.1 if kind == "displacement" else 3.0 * estimator.scale[0]
    assert P[0, 0] == pytest.approx(deviation**2)
    np.testing.assert_allclose(np.diag(P)[1:n_q], made.swing**2)
    H = motion.paths(estimator.middle[:1])[0][:3]
    assert made.swing * np.sqrt((H**2).sum()) == pytest.approx(2.0)  # mm of the tip
    momenta, M = P[n_q + 1 : 2 * n_q, n_q + 1 : 2 * n_q], motion.at(mean[:1]).M[1:, 1:]
    energy = np.trace(np.linalg.solve(M, momenta))
    assert energy == pytest.approx(motion.stiffness * np.diag(P)[1:n_q].sum())
    assert not P[n_q].any() and not P[:, n_q].any()  # what is held has no momentum of its own
    np.testing.assert_allclose(P[n_z:-1, n_z:-1], estimator.load_covariance)
    assert P[-1, -1] == pytest.approx(0.2**2)
    unknown_command = MarkerFilter(*parts, "displacement", unknown())._first(MarkerFrame(places, None, None))
    assert unknown_command.covariance[0, 0] == pytest.approx((3.0 * estimator.scale[0]) ** 2)
    assert unknown_command.u == pytest.approx(2.0, abs=0.05)


def test_a_jump_is_as_large_in_forces_as_in_displacements(parts):
    """5 % of the reach, or the force that the static model needs for it."""
    estimator, motion = parts
    held, driven = (MarkerFilter(*parts, kind, unknown()).jump for kind in ("displacement", "force"))
    assert held == pytest.approx(0.05 * np.abs(estimator.model.reach).max())
    middle = estimator.middle[:1]
    lam = [at_rest(motion, middle + side * held / 2).lam for side in (-1, 1)]
    assert driven == pytest.approx(np.abs(lam[1] - lam[0]), rel=0.05)


def test_commanded_forces_are_needed_where_they_drive(parts):
    with pytest.raises(InputError, match="commanded forces are missing"):
        MarkerFilter(*parts, "force", unknown()).tick(parts[0].rest)


@pytest.mark.parametrize("name", ["slip", "offset", "swing", "push", "lasts"])
def test_what_is_not_positive_is_refused(name):
    with pytest.raises(InputError, match="must be positive"):
        unknown(**{name: 0.0})
