"""Late, rare and old samples, and stamps of clocks that differ."""

import sys

import numpy as np
import pytest
from ros2 import ros
from ros2.hand import ERROR, OK, STALE, WARN, goal_of, send, tick
from support.fast_cases import fast_are

from cfem.plant.imperfect_plant import Stiffer
from cfem.plant.model_plant import ModelPlant


@pytest.mark.parametrize(
    ("interval", "delay", "stiffness"),
    fast_are(
        [(1, 5, 1.0), (10, 0, 1.1), (4, 3, 1.0), (1, 20, 1.1)],
        [(*late, stiffness) for late in [(1, 5), (10, 0), (4, 3), (1, 20)] for stiffness in (1.0, 1.1)],
    ),
)
def test_late_and_rare_samples_correct_once(start, messages, interval, delay, stiffness):
    """Of a robot on topics, stamped when they were taken: exact it stays at its goal, stiffer it gets there."""
    run = start(command="force", measured_timeout=5.0)
    plant, goal, waiting = ModelPlant(Stiffer(run.model, stiffness), run.model.rest_e), goal_of(run), []
    for k in range(12 * (interval + delay)):
        send(run, "goal", goal)
        tick(run)
        x_e = plant.step(np.array(run.node.published["command"][-1].effort), "force").x_e
        ros.Node.now += 0.02  # the robot has moved
        if k % interval == 0:
            waiting.append((k + delay, x_e))
        if waiting and waiting[0][0] == k:
            send(run, "effector", waiting.pop(0)[1], age=0.05 * delay)
        ros.Node.now -= 0.02
        assert stiffness > 1 or k < 2 or np.linalg.norm(x_e - goal) < 0.01
    assert np.linalg.norm(x_e - goal) < 0.05


def test_samples_without_a_stamp_are_as_old_as_the_stated_latency(start):
    """Five ticks late: right with the latency stated; else the present command's, and the gain that of no delay."""
    ends = {}
    for latency in (0.25, 0.0):
        run = start(command="force", latency=latency)
        plant, goal, waiting = ModelPlant(Stiffer(run.model, 1.1), run.model.rest_e), goal_of(run), [None] * 5
        for _ in range(120):
            send(run, "goal", goal)
            tick(run)
            waiting.append(plant.step(np.array(run.node.published["command"][-1].effort), "force").x_e)
            ros.Node.now += 0.02
            if (x_e := waiting.pop(0)) is not None:
                send(run, "effector", x_e, age=ros.Node.now)  # a stamp of 0
            ros.Node.now -= 0.02
        ends[latency] = np.linalg.norm(
            plant.step(np.array(run.node.published["command"][-1].effort), "force").x_e - goal
        )
    assert ends[0.25] < 0.01 < 0.1 * ends[0.0]


def off_by(run, stamps, seconds=2.0, **more):
    """What was said last, the tracker's stamps lying `stamps` s in the past of its clock at each tick."""
    plant = ModelPlant(run.model, run.model.rest_e)
    for k in range(round(20 * seconds)):
        send(run, "goal", goal_of(run))
        said = tick(run)
        x_e = plant.step(np.array(run.node.published["command"][-1].position) * 1000).x_e
        send(run, "effector", x_e, age=stamps(k))
    return said


def test_stamps_in_the_future_are_a_fault_and_no_measurement(start):
    run = start()
    level, said = off_by(run, lambda k: -40.0)
    assert level == ERROR and said == "measured effector: the stamp lies 40.00 s in the future: is it of another clock?"
    tick(run)  # the last refusal is said once; what is left is that nobody sees the robot
    level, said = tick(run)
    assert level == WARN and said == "the effector is not measured"
    send(run, "goal", goal_of(run), age=-40.0)
    level, said = tick(run)
    assert level == ERROR and said.startswith("goal: the stamp lies 40.00 s in the future")


def test_a_goal_of_the_near_future_is_stale_as_any_other(start):
    run = start()
    send(run, "goal", goal_of(run), age=-0.08)
    assert tick(run)[0] != STALE
    ros.Node.now += 0.5
    send(run, "effector", run.model.rest_e)
    assert tick(run)[0] == STALE


def test_another_clock_is_compared_by_its_offset_alone(start):
    run = start(effector_clock="other", latency=0.01)
    assert off_by(run, lambda k: -4000.0 + 0.01 * (k % 3)) == (OK, "tracking")
    level, said = off_by(run, lambda k: -4040.0, 0.1)
    assert level == ERROR and "the other clock has jumped" in said
    assert off_by(run, lambda k: -4040.0) == (OK, "tracking")


def test_a_tracker_that_repeats_its_last_sample_is_stale(start):
    run = start()
    assert off_by(run, lambda k: 0.0) == (OK, "tracking")
    frozen = ros.Node.now
    for _ in range(15):
        send(run, "goal", goal_of(run))
        said = tick(run)
        send(run, "effector", run.model.rest_e, age=ros.Node.now - frozen)
    assert said[0] == WARN and "the last sample is 0." in said[1]


def test_a_device_that_repeats_its_last_sample_is_stale(start, tmp_path):
    path = tmp_path / "device.py"
    path.write_text(
        "import json, sys\n"
        "for line in sys.stdin:\n"
        "    m = json.loads(line)\n"
        "    if 'bye' in m: break\n"
        "    say = {'ready': True, 'version': 1} if 'hello' in m else {'t': min(m['t'], 3), 'x_e': [0, 10, -120]}\n"
        "    print(json.dumps(say), flush=True)\n"
    )
    run = start(device=[sys.executable, str(path)], answer_within=20.0)
    said = []
    for _ in range(16):
        send(run, "goal", goal_of(run))
        said.append(tick(run))
    assert said[3] == (OK, "tracking") and said[-1][0] == WARN and "the last sample is 0." in said[-1][1]


def test_our_own_clock_put_back_forgets_the_goal(start):
    run = start()
    assert off_by(run, lambda k: 0.0) == (OK, "tracking")
    before = list(run.node.published["command"][-1].position)
    ros.Node.now -= 30.0
    level, said = tick(run)
    assert level == ERROR and "the clock was put back by 29.95 s" in said
    assert list(run.node.published["command"][-1].position) == before
    assert off_by(run, lambda k: 0.0) == (OK, "tracking")
