"""Motion over time: free fall, rigid rotation, energy, order in time, damping, slack cables, refused steps."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from fe_motion.moving import DENSITY, moving_bar, moving_rod
from support.blocks import bar
from support.clip import GAP, clip
from support.fast_cases import fast_are
from support.released import released

from cfem.condensed.viscosity import Viscosity
from cfem.equilibrium.newton import NewtonSettings
from cfem.equilibrium.solve import rest_state, solve
from cfem.equilibrium.system.actuation import displacement, force
from cfem.fe_motion.modes import natural_modes
from cfem.fe_motion.problem import MovingProblem
from cfem.fe_motion.scheme import Scheme
from cfem.fe_motion.simulate import StepControl, simulate
from cfem.fe_motion.start import at_rest
from cfem.mechanics.mass import gravity

EXACT = NewtonSettings(tolerance=1e-9, max_iterations=30)
SPEED, LAST = 400.0, 4e-3  # mm/s, s


def even(dt):
    """Steps of one length."""
    return StepControl(first=dt, tolerance=None, newton=EXACT)


def free(actuators):
    return lambda t: force(np.zeros(actuators))


@pytest.mark.parametrize("rigid_end", [False, True])
def test_a_free_body_falls_by_half_g_t_squared(rigid_end):
    g = np.array([0.0, 0.0, -9810.0])
    robot = bar(element="tet4", divisions=(3, 1, 1), cables=1, rigid_end=rigid_end)
    robot = replace(robot, density=DENSITY, loads=gravity(robot.body, DENSITY, g), fixed=np.empty(0, dtype=int))
    problem = MovingProblem(robot)
    start = released(problem, problem.rest, np.zeros_like(problem.rest), force(np.zeros(1)))
    run = simulate(problem, start, free(1), 0.1, pace=even(0.02))
    np.testing.assert_allclose(run.end.x - problem.rest, np.broadcast_to(g * 0.1**2 / 2, run.end.x.shape), atol=1e-8)
    np.testing.assert_allclose(run.end.v, np.broadcast_to(g * 0.1, run.end.v.shape), rtol=1e-9, atol=1e-7)


@pytest.mark.parametrize("rigid_end", [False, True])
def test_a_free_body_turns_evenly_and_keeps_its_momenta(rigid_end):
    """Started with the stretch that its rotation makes, about an axis of inertia: no vibration is left."""
    robot = bar(element="tet4", young=10.0, divisions=(3, 1, 1), cables=1, rigid_end=rigid_end)
    problem = MovingProblem(replace(robot, density=DENSITY, fixed=np.empty(0, dtype=int)))
    omega = np.array([0.0, 0.0, 20.0])  # rad/s
    centre = np.asarray(problem.mass.sum(axis=0)) @ problem.rest / problem.mass.sum()
    x = problem.rest - centre
    v = np.cross(omega, x)
    start = released(problem, problem.rest, v, force(np.zeros(1)))
    run = simulate(problem, start, free(1), 0.1, pace=even(1e-3), scheme=Scheme(0.5))
    turned, speed = run.end.x - centre, run.end.v
    momentum = np.cross(turned, problem.mass @ speed).sum(axis=0)
    np.testing.assert_allclose(momentum, np.cross(x, problem.mass @ v).sum(axis=0), rtol=2e-4, atol=1e-6)
    angle = 20.0 * 0.1
    c, s = np.cos(angle), np.sin(angle)
    exact = x @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]]).T
    assert np.abs(turned - exact).max() < 0.05  # mm of 60: the stretch, and its vibration


@pytest.mark.parametrize(
    "kind, material",
    fast_are(
        [("solid", "elastic"), ("rod", "viscous")],
        product(["solid", "rigid end", "rod"], ["elastic", "viscous"]),
    ),
)
def test_energy_is_balanced_to_second_order(kind, material):
    """Struck in its first mode, by a tenth of its length and more."""
    viscosity = () if material == "elastic" else (Viscosity(2e-4, ((0.3, 5e-3),)),)
    if kind == "rod":
        problem = moving_rod(6, viscosity)
    else:
        options = {"element": "tet4", "divisions": (4, 1, 1), "cables": 1, "rigid_end": kind == "rigid end"}
        problem = moving_bar(viscosity, **options)
    modes = natural_modes(problem, rest_state(problem), 1, force([0.0]))
    f, shape = modes.frequency[0], modes.shapes[..., 0]
    struck = shape / np.abs(shape).max() * 2 * np.pi * f * 8.0  # mm
    start, drifts = released(problem, problem.rest, struck, force([0.0])), []
    for steps in (40, 80):
        run = simulate(problem, start, free(1), 1.5 / f, pace=even(1.5 / f / steps), scheme=Scheme(1.0))
        balance = run.of("energy")
        balance = np.array([each.balance for each in balance])
        drifts.append(np.abs(balance / balance[0] - 1).max())
        assert run.why is None
    assert drifts[1] < 0.02
    assert drifts[1] < 0.35 * drifts[0]


SMOOTH = {
    "rod, Kelvin-Voigt, held": (lambda: moving_rod(3, [Viscosity(5e-4)]), displacement, 3.0),
    "rod, Prony, forced": (lambda: moving_rod(3, [Viscosity(0.0, ((0.5, 4e-3), (0.3, 0.05)))]), force, 0.15),
    "solid, both, held": (lambda: solid("tet4"), displacement, 3.0),
    "solid with a pressure, forced": (lambda: solid("tet10p0"), force, 1.0),
    "bubbles, forced": (lambda: solid("hex8"), force, 1.0),
}


def solid(element):
    viscosity = [Viscosity(3e-4, ((0.5, 4e-3),))]
    return moving_bar(viscosity, element=element, poisson=0.4, divisions=(3, 1, 1), cables=1)


@pytest.mark.parametrize("case", fast_are({"rod, Prony, forced", "solid, both, held"}, SMOOTH))
def test_the_scheme_is_of_second_order(case):
    """Under a smooth command, an actuator's displacement or force as sin^4."""
    made, kind, amount = SMOOTH[case]
    problem = made()

    def command(t):
        return kind([amount * np.sin(np.pi * t / 0.1) ** 4])

    start, tips = at_rest(problem, rest_state(problem)), []
    for steps in (30, 60, 120):
        run = simulate(problem, start, command, 0.06, pace=even(0.06 / steps), scheme=Scheme(0.6))
        assert run.why is None and not run.refused
        tips.append(run.samples[-1].delta_e)
    coarse, middle, fine = tips
    slope = np.log2(np.linalg.norm(coarse - middle) / np.linalg.norm(middle - fine))
    assert slope == pytest.approx(2.0, abs=0.35)


def test_a_vibration_decays_by_its_damping_ratio():
    """Logarithmic decrement of a rod started in its first mode."""
    problem = moving_rod(5, [Viscosity(4e-3)])
    modes = natural_modes(problem, rest_state(problem), 1, force([0.0]))
    f, zeta = modes.frequency[0], modes.damping[0]
    # velocity of the mode, small against the length
    v = modes.shapes[..., 0] / np.abs(modes.shapes).max() * 2 * np.pi * f * 0.05
    start = released(problem, problem.rest, v, force([0.0]))
    along = modes.shapes[..., 0][problem.body.sections.nodes[-1][0]]
    run = simulate(problem, start, free(1), 2.5 / f, pace=even(1 / (120 * f)), scheme=Scheme(1.0))
    y = run.of("delta_e") @ along
    damped = 2 * np.pi * f * np.sqrt(1 - zeta**2)
    t = run.t
    exact = np.exp(-zeta * 2 * np.pi * f * t) * np.sin(damped * t)
    scale = (y @ exact) / (exact @ exact)
    np.testing.assert_allclose(y, scale * exact, atol=4e-3 * abs(scale))
    assert zeta > 0.01


def test_steps_adapt_to_what_they_leave_out():
    problem = moving_rod(4, [Viscosity(1e-3)])

    def command(t):
        return force([0.1 * np.sin(np.pi * min(t, 0.02) / 0.04) ** 2])

    start = at_rest(problem, rest_state(problem))
    runs = [
        simulate(problem, start, command, 0.06, kinks=[0.02], pace=StepControl(1e-3, tolerance=tolerance))
        for tolerance in (0.1, 1e-2, 1e-3)
    ]
    assert all(run.why is None for run in runs)
    assert len(runs[0].t) < len(runs[1].t) < len(runs[2].t)
    ends = np.array([run.samples[-1].delta_e for run in runs])
    assert np.linalg.norm(ends[1] - ends[2]) < 0.5 * np.linalg.norm(ends[0] - ends[2])
    assert any(abs(t - 0.02) < 1e-12 for t in runs[0].t)


def test_one_factorisation_serves_many_steps():
    problem = moving_rod(6)
    start = at_rest(problem, rest_state(problem))
    run = simulate(
        problem, start, lambda t: force([0.01 * np.sin(20 * t) ** 2]), 0.1, pace=StepControl(1e-3, tolerance=None)
    )
    assert len(run.samples) == 101
    assert run.cost.factorizations <= 10


def test_a_step_that_fails_shrinks_and_says_why():
    problem = moving_bar(element="tet4", divisions=(4, 1, 1), cables=1)
    start = at_rest(problem, rest_state(problem))
    run = simulate(problem, start, lambda t: displacement([30.0 * t / 0.01]), 1.0, pace=StepControl(0.5, shortest=1e-3))
    assert run.refused and "Newton" in run.refused[0].why
    assert run.why is not None and "fell below 0.001 s" in run.why
    assert all(np.isfinite(each.delta_e).all() for each in run.samples)


def test_a_cable_that_would_push_goes_slack():
    """Pulled, then let out faster than the bar swings back: the cable is slack, then taut again."""
    problem = moving_bar([Viscosity(2e-3)], element="tet4", divisions=(6, 1, 1), cables=1)

    def command(t):
        return displacement([4.0 * max(0.0, 1 - max(t - 0.05, 0) / 0.002) * min(t / 0.05, 1.0)])

    start = at_rest(problem, rest_state(problem))
    run = simulate(problem, start, command, 0.12, kinks=[0.05, 0.052], pace=StepControl(1e-3, tolerance=2e-2))
    assert run.why is None
    slack, lam, delta = run.of("slack")[:, 0], run.of("lam")[:, 0], run.of("delta")[:, 0]
    assert slack.any() and not slack.all()
    assert (lam >= -1e-6).all()
    target = np.array([command(t).target[0] for t in run.t])
    assert (delta >= target - 1e-6).all()  # never shorter than commanded


def test_a_body_at_rest_stays_where_it_is():
    problem = moving_bar([Viscosity(1e-3)], element="tet10p0", divisions=(3, 1, 1), cables=2)
    solved = solve(problem, displacement([3.0, 0.5]))
    run = simulate(problem, at_rest(problem, solved.state), lambda t: displacement([3.0, 0.5]), 0.1)
    assert np.abs(run.end.x - solved.state.x).max() < 1e-5


def test_legs_that_strike_each_other_bounce_and_keep_their_energy():
    """Of a clip with self-contact, its legs thrown towards each other; without it they pass."""

    def thrown(self_contact, steps):
        problem = MovingProblem(replace(clip("tet4", self_contact=self_contact), density=DENSITY))
        v = np.zeros_like(problem.rest)
        x, _, z = problem.rest.T
        v[:, 2] = np.where(z > 3.5, -1, 1) * np.clip((x - 3) / 21, 0, 1) * SPEED
        start = released(problem, problem.rest, v, force(np.zeros(2)))
        run = simulate(problem, start, free(2), LAST, pace=even(LAST / steps), scheme=Scheme(1.0))
        assert run.why is None
        balance = np.array([each.balance for each in run.of("energy")])
        return run.of("delta_e")[:, 2], np.abs(balance / balance[0] - 1).max()

    (bounced, coarse), (_, fine), (passed, _) = thrown(True, 40), thrown(True, 80), thrown(False, 40)
    assert -0.55 * GAP < bounced.min() < -0.45 * GAP and passed.min() < -1.3 * GAP  # half a gap each, or through it
    assert fine < 0.03 and fine < 0.4 * coarse  # of second order
