"""The compiled tick does what the control of Python does with the same model, and says so when it cannot."""

from itertools import product

import numpy as np
import pytest
from export.embedded import export, needs_compiler, spectral
from support.fast_cases import fast_are

from cfem.condensed.far import far_of
from cfem.condensed.model import under_force
from cfem.condensed.strokes import ridge_of
from cfem.control.closed_loop.controller import Controller
from cfem.control.closed_loop.feedback import Feedback
from cfem.control.closed_loop.run import Pace, run_closed_loop
from cfem.control.closed_loop.tick import Belief, Pilot, drive
from cfem.control.search.goal_search import SearchSettings
from cfem.control.search.inverse import Aim, Limits, inverse_step
from cfem.control.search.optimality import Optimality, arrived
from cfem.core.errors import SpecError
from cfem.export.compiled.controller import CompiledController
from cfem.plant.gains import Gains
from cfem.plant.imperfect_plant import Imperfection, ImperfectPlant, Stiffer
from cfem.plant.model_plant import ModelPlant
from cfem.predict.load import build

pytestmark = needs_compiler
LIMITED, SOFTENED, OUTSIDE, NOT_FOUND, HELD, BAD_INPUT, REJECTED = 1, 2, 4, 8, 16, 32, 256
OUT_OF_REACH, FAR = 1024, 2048
MEASURED_AT = np.array([6.0, 4.0])


def compiled(folder, model=None, pressures=None, **controller) -> CompiledController:
    export(folder, model or spectral(), pressures, controller=controller)
    return CompiledController(folder)


def curve(model, count: int, beyond: float = 1.0) -> np.ndarray:
    """(count, 3) mm goals about what the model reaches; beyond: farther from its middle by this factor."""
    angle = np.linspace(0, 2 * np.pi, count)
    pulls = np.column_stack([8 + 4 * np.cos(angle), 8 + 4 * np.sin(angle)])
    goals = model.rest_e + np.array([model.at_displacement(pull).delta_e for pull in pulls])
    return goals.mean(axis=0) + beyond * (goals - goals.mean(axis=0))


def limits_of(model, **more) -> Limits:
    limits = Limits.of(model.reach, np.ones(model.rows.n_a, dtype=bool))
    return Limits(more.get("lambda_a", limits.lambda_a), limits.delta_a)


@pytest.mark.parametrize("beyond", [1.0, 3.0])
@pytest.mark.parametrize("iterations", [1, 3])
def test_the_published_tick(tmp_path, iterations, beyond):
    """Forces, the last linearisation for where they lead: the same commands as Python's, in reach and out of it."""
    model = build(*spectral())
    controller = compiled(
        tmp_path, command="force", observer="previous_step", iterations=iterations, halvings=0, step="3 mm"
    )
    ridge, settings = ridge_of(1e-10, model.reach, model.length), SearchSettings(iterations=iterations, step=3.0)
    pilot = Pilot(model, "force", "previous_step", limits_of(model), np.ones(3), ridge, settings)
    belief = Belief.at(pilot, np.zeros(2))
    for goal in curve(model, 12, beyond):
        command, belief = controller.step(goal), drive(pilot, belief, goal - model.rest_e)
        assert command.lambda_a == pytest.approx(belief.u, rel=1e-8, abs=1e-8)


@pytest.mark.parametrize("form", ["displacement", "force"])
@pytest.mark.parametrize(("command", "observer"), [("force", "equilibrium"), ("displacement", "measured")])
def test_the_linearisation_is_where_the_observer_says(tmp_path, form, command, observer):
    """Each tick is the inverse step at the model under the last forces, or where the actuators are measured."""
    model = build(*spectral(form))
    controller = compiled(
        tmp_path, spectral(form), command=command, observer=observer, halvings=0, start={"mm": [6.0, 6.0]}
    )
    aim_of = lambda goal: Aim(goal - model.rest_e, np.ones(3), ridge_of(1e-10, model.reach, model.length))  # noqa: E731
    at = model.at_displacement(np.array([6.0, 6.0]))
    for goal in curve(model, 8):
        if observer == "measured":
            at = model.at_displacement(MEASURED_AT)
        step = inverse_step(at, aim_of(goal), limits_of(model).within(at.delta_a, 5.0))
        found = controller.step(goal, delta_a=MEASURED_AT)
        assert found.lambda_a == pytest.approx(step.lambda_a, rel=1e-8, abs=1e-8)
        assert found.delta_a == pytest.approx(step.delta_a, rel=1e-8, abs=1e-8)
        assert found.status & (HELD | NOT_FOUND) == 0
        at = under_force(model, step.lambda_a, at)


def test_the_outer_loop_is_that_of_python(tmp_path):
    """PI on a plant that the model knows wrongly, with goals in and out of reach: the forces of Python's loop. Python
    takes what the model expects where the linearisation leads, C the linearisation's own word: equal in the limit."""
    model, push = build(*spectral()), np.array([0.0, 0.5, 0.2])
    options = {"iterations": 4, "halvings": 0, "K_P": 0.3, "K_I": 0.2, "integral_limit": "6 mm"}
    controller = compiled(tmp_path, command="force", **options)
    ridge, settings = ridge_of(1e-10, model.reach, model.length), SearchSettings(4, step=5.0)
    pilot = Pilot(model, "force", "previous_step", limits_of(model), np.ones(3), ridge, settings)
    goals = curve(model, 5, beyond=1.5)
    plant = ModelPlant(model, model.rest_e, push=push)
    python = Controller(pilot, model.rest_e, Gains(0.3, 0.2, 6.0), far=far_of(model.rows, model.length))
    pace = Pace(0.0, 1, ticks_a_goal=12)
    moments = run_closed_loop(goals, pilot, plant, model.rest_e, pace, controller=python)
    plant, sample = ModelPlant(model, model.rest_e, push=push), ()
    for moment in moments:
        command = controller.step(moment.goal, *sample)
        assert command.lambda_a == pytest.approx(moment.belief.u, rel=1e-3, abs=1e-3)
        sample = plant.step(command.lambda_a, "force").x_e, command.tick
    assert command.lambda_a == pytest.approx(moment.belief.u, rel=1e-5, abs=1e-5)


def test_the_integral_removes_what_the_model_does_not_know(tmp_path):
    model = build(*spectral())
    controller = compiled(tmp_path, command="force", observer="equilibrium", K_P=0.1, K_I=0.2)
    plant, sample = ModelPlant(model, model.rest_e, push=np.array([0.0, 0.3, 0.0])), ()
    goal, errors = model.rest_e + model.at_displacement(np.array([9.0, 8.6])).delta_e, []
    for _ in range(100):
        command = controller.step(goal, *sample)
        x_e = plant.step(command.lambda_a, "force").x_e
        sample = x_e, command.tick
        errors.append(goal - x_e)
    W_ea = model.at_force(command.lambda_a).W_ea  # what is left, two cables cannot move
    correctable = [np.linalg.norm(W_ea @ np.linalg.lstsq(W_ea, one, rcond=None)[0]) for one in errors]
    assert correctable[0] > 1.0 and correctable[-1] < 1e-3 * correctable[0]


def test_the_command_keeps_its_rate_and_its_bounds(tmp_path):
    model = build(*spectral())
    controller = compiled(tmp_path, command="displacement", rate="0.5 mm", largest_force="30 N")
    before = np.zeros(2)
    for goal in curve(model, 30, beyond=4.0):
        command = controller.step(goal)
        assert np.abs(command.delta_a - before).max() <= 0.5 + 1e-9
        assert (command.delta_a >= model.reach[:, 0] - 1e-9).all() and (
            command.delta_a <= model.reach[:, 1] + 1e-9
        ).all()
        assert (command.lambda_a > -0.01).all() and (command.lambda_a <= 30 + 0.01).all()  # the model's there
        before = command.delta_a
    assert command.status & LIMITED


def test_commanded_forces_keep_their_rate_and_their_bounds(tmp_path):
    model = build(*spectral())
    controller = compiled(tmp_path, command="force", observer="equilibrium", force_rate="0.3 N", largest_force="6 N")
    before = controller.step(model.rest_e).lambda_a
    for goal in np.repeat(curve(model, 10, beyond=4.0), 5, axis=0):
        command = controller.step(goal)
        assert np.abs(command.lambda_a - before).max() <= 0.3 + 1e-9
        assert (command.lambda_a >= 0).all() and (command.lambda_a <= 6).all() and not command.status & HELD
        before = command.lambda_a


def test_stated_pressures_bound_each_actuator_and_free_its_course(tmp_path):
    """As `cfem control` has it: commanded between stated bounds, a chamber may grow as far as the model knows."""
    model, stated = build(*spectral()), np.array([[0.5, 60.0], [0.0, 3.0]])
    reach = np.array([[0.0, 6.0], [0.0, 6.0]])
    meta = {**model.meta, "reach": reach.tolist(), "row_units": [("mm", "N")] * 3 + [("mm^3", "MPa")] * 2}
    controller = compiled(tmp_path, (meta, spectral()[1]), stated, command="force", force_rate="1 MPa")
    goal = model.rest_e + model.at_displacement(np.array([12.0, 12.0])).delta_e
    ticks = [controller.step(goal) for _ in range(60)]
    lam = np.array([one.lambda_a for one in ticks[1:]])
    assert (lam >= stated[:, 0] - 1e-12).all() and (lam <= stated[:, 1] + 1e-12).all() and lam[:, 1].max() == 3.0
    assert np.abs(np.diff(lam, axis=0)).max() <= 1.0 + 1e-9
    assert ticks[-1].delta_a[0] > 8.0 and ticks[-1].status & HELD == 0
    bounded = compiled(tmp_path / "course", (meta, spectral()[1]), stated, command="displacement")
    assert max(bounded.step(goal).delta_a.max() for _ in range(60)) <= 6.0 + 1e-9


@pytest.mark.parametrize(
    "limit", [{"largest_force": "10 MPa"}, {"rate": "2 mm^3"}, {"step": "1 l"}, {"start": {"mm^3": [1, 1]}}]
)
def test_limits_of_chambers_are_none_of_cables(tmp_path, limit):
    with pytest.raises(SpecError, match=rf"c\.controller\.{next(iter(limit))}\S*: is a (stress|volume)"):
        compiled(tmp_path, **limit)


def test_damping_holds_actuators_where_they_are(tmp_path):
    model = build(*spectral())
    controller = compiled(tmp_path, command="displacement", observer="measured", halvings=0, damping=1e-3)
    aim = Aim(
        curve(model, 3)[0] - model.rest_e,
        np.ones(3),
        ridge_of(1e-10, model.reach, model.length),
        0.0,
        ridge_of(1e-3, model.reach, model.length),
    )
    at = model.at_displacement(MEASURED_AT)
    expected = inverse_step(at, aim, limits_of(model).within(at.delta_a, 5.0))
    free = inverse_step(at, Aim(aim.goal, aim.weights, aim.ridge), limits_of(model).within(at.delta_a, 5.0))
    found = controller.step(curve(model, 3)[0], delta_a=MEASURED_AT)
    assert found.delta_a == pytest.approx(expected.delta_a, rel=1e-8)
    assert np.abs(expected.delta_a - free.delta_a).max() > 0.01


def test_a_course_that_forces_exclude_is_softened(tmp_path):
    """So far pulled that no force of 1 N keeps it there: says so, keeps the forces, comes as near as they let it."""
    model = build(*spectral())
    controller = compiled(
        tmp_path, command="force", observer="measured", halvings=0, largest_force="1 N", step="0.1 mm"
    )
    stand = np.array([12.0, 12.0])
    command = controller.step(curve(model, 3)[0], delta_a=stand)
    expected = inverse_step(
        model.at_displacement(stand),
        Aim(curve(model, 3)[0] - model.rest_e, np.ones(3), ridge_of(1e-10, model.reach, model.length)),
        limits_of(model, lambda_a=np.array([[0.0, 1.0]] * 2)).within(stand, 0.1),
    )
    assert command.status & SOFTENED and expected.softened
    assert (command.lambda_a >= 0).all() and (command.lambda_a <= 1).all()
    assert command.delta_a == pytest.approx(expected.delta_a, abs=1e-4)


def test_what_cannot_be_answered_holds_the_command(tmp_path):
    model = build(*spectral())
    controller = compiled(tmp_path, observer="measured")
    goal = curve(model, 3)[0]
    good = controller.step(goal, delta_a=np.array([5.0, 5.0]))
    assert good.status & HELD == 0
    for bad in (np.array([np.nan, 5.0]), np.array([np.inf, 5.0])):
        held = controller.step(goal, delta_a=bad)
        assert held.status == HELD | BAD_INPUT and (held.delta_a == good.delta_a).all()
    assert controller.step(np.full(3, np.nan), delta_a=np.ones(2)).status == HELD | BAD_INPUT
    far = controller.step(goal, delta_a=np.array([1e6, -1e6]))
    assert far.status & HELD and np.isfinite(far.delta_a).all()
    assert controller.step(goal, delta_a=np.array([5.0, 5.0])).delta_a == pytest.approx(good.delta_a)


def test_a_state_outside_of_the_data_is_reported(tmp_path):
    controller = compiled(tmp_path, observer="measured")
    goal = build(*spectral()).rest_e
    assert controller.step(goal, delta_a=np.array([24.0, 24.0])).status & OUTSIDE


def test_a_state_beside_the_sheet_of_the_data_is_reported(tmp_path):
    """The kept states lie on a line; both states here lie within their boxes."""
    meta, arrays = spectral()
    both = np.linspace(2.0, 9.0, 20)
    states = [[delta, delta + 0.05 * (-1) ** n, 1.0, 1.0] for n, delta in enumerate(both)]
    box = {"delta_a": [[0.0, 0.0], [11.0, 11.0]], "lambda_a": [[-9.0, -9.0], [9.0, 9.0]], "states": states}
    export(tmp_path, (meta | {"domain": meta["domain"] | box}, arrays), None, controller={"observer": "measured"})
    controller, goal = CompiledController(tmp_path), build(meta, arrays).rest_e
    assert controller.step(goal, delta_a=np.array([5.0, 5.03])).status & OUTSIDE == 0
    assert controller.step(goal, delta_a=np.array([5.0, 6.0])).status & OUTSIDE


@pytest.mark.parametrize("scalar", ["double", "float"])
def test_rest_is_not_outside_though_every_training_state_pulls_a_little(tmp_path, scalar):
    meta, arrays = spectral()
    box = {name: [[0.5, 0.5], meta["domain"][name][1]] for name in ("delta_a", "lambda_a")}
    pulled = meta | {"domain": meta["domain"] | box}
    export(tmp_path, (pulled, arrays), None, scalar=scalar, controller={"observer": "measured"})
    controller, rest = CompiledController(tmp_path), build(meta, arrays).rest_e
    assert controller.step(rest, delta_a=np.zeros(2)).status & OUTSIDE == 0
    assert controller.step(rest, delta_a=np.full(2, -3.0)).status & OUTSIDE


def test_robots_do_not_share_state(tmp_path):
    model = build(*spectral())
    one, other = compiled(tmp_path), CompiledController(tmp_path)
    goals = curve(model, 4)
    alone = [one.step(goal).delta_a for goal in goals]
    one.reset()
    for goal, expected in zip(goals, alone, strict=True):
        assert (one.step(goal).delta_a == expected).all()
        other.step(goals[-1])


def test_a_step_that_leads_away_is_shortened(tmp_path):
    """One cable, a goal beside the curve that its tip draws: the linearisation, taken unseen, leads past the nearest
    point again and again; with halvings no tick is farther than the last."""
    model = build(*spectral(n_a=1))
    goal = model.rest_e + model.at_displacement(np.array([14.0])).delta_e + np.array([0.0, 100.0, -110.0])
    distance = {}
    for halvings in (0, 8):
        controller = compiled(tmp_path / str(halvings), spectral(n_a=1), halvings=halvings, step="30 mm")
        ticks = [controller.step(goal).delta_a for _ in range(20)]
        distance[halvings] = [np.linalg.norm(model.rest_e + model.at_displacement(u).delta_e - goal) for u in ticks]
    assert (np.diff(distance[8]) <= 1e-9).all() and distance[8][-1] <= distance[0][-1] + 1e-6
    assert (np.diff(distance[0]) > 1e-3).any()


def test_the_bound_on_operations_holds_every_query(tmp_path):
    def queries(**controller) -> int:
        return export(tmp_path, spectral(), controller=controller)["operations"]["queries"]

    assert queries(halvings=0) == 1 and queries(halvings=0, iterations=3) == 3
    assert queries(halvings=0, observer="equilibrium", command="force") == 21
    assert queries(halvings=8, iterations=2) == 17


def ended(controller, goal, ticks: int = 60):
    for _ in range(ticks):
        command = controller.step(goal)
    return command


@pytest.mark.parametrize("halvings", [0, 8])
@pytest.mark.parametrize("command", ["displacement", "force"])
def test_out_of_reach_is_said_where_the_optimality_conditions_show_it(tmp_path, command, halvings):
    """As Python's `Optimality` has it at the state where the robot stands, and never on the way."""
    model = build(*spectral())
    controller = compiled(tmp_path, command=command, observer="equilibrium", halvings=halvings)
    goal, shown = model.rest_e + model.at_displacement(np.array([12.0, 11.0])).delta_e, []
    for beyond in (1.0, 1.6):
        there = model.rest_e + beyond * (goal - model.rest_e)
        first, command = controller.step(there), ended(controller, there)
        assert not first.status & OUT_OF_REACH
        shown.append(bool(command.status & OUT_OF_REACH))
        aim = Aim(there - model.rest_e, np.ones(3), ridge_of(1e-10, model.reach, model.length))
        state = model.at_displacement(command.delta_a)
        known = Optimality.of(state, aim, limits_of(model))
        assert shown[-1] == (known.holds and not arrived(state, aim, limits_of(model)))
    assert shown == [False, True]


def test_regularisation_that_keeps_the_robot_away_is_not_the_reach(tmp_path):
    model = build(*spectral())
    controller = compiled(tmp_path, observer="equilibrium", regularisation=1e3)
    goal = model.rest_e + model.at_displacement(np.array([12.0, 11.0])).delta_e
    assert not ended(controller, goal).status & OUT_OF_REACH


def test_a_goal_two_lengths_away_holds_the_command(tmp_path):
    model = build(*spectral())
    controller = compiled(tmp_path)
    before = controller.step(model.rest_e + [0.0, 5.0, 3.0])
    after = controller.step(model.rest_e + [0.0, 2.01 * model.length, 0.0])
    assert after.status == HELD | BAD_INPUT | FAR and after.delta_a == pytest.approx(before.delta_a, abs=0)
    assert not controller.step(model.rest_e + [0.0, 1.99 * model.length, 0.0]).status & HELD


def test_a_goal_in_metres_holds_the_command(tmp_path):
    model = build(*spectral())
    controller = compiled(tmp_path)
    goal = model.rest_e + [0.0, 5.0, 3.0]
    before = controller.step(goal)
    after = controller.step(goal / 1e3)
    assert after.status == HELD | BAD_INPUT | FAR and after.delta_a == pytest.approx(before.delta_a, abs=0)
    assert not controller.step(goal).status & HELD


def test_samples_correct_as_in_python_tick_by_tick(tmp_path):
    """Late, rare, lost, repeated, old and not finite ones, and jumps, with a delay that grows and falls: the same
    corrections and gains as Python's rule on the same references."""
    model, random = build(*spectral()), np.random.default_rng(7)
    controller = compiled(tmp_path, command="force", observer="equilibrium", late=12)
    far = far_of(model.rows, model.length)
    python = Feedback(Gains(), np.ones(3, bool), history=12, rest_e=model.rest_e, far=far)
    jumps = np.random.default_rng(8)
    plant, samples, heard = ModelPlant(model, model.rest_e, push=np.array([0.0, 0.3, 0.1])), {}, set()
    for k, goal in enumerate(np.repeat(curve(model, 20), 30, axis=0)):
        most = 1 + (k // 40) % 15
        tick = max(0, k - int(random.integers(0, most)))
        x_e = samples.get(tick, np.zeros(3)) * (np.nan if random.random() < 0.1 else 1.0)
        x_e = x_e + jumps.uniform(-1, 1, 3) * (model.length if jumps.random() < 0.1 else 0.0)
        corrects = python.sample(tick, x_e)
        command = controller.step(goal, x_e, tick)
        assert controller.moved == pytest.approx(python.moved, rel=1e-12, abs=1e-12)
        assert controller.integral == python.integral and command.tick == k + 1
        assert bool(command.status & REJECTED) == (tick not in heard and tick > max(heard, default=0) and not corrects)
        heard.add(tick)
        python.commanded(command.reference + python.moved)
        samples[k + 1] = plant.step(command.lambda_a, "force").x_e
    assert python.late > 2


def test_a_sample_of_a_command_not_given_yet_is_not_heard(tmp_path):
    model = build(*spectral())
    controller = compiled(tmp_path, command="force", observer="equilibrium")
    goal = curve(model, 3)[0]
    for tick in (1, 7, 2**31 - 1):
        controller.reset()
        assert controller.step(goal, model.rest_e, tick).status & REJECTED and not controller.moved.any()


def test_an_outlier_where_the_robot_cannot_be_is_rejected(tmp_path):
    """One of 1e7 mm moved the goal so far that the program had no answer: the command was held for ever."""
    model = build(*spectral())
    controller = compiled(tmp_path, command="force", observer="equilibrium")
    goal = curve(model, 3)[0]
    for away, rejected in ((1.9 * model.length, False), (2.1 * model.length, True), (1e7, True)):
        controller.reset()
        for _ in range(2):  # a jump corrects once it is confirmed
            before = controller.step(goal)
            found = controller.step(goal, model.rest_e + np.array([0.0, away, 0.0]), before.tick)
        assert bool(found.status & REJECTED) == rejected and not found.status & HELD
        assert controller.moved.any() != rejected


def test_a_sample_in_metres_is_rejected(tmp_path):
    model = build(*spectral())
    controller = compiled(tmp_path, command="force", observer="equilibrium")
    goal = curve(model, 3)[0]
    for unit, rejected in ((1.0, False), (1e-3, True)):
        controller.reset()
        for _ in range(3):  # a jump corrects once it is confirmed
            before = controller.step(goal)
            found = controller.step(goal, unit * (model.rest_e + [0.0, 1.0, 0.0]), before.tick)
        assert bool(found.status & REJECTED) == rejected and controller.moved.any() != rejected


@pytest.fixture(scope="module")
def default_controller(tmp_path_factory):
    options = {"command": "force", "observer": "equilibrium", "late": 50, "iterations": 8}
    return compiled(tmp_path_factory.mktemp("default"), **options)


LATE = [(1, 0), (1, 5), (10, 0), (3, 20), (20, 20)]


@pytest.mark.parametrize(
    "robot, late",
    fast_are(
        [("exact", (1, 0)), ("stiffer", (1, 5)), ("loaded", (10, 0)), ("stiffer", (3, 20)), ("loaded", (20, 20))],
        product(["exact", "stiffer", "loaded"], LATE),
    ),
    ids=str,
)
def test_the_default_gains_settle_with_late_and_rare_samples(default_controller, robot, late):
    interval, delay = late
    """As Python's: a tenth of the open loop's error after (3 + 1) (delay + interval) ticks, a hundredth after
    (6 + 1) of them."""
    model, controller = build(*spectral()), default_controller
    controller.reset()
    real, push = {"exact": (1.0, None), "stiffer": (1.1, None), "loaded": (1.0, np.array([0.2, 0.0, 0.0]))}[robot]
    sensor = Imperfection(samples_a_tick=1 / interval, delay=delay)
    plant = ImperfectPlant(ModelPlant(Stiffer(model, real), model.rest_e, push), sensor, 0)
    goal, errors, sample = model.rest_e + model.at_displacement(np.array([9.0, 8.0])).delta_e, [], ()
    for _ in range(8 * (delay + interval)):
        command = controller.step(goal, *sample)
        measured = plant.step(command.lambda_a, "force")
        sample = np.nan_to_num(measured.x_e), measured.t
        error, W_ea = goal - plant.actual.x_e, model.at_force(command.lambda_a).W_ea  # what two cables can move
        errors.append(np.linalg.norm(W_ea @ np.linalg.lstsq(W_ea, error, rcond=None)[0]))
    if robot == "exact":
        assert max(errors[2:]) < 0.01
        return
    first = max(errors[:2])
    for folds in (1, 2):
        assert max(errors[(3 * folds + 1) * (delay + interval) :]) <= 0.1**folds * first + 1e-3, folds
