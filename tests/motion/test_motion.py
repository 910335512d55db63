"""The condensed model that moves, against the full finite elements that it was learned from."""

from copy import copy
from dataclasses import replace

import numpy as np
import pytest
from motion.learned import LARGEST, TAU, dataset, model, problem, states
from support.fast_cases import fast_are

from cfem.condensed.viscosity import Viscosity
from cfem.core.errors import InputError, NumericalError
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import displacement, force
from cfem.fe_motion import modes as full_modes
from cfem.fe_motion.problem import MovingProblem
from cfem.fe_motion.scheme import Scheme
from cfem.fe_motion.simulate import StepControl
from cfem.fe_motion.simulate import simulate as full_simulate
from cfem.fe_motion.start import at_rest as full_at_rest
from cfem.motion.altered import Altered
from cfem.motion.model import MotionModel
from cfem.motion.modes import natural_modes
from cfem.motion.payload import Payload
from cfem.motion.simulate import simulate
from cfem.motion.step import MotionCommand, at_rest, effectors, energy, step
from cfem.surrogate.motion import fit_motion


@pytest.mark.parametrize("held", [True, False])
def test_frequencies_and_damping_are_those_of_the_full_model(held):
    for solved in states()[2:11:4]:
        full = full_modes.natural_modes(problem(), solved.state, 2, None if held else force([0.0]))
        ours = natural_modes(model(), solved.delta_a, held, 2)
        np.testing.assert_allclose(ours.frequency, full.frequency, rtol=1e-2)
        np.testing.assert_allclose(ours.damping, full.damping, rtol=3e-2)


def test_mass_is_positive_over_the_range():
    for delta in np.linspace(0.0, LARGEST, 40):
        place = model().at(np.array([delta]))
        assert np.linalg.eigvalsh(place.M).min() > 0 and np.linalg.eigvalsh(place.inner).min() > 0


def test_the_derivatives_are_those_of_the_matrices():
    delta, h = np.array([1.3]), 1e-5
    place, ahead, behind = (model().at(delta + x) for x in (0.0, h, -h))
    for name, slope in (("M", place.dM[0]), ("H", place.dH[0])):
        difference = (getattr(ahead, name) - getattr(behind, name)) / (2 * h)
        np.testing.assert_allclose(slope, difference, atol=1e-5 * np.abs(difference).max())


def test_slopes_of_the_effectors_are_their_derivatives():
    delta, eta, h = np.array([1.3]), np.array([1.0, -0.5, 0.3, 0.2, -0.1, 0.4])[: model().n_r], 1e-5
    slopes = model().at(delta).slopes(eta)

    def tip(q):
        return model().at(q[:1]).effectors(q[1:])

    q = np.concatenate([delta, eta])
    for k, column in enumerate(slopes.T):
        difference = (tip(q + h * np.eye(len(q))[k]) - tip(q - h * np.eye(len(q))[k])) / (2 * h)
        np.testing.assert_allclose(column, difference, atol=1e-7 * np.abs(slopes).max())


def test_the_tip_swings_on_an_arc():
    """Far out in the first inner motion: of full finite elements, pulled there by what drives that motion."""
    solved = states()[6]
    shapes = full_modes.natural_modes(problem(), solved.state, 1).shapes[:, :, 0]
    push = problem().mass @ shapes * (2 * np.pi * 20.0) ** 2 * 8.0 / np.abs(shapes).max()
    ends = []
    for sign in (-1.0, 1.0):
        pulled = replace(problem().robot, loads=sign * push)
        ends.append(solve(MovingProblem(pulled), displacement(solved.delta_a), solved.state, slack=False).delta_e)
    swing, sag = (ends[1] - ends[0]) / 2, (ends[0] + ends[1]) / 2 - solved.delta_e
    place = model().at(solved.delta_a)
    eta = np.linalg.lstsq(place.H, swing, rcond=None)[0]
    ours = place.effectors(eta) - place.e - place.H @ eta
    assert np.linalg.norm(swing) > 3.0 and sag[0] < -0.1  # mm
    assert ours[0] == pytest.approx(sag[0], rel=0.15)


@pytest.mark.parametrize("kind", fast_are({"force"}, ["displacement", "force"]))
def test_the_tip_moves_as_that_of_the_full_model(kind):
    """A smooth step within about a period, then the vibration that it leaves."""
    solved, end, dt = states()[4], 0.06, 5e-4

    def amount(t):
        return 0.5 - 0.5 * np.cos(np.pi * min(t / 0.02, 1.0))

    def of(t):
        first = solved.delta_a if kind == "displacement" else solved.lambda_a
        return first * (1 + 0.5 * amount(t))

    def full_command(t):
        return displacement(of(t)) if kind == "displacement" else force(of(t))

    def command(t):
        return MotionCommand(**{kind: of(t) if kind == "displacement" else of(t - dt / 4)})

    pace = StepControl(dt, tolerance=None)
    full = full_simulate(
        problem(), full_at_rest(problem(), solved.state), full_command, end, (0.02,), pace, Scheme(1.0)
    )
    ours = simulate(model(), at_rest(model(), solved.delta_a), command, end, dt / 2).arrays()
    tip = np.array([np.interp(full.t, ours["t"], column) for column in ours["delta_e"].T]).T
    wanted = full.of("delta_e")
    travel = np.linalg.norm(np.ptp(wanted, axis=0))
    assert np.linalg.norm(tip - wanted, axis=1).max() < 0.02 * travel


def test_what_relaxes_is_that_of_the_full_model():
    """A Prony term of a third of a period: it stiffens and damps the swing after a quick pull."""
    terms, solved, end, dt = ((0.5, 0.008),), states()[4], 0.04, 5e-4
    full = MovingProblem(replace(problem().robot, viscosity=(Viscosity(TAU, terms),)))
    relaxing = copy(model())
    relaxing.losses = (Viscosity(TAU, terms),)

    def of(t):
        return solved.delta_a * (1.25 - 0.25 * np.cos(np.pi * min(t / 0.01, 1.0)))

    run = full_simulate(
        full,
        full_at_rest(full, solved.state),
        lambda t: displacement(of(t)),
        end,
        (0.01,),
        StepControl(dt, tolerance=None),
        Scheme(1.0),
    )
    wanted, errors = run.of("delta_e"), []
    for which in (relaxing, model()):
        ours = simulate(
            which, at_rest(which, solved.delta_a), lambda t: MotionCommand(displacement=of(t)), end, dt
        ).arrays()
        tip = np.array([np.interp(run.t, ours["t"], column) for column in ours["delta_e"].T]).T
        errors.append(np.linalg.norm(tip - wanted, axis=1).max() / np.linalg.norm(np.ptp(wanted, axis=0)))
    assert errors[0] < 0.02 < 0.1 < errors[1]


def test_without_viscosity_the_energy_does_not_drift():
    still = model(viscous=False)
    start = at_rest(still, np.array([1.5]))
    lam, period = 0.9 * start.lam, 1 / natural_modes(still, start.q[:1], False, 1).frequency[0]
    found, now = [], start
    for _ in range(30 * 60):
        now = step(still, now, MotionCommand(force=lam), period / 60)
        found.append(energy(still, now) - float(lam @ now.q[:1]))
    swing = float(0.1 * start.lam @ start.q[:1])
    early, late = np.mean(found[: 5 * 60]), np.mean(found[-5 * 60 :])
    assert abs(late - early) < 1e-3 * swing
    assert np.ptp(found) < 1e-2 * swing


def test_steps_are_of_second_order():
    start = at_rest(model(), np.array([1.0]))

    def ends(dt):
        return simulate(
            model(), start, lambda t: MotionCommand(displacement=np.array([1.0 + np.sin(40 * t) ** 4])), 0.06, dt
        )

    coarse, middle, fine = (ends(dt).delta_e[-1] for dt in (1e-3, 5e-4, 2.5e-4))
    assert np.log2(np.linalg.norm(coarse - middle) / np.linalg.norm(middle - fine)) == pytest.approx(2.0, abs=0.3)


def test_a_payload_lowers_the_frequency_and_sags():
    """Rayleigh's quotient of the first mode bounds the fall; at rest the sag is the compliance times the weight."""
    delta, mass = np.array([1.0]), 2e-6
    bare = natural_modes(model(), delta, count=1)
    payload = Payload(mass, gravity=(0.0, 0.0, -9810.0))
    heavy = natural_modes(model(), delta, count=1, payload=payload)
    participation = mass * float((bare.effectors[:3, 0] ** 2).sum())
    assert heavy.frequency[0] <= bare.frequency[0] / np.sqrt(1 + participation) * (1 + 1e-9)
    start = at_rest(model(), delta, payload)
    place = model().at(delta)
    C = place.H @ np.linalg.solve(place.inner, place.H.T)
    sag = C @ payload.weight  # and an arc, of second order
    np.testing.assert_allclose(effectors(model(), start) - place.e, sag, atol=5e-3 * np.linalg.norm(sag))
    W = solve(problem(), displacement(delta), states()[4].state).condensed.W
    held = W[:3, :3] - W[:3, 3:] @ W[3:, :3] / W[3, 3]
    assert np.linalg.norm(C - held, 2) < 0.02 * np.linalg.norm(held, 2)
    later = simulate(model(), start, lambda t: MotionCommand(displacement=delta), 0.02, 1e-3, payload)
    np.testing.assert_allclose(later.delta_e[-1], later.delta_e[0], atol=1e-6)


def test_a_motion_that_leaves_what_was_learned_says_when():
    start = at_rest(model(), np.array([1.0]))
    inside = simulate(model(), start, lambda t: MotionCommand(displacement=np.array([1.0 + 10 * t])), 0.02, 1e-3)
    assert inside.left is None

    def out(t):
        return MotionCommand(displacement=np.array([1.0 + 200 * t]))

    assert 0.009 <= simulate(model(), start, out, 0.012, 1e-3).left <= 0.012
    with pytest.raises(NumericalError, match=r"left the states|is not found"):
        simulate(model(), start, out, 0.5, 1e-3)


class Yielding(Altered):
    """Whose energy has a maximum beyond what was learned."""

    def at(self, delta_a):
        place = super().at(delta_a)
        return place if delta_a[0] < 1.2 * LARGEST else replace(place, stiff=-place.stiff)


def test_a_motion_stops_where_the_learned_energy_pushes_away():
    start = at_rest(model(), np.array([1.0]))

    def out(t):
        return MotionCommand(displacement=np.array([1.0 + 200 * t]))

    with pytest.raises(NumericalError, match=r"pushes the robot away .* left the states .* at 0.01\d s"):
        simulate(Yielding(model()), start, out, 0.02, 1e-3)


def test_bad_input_says_so():
    still = dataset()
    still.moving = None
    with pytest.raises(InputError, match="dynamics: true"):
        fit_motion(still)
    driven = at_rest(model(), np.array([1.0]))
    with pytest.raises(NumericalError, match="is not found"):
        step(model(), driven, MotionCommand(displacement=np.array([np.nan])), 1e-3)
    static = model().static
    dual = type("Dual", (), {"form": "force", "parameters": (), "rows": static.rows})()
    with pytest.raises(InputError, match="displacement"):
        MotionModel(dual, {}, [])


def test_a_cable_goes_slack_instead_of_pushing_and_is_held_again():
    """Let out faster than the bar swings back: against full finite elements, in which it goes slack too."""
    solved, end, dt = states()[8], 0.02, 1e-4

    def of(t):
        return solved.delta_a * (1 - 0.9 * np.sin(np.pi * min(t / 0.008, 1.0)) ** 2)

    start = at_rest(model(), solved.delta_a)
    ours = simulate(model(), start, lambda t: MotionCommand(displacement=of(t)), end, dt, unilateral=np.array([True]))
    slack, lam = np.array(ours.slack)[:, 0], np.array(ours.lam)[:, 0]
    assert 5 < slack.sum() < 0.7 * len(slack) and not slack[-1]
    assert (lam[slack] == 0).all() and (lam >= -1e-9 * lam.max()).all()
    cables = np.array(ours.delta_a)[:, 0]
    wanted = np.array([of(t)[0] for t in ours.t])
    assert (cables[slack] >= wanted[slack] - 1e-6).all()
    np.testing.assert_allclose(cables[~slack], wanted[~slack], atol=1e-9)
    stiff = replace(problem().robot, unilateral=np.array([True]))
    full = full_simulate(
        MovingProblem(stiff),
        full_at_rest(problem(), solved.state),
        lambda t: displacement(of(t)),
        end,
        (0.008,),
        StepControl(2 * dt, tolerance=None),
    )
    full_slack = full.of("slack")[:, 0]
    assert abs(full_slack.mean() - slack.mean()) < 0.15
    tip = np.interp(full.t, ours.t, np.array(ours.delta_e)[:, 2])
    # within 8 ms, much faster than the second vibration
    assert np.abs(tip - full.of("delta_e")[:, 2]).max() < 0.1 * np.ptp(tip)


def test_a_payload_swings_with_a_free_cable_and_keeps_its_energy():
    still = model(viscous=False)
    payload = Payload(2e-6, gravity=(0.0, 0.0, -9810.0))
    start = at_rest(still, np.array([1.5]), payload)
    lam, found, now = 0.9 * start.lam, [], start
    for _ in range(200):
        now = step(still, now, MotionCommand(force=lam), 5e-4, payload)
        found.append(energy(still, now, payload) - float(lam @ now.q[:1]))
    swing = abs(float(0.1 * start.lam @ start.q[:1]))
    assert np.ptp(found) < 1e-2 * swing


def test_a_robot_without_viscous_material_moves_undamped():
    bare = dataset()
    bare.moving.viscosity, bare.moving.loss = [], bare.moving.loss[:, :0]
    arrays, facts = fit_motion(bare, max_degree=8, folds=3)
    still = MotionModel(model().static, arrays, facts["viscosity"])
    assert still.at(np.array([1.0])).F.shape == (0, still.n_q, still.n_q)
    found = natural_modes(still, np.array([1.0]))
    assert (found.damping == 0).all()
    np.testing.assert_allclose(found.frequency, natural_modes(model(), np.array([1.0])).frequency, rtol=2e-2)


def test_materials_of_one_viscosity_have_one_loss_form():
    twice = dataset()
    one = twice.moving.viscosity[0]
    twice.moving.viscosity, twice.moving.loss = [one, one], np.concatenate([twice.moving.loss / 2] * 2, axis=1)
    arrays, facts = fit_motion(twice, max_degree=8, folds=3)
    same = MotionModel(model().static, arrays, facts["viscosity"])
    assert len(same.losses) == 1
    np.testing.assert_allclose(same.at(np.array([1.3])).F, model().at(np.array([1.3])).F, rtol=1e-6, atol=1e-9)
