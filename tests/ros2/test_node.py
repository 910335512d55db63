"""The ROS 2 node between topics and a robot behind the pipe protocol, or one that is on topics itself.

rclpy stands on ROS 2 and is not on PyPI: a fake takes its place. The messages are the standard packages' own where
rosbags is installed, and always classes with the same fields."""

import importlib
import sys
import xml.etree.ElementTree as ElementTree
from contextlib import ExitStack, nullcontext
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from ros2 import ros
from ros2.hand import ERROR, OK, STALE, WARN, goal_of, send, tick

from cfem.plant.model_plant import ModelPlant

PACKAGE = Path(__file__).parents[2] / "ros2" / "cfem_ros"


def device(folder, *words):
    return [sys.executable, "-P", "-m", "cfem.plant.device.fake", str(folder), *words]


def test_a_robot_behind_the_pipe_goes_to_a_goal_in_metres(start, folder):
    run = start(device=device(folder, "--stiffer", "1.1"), command="force", answer_within=20.0)
    assert tick(run) == (STALE, "waiting for a goal")
    goal = goal_of(run)
    for _ in range(14):
        send(run, "goal", goal)
        assert tick(run) == (OK, "tracking")
    assert tick(run) == (OK, "tracking")
    (status,), command = run.node.published["diagnostics"][-1].status, run.node.published["command"][-1]
    at = run.node.published["effector"][-1].point
    assert np.linalg.norm(np.array([at.x, at.y, at.z]) * 1000 - goal) < 0.1
    assert float({one.key: one.value for one in status.values}["error_mm"]) < 0.1
    assert list(command.name) == list(run.model.rows.actuators) and list(command.position) == []
    assert list(command.effort) == list(run.node.published["commands"][-1].data) and min(command.effort) > 0
    assert run.node.timers[0][0] == pytest.approx(0.05)


def test_a_robot_on_topics_is_controlled_too(start):
    run = start()
    plant, goal = ModelPlant(run.model, run.model.rest_e), goal_of(run)
    send(run, "goal", goal)
    assert tick(run) == (WARN, "the effector is not measured")
    for _ in range(20):
        command = np.array(run.node.published["command"][-1].position) * 1000
        send(run, "effector", plant.step(command).x_e)
        send(run, "goal", goal)
        said = tick(run)
    assert said == (OK, "tracking") and "effector" not in run.node.published
    here = plant.step(np.array(run.node.published["command"][-1].position) * 1000)
    assert np.linalg.norm(here.x_e - goal) < 1e-3
    for _ in range(12):  # the tracker loses it
        send(run, "goal", goal)
        said = tick(run)
    assert said[0] == WARN and "the effector is not measured: the last sample is 0." in said[1]


@pytest.mark.parametrize(
    "wrong",
    [
        {"rate": 0.0},
        {"rate": float("nan")},
        {"goal_timeout": -1.0},
        {"phase_margin": 90.0},
        {"command": "torque"},
        {"effector_clock": "gps"},
    ],
)
def test_parameters_out_of_range_are_named(start, wrong):
    with pytest.raises(ValueError, match=f"{next(iter(wrong))} is .*expected"):
        start(**wrong)


def test_goals_that_cannot_be_meant_are_refused_and_the_command_stays(start):
    run = start()
    send(run, "goal", goal_of(run))
    for _ in range(4):
        tick(run)
    before = list(run.node.published["command"][-1].position)
    for more, words in [
        ({"place": goal_of(run), "frame": "map"}, "in frame 'map', expected 'robot'"),
        ({"place": 1000 * goal_of(run)}, "are these millimetres"),
        ({"place": goal_of(run) + [0, 250, 0]}, "times the robot's length"),
        ({"place": goal_of(run), "age": 3.0}, "its stamp is 3.00 s old"),
        ({"place": [0, np.nan, 0]}, "is not finite"),
    ]:
        send(run, "goal", **more)
        level, said = tick(run)
        assert level == ERROR and words in said and words in run.node.log[-1]
        assert list(run.node.published["command"][-1].position) == pytest.approx(before, abs=1e-6)
    assert tick(run)[0] != ERROR


def test_a_goal_that_gets_old_stops_the_robot_where_it_is(start, monkeypatch):
    run = start()
    send(run, "goal", goal_of(run))
    tick(run)
    before = list(run.node.published["command"][-1].position)
    ros.Node.now += 1.0
    level, said = tick(run)
    assert level == WARN and said == "the effector is not measured"
    send(run, "effector", run.model.rest_e)
    level, said = tick(run)
    assert level == STALE and "s old; the last command is held" in said
    assert list(run.node.published["command"][-1].position) == before


def test_a_pipe_that_stops_ends_the_node_with_its_sentence(start, folder):
    run = start(device=device(folder, "--fail", "die", "--at", "2"), answer_within=20.0)
    tick(run)
    with pytest.raises(SystemExit) as ended:
        tick(run)
    (status,) = run.node.published["diagnostics"][-1].status
    assert ended.value.code == 3 and "ended (exit code 3) instead of answering" in status.message
    assert "see the protocol" in run.node.failed


@pytest.mark.parametrize("cause", ["KeyboardInterrupt", "ExternalShutdownException", "RuntimeError"])
def test_whatever_ends_the_node_the_device_is_told_goodbye(start, tmp_path, monkeypatch, cause):
    path = tmp_path / "device.py"
    path.write_text(
        "import json, sys\n"
        "for line in sys.stdin:\n"
        "    m = json.loads(line)\n"
        "    if 'bye' in m: open(sys.argv[1], 'w').write('released'); break\n"
        "    print(json.dumps({'ready': True, 'version': 1}), flush=True)\n"
    )
    run = start()
    released = tmp_path / "released"
    words = {"model": run.node.given["model"], "device": [sys.executable, str(path), str(released)]}
    monkeypatch.setattr(ros.Node, "given", words)
    node = sys.modules["cfem_ros.node"]
    kind = {"KeyboardInterrupt": KeyboardInterrupt, "RuntimeError": RuntimeError}.get(
        cause, node.ExternalShutdownException
    )

    def spin(_):
        raise kind

    monkeypatch.setattr(sys.modules["rclpy"], "spin", spin)
    with pytest.raises(RuntimeError) if kind is RuntimeError else nullcontext():
        node.main()
    assert released.read_text() == "released"


def test_a_model_that_is_not_there_is_one_sentence(start, monkeypatch):
    start()
    monkeypatch.setattr(ros.Node, "given", {"model": "/nowhere"})
    with pytest.raises(SystemExit, match="cfem: /nowhere: "):
        sys.modules["cfem_ros.node"].main()


def test_the_fields_written_here_are_those_of_the_real_messages():
    messages, _ = ros.real()
    for name, fields in ros.FIELDS.items():
        assert ros.names(messages[name]) == fields.split(), name


def test_what_is_published_can_be_serialised(monkeypatch, folder):
    """By the CDR of the real definitions, there and back."""
    messages, store = ros.real()
    monkeypatch.syspath_prepend(str(PACKAGE))
    ros.install(monkeypatch, messages)
    monkeypatch.setattr(ros.Node, "given", {"model": str(folder)})
    with ExitStack() as stack:
        run = SimpleNamespace(node=importlib.import_module("cfem_ros.node").Controller(stack), messages=messages)
        tick(run)
    for topic, said in run.node.published.items():
        one = said[-1]
        for part in ("position", "velocity", "effort", "data"):
            if hasattr(one, part):
                setattr(one, part, np.array(getattr(one, part)))
        again = store.deserialize_cdr(store.serialize_cdr(one, one.__msgtype__), one.__msgtype__)
        assert ros.names(type(again)) == ros.names(type(one)) and repr(again) == repr(one), topic


def test_the_package_depends_on_what_it_imports():
    tree = ElementTree.parse(PACKAGE / "package.xml").getroot()
    declared = {one.text for one in tree.findall("exec_depend")}
    assert declared >= {"rclpy", *(name.split("/")[0] for name in ros.FIELDS)}
    assert tree.find("license").text == "Apache-2.0" and tree.find("export/build_type").text == "ament_python"
