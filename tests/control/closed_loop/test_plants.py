"""Plants are built as the spec says."""

from types import SimpleNamespace

import numpy as np
import pytest
from control.motion.bar import DT
from control.motion.bar import robot as moving_robot

from cfem.condensed import Rows
from cfem.control.closed_loop import plants
from cfem.control.closed_loop.plants import _fem_plants, plants_of, push_of
from cfem.control.closed_loop.spec import LoopSpec, RealSpec
from cfem.core.errors import SpecError
from cfem.motion.altered import Altered
from cfem.plant.fem_plant import FemPlant, pushed
from cfem.plant.imperfect_plant import Imperfection, ImperfectPlant
from cfem.plant.moving_plant import MovingModelPlant
from cfem.plant.walled_plant import WalledPlant

PUSH = np.array([0.0, 2e-3, -1e-3])
LEAST = {
    "command": {"kind": "displacement"},
    "settle": {"radius": "1 mm", "hold": "1 s"},
    "controllers": {"a": {"mode": "open"}},
}


def spec(real, **loop):
    loop = SimpleNamespace(**{"real": RealSpec.model_validate(real), "moving": None, "rate": 1 / DT} | loop)
    return SimpleNamespace(loop=loop, plant="model", scene="pipelines/bar/scene.yaml", mesh="data/bar/mesh", loads={})


@pytest.mark.parametrize("push", [None, PUSH])
def test_a_wall_of_any_normal_is_at_its_point_for_the_robot_and_the_pushed_one(bar, robot, push):
    real = {"wall": {"point": {"mm": [1, 2, 3]}, "normal": [0, 3, 4]}}
    plain, moved = _fem_plants(spec(real), bar, None, push, 5)
    both = [plain] if push is None else [plain, moved]
    assert all(isinstance(one, WalledPlant) for one in both) and (moved is None) == (push is None)
    for one in both:
        np.testing.assert_allclose(one._wall.normal, [0, 0.6, 0.8])
        np.testing.assert_array_equal(one._wall.point, [1, 2, 3])
    assert plain._robot.loads is None
    if push is not None:
        np.testing.assert_allclose(moved._robot.loads, pushed(robot, push).loads)


@pytest.mark.parametrize("push", [None, PUSH])
def test_without_a_wall_finite_elements_are_free(bar, robot, push):
    plain, moved = _fem_plants(spec({}), bar, None, push, 5)
    u = np.array([0.4])
    np.testing.assert_array_equal(plain.step(u).x_e, FemPlant(robot).step(u).x_e)
    assert (moved is None) == (push is None)
    if push is not None:
        np.testing.assert_array_equal(moved.step(u).x_e, FemPlant(pushed(robot, push)).step(u).x_e)


def test_a_model_that_moves_is_altered_as_is_stated_and_takes_the_push_itself():
    rows = Rows(("tip.x", "tip.y", "tip.z"), ("a",))
    force = {"tick": 3, "force": {"mN": [0, 20, 10]}}
    text = {"rate": f"{1 / DT} Hz", "moving": {"substeps": 3}, "real": {"stiffer": 1.2, "viscosity": 0.8}}
    text |= {"sensor": {"noise": "0.01 mm", "delay": 2}, "disturbance": force, **LEAST}
    whole = SimpleNamespace(loop=LoopSpec.model_validate(text), plant="model")
    body = SimpleNamespace(rest_e=moving_robot().rest_e, rows=rows)
    made = plants_of(whole, None, body, {"first": None, "other": None}, {"first": moving_robot(), "other": None})
    rate = whole.loop.rate
    by_hand = MovingModelPlant(Altered(moving_robot(), 1.2, 0.8), 1 / rate, 3, np.array([0.0, 0.02, 0.01]), 3)
    expected = ImperfectPlant(by_hand, Imperfection(0.01, 1.0, 2, 0.0), 7)
    with made(7) as plant:
        for u in (0.2, 0.4, 0.4, 0.3, 0.3):
            found, other = plant.step(np.array([u])), expected.step(np.array([u]))
            np.testing.assert_array_equal(found.x_e, other.x_e)
            np.testing.assert_array_equal(plant.actual.x_e, expected.actual.x_e)


def test_a_disturbance_is_on_the_first_effector_since_its_tick():
    body = SimpleNamespace(rows=SimpleNamespace(n_e=6))
    assert push_of(SimpleNamespace(disturbance=None), body) == (None, 0)
    loop = SimpleNamespace(disturbance=SimpleNamespace(force=PUSH, tick=4))
    push, since = push_of(loop, body)
    np.testing.assert_array_equal(push, [*PUSH, 0, 0, 0])
    assert since == 4
    np.testing.assert_array_equal(push_of(loop, SimpleNamespace(rows=SimpleNamespace(n_e=3)))[0], PUSH)
    with pytest.raises(SpecError, match="rows x, y, z"):
        push_of(loop, SimpleNamespace(rows=SimpleNamespace(n_e=2)))


def test_a_drift_begins_anew_in_each_run(monkeypatch):
    asked = []
    monkeypatch.setattr(plants, "DriftingPlant", lambda plant, *how: asked.append((plant, *how)) or plant)
    text = {"rate": "50 Hz", "real": {"drift": {"stiffness": 0.9, "within": "2 s"}}}
    loop = LoopSpec.model_validate(text | LEAST)
    body = SimpleNamespace(rest_e=np.zeros(3), rows=SimpleNamespace(n_e=3), unilateral=np.zeros(0, dtype=bool))
    made = plants_of(SimpleNamespace(loop=loop, plant="model"), None, body, {"first": None}, {})
    for seed in (1, 2):
        with made(seed):
            pass
    assert [how for _, *how in asked] == [[0.9, 100]] * 2
