"""Policies as files: what is saved is what is read, and what is no policy is refused."""

import json
import warnings
from types import SimpleNamespace

import numpy as np
import pytest
from gym.moving import moving
from surrogate.stored import train_folder

from cfem.condensed.strokes import ridge_of
from cfem.control.closed_loop.policy import MovingPolicyController, PolicyController
from cfem.control.closed_loop.tick import Pilot
from cfem.control.search.inverse import Limits
from cfem.core.errors import InputError
from cfem.gym.moving_world import MovingWorld
from cfem.gym.policy import Policy
from cfem.gym.tasks import observation
from cfem.gym.world import World
from cfem.plant.model_plant import ModelPlant
from cfem.predict.load import load_model

torch = pytest.importorskip("torch")


class Towards(torch.nn.Module):
    """Both cables follow what is missing: good enough to move, and known in closed form."""

    def __init__(self, weights):
        super().__init__()
        self.linear = torch.nn.Linear(*weights.T.shape, bias=False)
        self.linear.weight.data = torch.tensor(weights, dtype=torch.float32)

    def forward(self, seen):
        return self.linear(seen)


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    return load_model(train_folder(tmp_path_factory.mktemp("plain"), "{kind: spectral, max_degree: 8}", train=60))


@pytest.fixture(scope="module")
def saved(model, tmp_path_factory):
    from cfem.gym.save_policy import save_policy

    world, path = World(model, "reach", 4), tmp_path_factory.mktemp("policy") / "reach.onnx"
    here = model.at_displacement(0.4 * model.reach[:, 1])
    inverse = np.linalg.pinv(here.effector_jacobian) / world.scales.step[:, None] * world.scales.scale * 0.5
    weights = np.hstack([inverse, np.zeros((2, world.sizes[0] - 3))])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        save_policy(Towards(weights), path, world)
    return path, world, weights


def test_a_saved_policy_commands_what_the_module_says(saved):
    path, world, weights = saved
    policy, scales = Policy(path), world.scales
    tip, u, goal = np.array([1.0, 2.0, 3.0]), 0.3 * scales.reach, np.array([2.0, 1.0, 3.5])
    seen = observation(scales, *(one[None] for one in (tip, u, goal, np.zeros(3), np.zeros(0))))[0]
    wanted = np.clip(u + np.clip(weights @ seen, -1, 1) * scales.step, scales.low, scales.reach)
    assert policy.command(tip, u, goal, np.zeros(3), np.zeros(0)) == pytest.approx(wanted, rel=1e-5)


def pilot_of(model, command="displacement"):
    limits, ridge = Limits.of(model.reach, np.ones(2, bool)), ridge_of(1e-10, model.reach, model.length)
    return Pilot(model, command, "equilibrium", limits, np.ones(3), ridge)


def test_a_loop_is_closed_by_a_policy(model, saved):
    controller = PolicyController(pilot_of(model), model.rest_e, Policy(saved[0]))
    plant, measured = ModelPlant(model, model.rest_e), None
    goal = model.rest_e + model.at_displacement(0.45 * model.reach[:, 1]).delta_e
    errors = []
    for _ in range(60):
        belief = controller.tick(goal, measured)
        measured = plant.step(belief.u)
        errors.append(np.linalg.norm(measured.x_e - goal))
    assert errors[-1] < 0.05 * errors[0] and errors[-1] < 0.5
    assert belief.iterate.condensed.delta_a == pytest.approx(belief.u)


def test_a_lost_sample_stops_nothing(model, saved):
    controller = PolicyController(pilot_of(model), model.rest_e, Policy(saved[0]))
    lost = SimpleNamespace(x_e=np.full(3, np.nan), t=1)
    assert np.isfinite(controller.tick(model.rest_e + 1.0, lost).u).all()


def test_a_policy_of_another_robot_is_refused(model, saved, tmp_path):
    import onnx

    other = onnx.load(str(saved[0]))
    facts = json.loads(other.metadata_props[0].value) | {"actuators": ["one", "two"]}
    onnx.helper.set_model_props(other, {"cfem.policy": json.dumps(facts)})
    onnx.save(other, str(tmp_path / "other.onnx"))
    with pytest.raises(InputError, match="another robot"):
        PolicyController(pilot_of(model), model.rest_e, Policy(tmp_path / "other.onnx"))
    with pytest.raises(InputError, match="commands displacements, and the loop commands forces"):
        PolicyController(pilot_of(model, "force"), model.rest_e, Policy(saved[0]))


def test_what_is_no_policy_is_refused(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        Policy(tmp_path / "none.onnx")
    (tmp_path / "text.onnx").write_text("no model")
    with pytest.raises(InputError, match="is no policy of cfem"):
        Policy(tmp_path / "text.onnx")


@pytest.fixture(scope="module")
def moving_saved(model, tmp_path_factory):
    from cfem.gym.save_policy import save_policy

    calm = {"stiffness": 0.0, "viscosity": 0.0, "delay": 0, "noise": 0.0}
    world, path = (
        MovingWorld(moving(model), "moving-follow", 3, randomise=calm),
        tmp_path_factory.mktemp("m") / "f.onnx",
    )
    weights = 0.1 * np.random.default_rng(0).standard_normal((2, world.sizes[0]))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        save_policy(Towards(weights), path, world)
    return path, world, weights


def test_a_policy_in_a_loop_commands_what_it_commands_in_its_environment(model, moving_saved):
    """The controller of the loop sees the samples and goals of one robot of the batch, tick by tick."""
    path, world, weights = moving_saved
    world.reset(np.arange(3))
    pilot, rest_e = pilot_of(model, "force"), model.rest_e
    start = world.states.q[:2, 1] * world.model.scale[:2]
    controller = MovingPolicyController(pilot, rest_e, Policy(path), start, world.tick)
    assert controller.belief.u == pytest.approx(world.u[1], rel=1e-4)
    measured = None
    for _ in range(8):
        told = controller.tick(
            rest_e + world.goals.path[1, world.t[1] + 1], measured, rest_e + world.goals.path[1, world.t[1] + 1 :]
        )
        world.step(np.clip(world.observe() @ weights.T, -1, 1))
        assert told.u == pytest.approx(world.u[1], rel=1e-3, abs=1e-3)
        measured = SimpleNamespace(x_e=rest_e + world.states.tip[1], t=1)


def test_a_policy_of_another_rate_is_refused(model, moving_saved):
    with pytest.raises(InputError, match="trained for ticks of"):
        MovingPolicyController(pilot_of(model, "force"), model.rest_e, Policy(moving_saved[0]), None, 0.02)
