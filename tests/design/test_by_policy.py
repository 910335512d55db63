"""The design that a policy does best with, on a bar of two lengths that one cable bends, by a policy in closed form."""

import warnings

import numpy as np
import pyarrow.parquet as pq
import pytest
from design.bars import QUIET, learn

from cfem.core.errors import InputError
from cfem.design import by_policy
from cfem.design.by_policy import ByPolicy
from cfem.design.stage import run
from cfem.design.task import Task, serve
from cfem.gym.policy import Policy
from cfem.gym.world import World
from cfem.parametric.load import finite_elements, learned

torch = pytest.importorskip("torch")

SAMPLE = """
scene: scene.yaml
mesh: mesh
out: samples
parameters:
  height: {key: geometry.height, range: {mm: [9, 12]}}
splits:
  train: {rows: 30, method: scrambled-halton, seed: 1}
  test: {rows: 5, method: random, seed: 2}
"""
DESIGN = """
model: model
scene: scene.yaml
mesh: mesh
out: out
task: {goals: {mm: [[-0.5, 0, 4], [-1.5, 0, 7.6]]}, relative_to: rest, starts: 2, policy: reach.onnx}
figures: false
"""


class Towards(torch.nn.Module):
    """Shortens the cable while the tip is below the goal, in proportion; deaf to the parameters that it is told."""

    def forward(self, seen):
        return 2.0 * seen[:, 2:3] + 0.25 * seen[:, 5:6]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    from cfem.gym.save_policy import save_policy

    folder = tmp_path_factory.mktemp("policy")
    learn(folder, 10, SAMPLE, DESIGN)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        save_policy(Towards(), folder / "reach.onnx", World(folder / "model", "reach", 1, observe_parameters=True))
    return folder


@pytest.fixture(scope="module")
def family(folder):
    return learned(folder / "model", folder / "scene.yaml")


def task_of(goals, **changed):
    given = {"from_rest": True, "weights": np.ones(3), "force": np.zeros((len(goals), 3))} | changed
    return Task(np.array(goals), **given)


def judge_of(family, folder, goals, ticks=30, **changed):
    p0 = np.array([one.reference for one in family.parameters])
    return ByPolicy(family, task_of(goals, **changed), Policy(folder / "reach.onnx"), p0, [0], ticks)


@pytest.mark.slow
def test_a_design_is_judged_by_the_episode_that_the_environment_has(family, folder):
    judge, p, goal = judge_of(family, folder, [[-0.5, 0, 4.0]], ticks=12), np.array([[9.5], [11.0]]), [-0.5, 0, 4.0]
    rewards, distance = judge.judge(p)
    for i in range(2):
        world = World(family.predictor, "reach", 1, designs=p[i : i + 1], observe_parameters=True)
        world.scales = judge.policy.scales
        world.reset(np.zeros(1, int))
        world.goals.path[:], world.u[:] = goal, 0.4 * 4.0
        world.stand(np.zeros(1, int))
        found = [world.step(Towards()(torch.as_tensor(world.observe())).numpy()) for _ in range(12)]
        assert rewards[i] == pytest.approx(np.mean([one[0] for one in found]), rel=1e-5)
        assert distance[i, 0] == pytest.approx(np.mean([one[1] for one in found[-by_policy.LAST :]]), rel=1e-4)


@pytest.mark.slow
def test_the_design_of_least_distance_is_that_of_the_task_where_the_policy_gets_there(family, folder, monkeypatch):
    monkeypatch.setattr(by_policy, "FIRST", 64)
    monkeypatch.setattr(by_policy, "ROUND", 32)
    goals = (
        family.predictor.at_displacement([1.2], [11.5]).delta_e,
        family.predictor.at_displacement([2.2], [11.5]).delta_e,
    )
    judge = judge_of(family, folder, goals)
    best = judge.best(np.array([[9.5]]), "distance")
    wanted = serve(family, judge.task, [0], judge.p0, 2)
    assert wanted.p[0] == pytest.approx(11.5, abs=0.01)
    assert best.p[0] == pytest.approx(11.5, abs=0.1) and np.linalg.norm(best.distance) < 0.02
    assert np.linalg.norm(judge.at(np.array([9.5])).distance) > 5 * np.linalg.norm(best.distance)
    assert judge.best(np.array([[9.5]]), "reward").reward >= best.reward


def test_the_finite_element_robot_does_as_the_learned_one(family, folder):
    judge, p = judge_of(family, folder, [[-0.5, 0, 4.0]], ticks=6), np.array([11.0])
    exact = finite_elements(folder / "scene.yaml", folder / "mesh", family.parameters)
    one, other = judge.in_fe(p, exact.meshes.of(p)[1]), judge.at(p)
    assert one.distance == pytest.approx(other.distance, abs=5e-3) and one.reward == pytest.approx(
        other.reward, abs=5e-3
    )


def test_the_command_tells_what_the_policy_does_with_each_design(folder, monkeypatch):
    monkeypatch.setattr(by_policy, "FIRST", 16)
    monkeypatch.setattr(by_policy, "ROUNDS", 2)
    results = run(folder / "design.yaml", [], None, QUIET)["results"]
    told = results["task"]["policy"]
    assert told["reward"]["reward"] >= max(told[name]["reward"] for name in ("task", "reference"))
    assert np.linalg.norm(told["distance"]["distance"]) <= np.linalg.norm(told["task"]["distance"])
    assert any("policy with the reference" in line for line in results["headline"])


CONTROL = """
scene: scene.yaml
mesh: mesh
models: {spectral: model}
out: control
design: {height: 11 mm}
trajectories:
  up: {kind: goals, points: {mm: [[57.5, 0, 4]]}}
loop:
  rate: 10 Hz
  command: {kind: displacement}
  controllers:
    policy: {mode: policy, policy: reach.onnx}
  settle: {radius: 0.1 mm, hold: 0.2 s, at_most: 6 s}
"""


def test_a_loop_controls_the_finite_element_robot_of_a_stated_design(family, folder):
    from cfem.control.stage import run as control

    (folder / "control.yaml").write_text(CONTROL)
    p, there = np.array([11.0]), family.predictor.at_displacement([1.5], [11.0]).delta_e + family.predictor.rest_e
    goal = f"trajectories.up.points={{mm: [{there.tolist()}]}}"
    results = control(folder / "control.yaml", [goal], None, QUIET)["results"]
    assert results["loop"]["up"]["policy"]["reached"]["min"] == 1
    last = pq.read_table(folder / "control" / "loop.parquet").to_pylist()[-1]
    exact = finite_elements(folder / "scene.yaml", folder / "mesh", family.parameters)
    assert last["x_e"] == pytest.approx(exact.at("displacement", np.array(last["command"]), p[None]).x_e[0], abs=1e-6)


def test_what_a_policy_does_not_know_is_refused(family, folder):
    goals = [[-0.5, 0, 4.0]]
    with pytest.raises(InputError, match="neither weights nor forces"):
        judge_of(family, folder, goals, force=np.ones((1, 3)))
    with pytest.raises(InputError, match="neither weights nor forces"):
        judge_of(family, folder, goals, weights=np.array([0.0, 1.0, 1.0]))
    judge = judge_of(family, folder, goals)
    object.__setattr__(judge.policy, "parameters", ())
    with pytest.raises(InputError, match="does not observe the parameters"):
        ByPolicy(family, judge.task, judge.policy, judge.p0, [0])
