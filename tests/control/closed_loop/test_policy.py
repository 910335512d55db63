"""What a policy is told in a loop, and what becomes of its commands."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from support.arc_robot import LENGTH, REACH, REST_E, ROWS, ArcRobot, tip

from cfem.condensed.strokes import ridge_of
from cfem.control.closed_loop.policy import MovingPolicyController, PolicyController, _parameters
from cfem.control.closed_loop.tick import Pilot
from cfem.control.search.goal_search import SearchSettings
from cfem.control.search.inverse import Limits
from cfem.core.errors import InputError
from cfem.plant.protocol import Measurement
from cfem.predict.at_parameters import AtParameters

LOST = np.full(3, np.nan)


def pilot(command="displacement", rate=1.0, low=0.0, high=4.0):
    limits = Limits(np.array([[-7.0, 9.0]] * 2), np.array([[low, high]] * 2))
    ridge = ridge_of(1e-10, REACH, LENGTH)
    return Pilot(ArcRobot(), command, "equilibrium", limits, np.ones(3), ridge, SearchSettings(3), rate=rate)


def policy(answers, command="displacement", moving=None, parameters=()):
    """That answers these commands in turn, whatever it is told; asked: what it was told."""
    asked, answers = [], iter(answers)

    def answer(*told):
        asked.append([np.array(each, float).copy() for each in told])
        return np.array(next(answers), float)

    facts = {"command": command, "effectors": list(ROWS.effectors), "actuators": list(ROWS.actuators)}
    return SimpleNamespace(
        path="policy.onnx", facts=facts, moving=moving, parameters=parameters, asked=asked, command=answer,
        moving_command=answer, told=lambda p: 2 * p - 1, demand_robot=lambda *rows: asked.append(rows),
    )  # fmt: skip


def measurement(x, t=1):
    return Measurement(REST_E + x, np.zeros(2), np.zeros(2), t, "converged")


def test_a_policy_is_told_where_the_tip_was_seen_last_and_where_the_goal_goes():
    one = policy([[0.5, 0.2], [0.6, 0.3], [0.7, 0.4], [0.8, 0.5]])
    controller = PolicyController(pilot(), REST_E, one, np.array([0.3, 0.1]))
    assert one.asked.pop(0) == (ROWS.effectors, ROWS.actuators)
    begin = tip(np.array([0.3, 0.1]))
    np.testing.assert_allclose(controller.aimed, REST_E + begin)
    goals, seen = REST_E + np.arange(12.0).reshape(4, 3), np.array([1.0, 2.0, 3.0])
    controller.tick(goals[0])
    controller.tick(goals[1], measurement(seen), goals[1:2])
    controller.tick(goals[2], measurement(LOST), goals[2:])
    belief = controller.tick(goals[3], None, [goals[3], goals[3] + [0, 0, 5.0], goals[0]])
    expected = [
        (begin, [0.3, 0.1], [0, 1, 2], [0, 0, 0]),
        (seen, [0.5, 0.2], [3, 4, 5], [0, 0, 0]),
        (seen, [0.6, 0.3], [6, 7, 8], [3, 3, 3]),
        (seen, [0.7, 0.4], [9, 10, 11], [0, 0, 5]),
    ]
    for told, wanted in zip(one.asked, expected, strict=True):
        for value, known in zip(told, wanted, strict=False):
            np.testing.assert_allclose(value, known, atol=1e-12)
    np.testing.assert_array_equal(belief.u, [0.8, 0.5])
    np.testing.assert_array_equal(controller.aimed, goals[3])
    np.testing.assert_allclose(belief.iterate.condensed.delta_e, tip(np.array([0.8, 0.5])), atol=1e-12)


def test_without_a_start_a_policy_begins_at_rest():
    for one in (policy([]), policy([], moving={"tick": 0.02, "history": 2})):
        kind = (lambda *of: MovingPolicyController(*of, None, 0.02)) if one.moving else PolicyController
        controller = kind(pilot(), REST_E, one)
        np.testing.assert_array_equal(controller.belief.u, np.zeros(2))
        np.testing.assert_allclose(controller.aimed, REST_E, atol=1e-6)


COMMANDS = [[9.0, -9.0], [9.0, 0.5], [9.0, 0.5], [9.0, 0.5], [9.0, 0.5]]


def test_commands_of_a_policy_keep_rate_and_bounds():
    controller = PolicyController(pilot(rate=1.5, low=-1.0), REST_E, policy(COMMANDS))
    sent = [controller.tick(REST_E).u for _ in COMMANDS]
    np.testing.assert_allclose(sent, [[1.5, -1.0], [3.0, 0.5], [4.0, 0.5], [4.0, 0.5], [4.0, 0.5]])


@pytest.mark.parametrize("kind", ["displacement", "force"])
def test_commands_of_a_policy_that_moves_keep_rate_and_the_bounds_of_what_is_commanded(kind):
    one = policy(COMMANDS, kind, {"tick": 0.02, "history": 2})
    about = pilot(kind, 1.5, -1.0)
    controller = MovingPolicyController(about, REST_E, one, np.array([1.0, 1.0]), 0.02)
    begin = controller.belief
    sent = [controller.tick(REST_E).u for _ in COMMANDS]
    if kind == "displacement":
        np.testing.assert_array_equal(begin.u, [1.0, 1.0])
        np.testing.assert_allclose(sent, [[2.5, -0.5], [4.0, 0.5], [4.0, 0.5], [4.0, 0.5], [4.0, 0.5]])
        np.testing.assert_array_equal(controller.belief.delta_a, sent[-1])
    else:
        lam = ArcRobot().at_displacement(np.array([1.0, 1.0])).lambda_a
        np.testing.assert_allclose(begin.u, lam)
        np.testing.assert_allclose(sent[0], [lam[0] + 1.5, lam[1] - 1.5])
        np.testing.assert_allclose(np.array(sent)[:, 0], np.minimum(lam[0] + 1.5 * np.arange(1, 6), 9.0))
        np.testing.assert_array_equal(controller.belief.delta_a, [1.0, 1.0])  # nobody says where they stand


def test_a_policy_that_moves_is_told_the_last_samples_and_commands_newest_first():
    one = policy([[0.1, 0.2], [0.3, 0.4], [0.5, 0.6], [0.7, 0.8]], moving={"tick": 0.02, "history": 3})
    start = np.array([0.3, 0.1])
    controller = MovingPolicyController(pilot(), REST_E, one, start, 0.02 * (1 + 5e-7))
    one.asked.clear()
    begin, a, b = tip(start), np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0, 6.0])
    goals = REST_E + np.arange(12.0).reshape(4, 3)
    controller.tick(goals[0])
    controller.tick(goals[1], measurement(a), goals[1:3])
    controller.tick(goals[2], measurement(LOST), [])
    controller.tick(goals[3], measurement(b), goals[3:])
    tips, commands, ahead = zip(*one.asked, strict=True)
    for found, expected in zip(tips, ([begin] * 3, [a, begin, begin], [a, a, begin], [b, a, a]), strict=True):
        np.testing.assert_allclose(found, expected, atol=1e-12)
    for found, expected in zip(
        commands,
        ([start] * 3, [[0.1, 0.2], start, start], [[0.3, 0.4], [0.1, 0.2], start],
         [[0.5, 0.6], [0.3, 0.4], [0.1, 0.2]]),
        strict=True,
    ):  # fmt: skip
        np.testing.assert_allclose(found, expected, atol=1e-12)
    for found, expected in zip(ahead, (goals[:1], goals[1:3], goals[2:3], goals[3:]), strict=True):
        np.testing.assert_allclose(found, expected - REST_E)
    np.testing.assert_array_equal(controller.aimed, goals[3])


@pytest.mark.parametrize("share", [2e-6, -2e-6, 1.0])
def test_a_policy_of_another_rate_or_command_is_refused(share):
    one = policy([], moving={"tick": 0.02, "history": 3})
    with pytest.raises(InputError, match=r"was trained for ticks of 0.02 s.*set rate: 50 Hz"):
        MovingPolicyController(pilot(), REST_E, one, None, 0.02 * (1 + share))
    with pytest.raises(InputError, match="commands displacements, and the loop commands forces"):
        MovingPolicyController(pilot("force"), REST_E, one, None, 0.02)
    with pytest.raises(InputError, match=r"commands displacements.*set command.kind: displacement"):
        PolicyController(pilot("force"), REST_E, policy([]))


def test_a_policy_is_told_the_parameters_of_its_design_or_of_the_scene(monkeypatch):
    known = (SimpleNamespace(name="young"), SimpleNamespace(name="poisson"))
    monkeypatch.setattr("cfem.control.closed_loop.policy.references", lambda parameters: np.array([0.25, 0.5]))
    of_known, plain = policy([], parameters=known), SimpleNamespace(parameters=known)
    np.testing.assert_array_equal(_parameters(plain, of_known), [0.25, 0.5])
    bound = AtParameters.__new__(AtParameters)
    object.__setattr__(bound, "predictor", plain)
    object.__setattr__(bound, "p", np.array([0.75, 1.0]))
    np.testing.assert_array_equal(_parameters(bound, of_known), [0.75, 1.0])
    assert len(_parameters(SimpleNamespace(parameters=known), policy([]))) == 0
    with pytest.raises(InputError, match="of other parameters than the model's: young, poisson, with"):
        _parameters(SimpleNamespace(parameters=known[:1]), of_known)


def test_what_a_policy_is_told_of_its_robot_is_scaled_once(monkeypatch):
    known = (SimpleNamespace(name="young"),)
    monkeypatch.setattr("cfem.control.closed_loop.policy.references", lambda parameters: np.array([0.25]))
    about = pilot()
    about.model.parameters = known
    one = policy([[0.0, 0.0]], parameters=known)
    controller = PolicyController(replace(about), REST_E, one)
    controller.tick(REST_E)
    np.testing.assert_array_equal(one.asked[-1][4], [-0.5])
