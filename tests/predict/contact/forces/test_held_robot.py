"""What all forces on a robot at held actuators have in common: found once, and what contact takes for its local
flexibility."""

from dataclasses import replace

import numpy as np
from scipy.linalg import block_diag

from cfem.contact.obstacle import Plane
from cfem.contact.obstacle_set import ObstacleSet
from cfem.predict.contact.forces.held_robot import HELD, HeldRobot, held, stiff_flexibility
from cfem.predict.contact.step.bodies import PlacedModel
from cfem.predict.contact.step.scene import ContactScene

DELTA = np.array([2.0])


def test_it_is_the_harmonic_mean_of_the_eigenvalues_and_zero_where_the_body_is_held():
    factors = np.random.default_rng(0).normal(size=(6, 3, 3))
    compliance = factors @ factors.swapaxes(1, 2)
    expected = 3 / (1 / np.linalg.eigvalsh(compliance)).sum(axis=1)
    np.testing.assert_allclose(stiff_flexibility(block_diag(*compliance)), expected, rtol=1e-9)
    np.testing.assert_array_equal(stiff_flexibility(np.zeros((6, 6))), [0.0, 0.0])


def test_robots_of_one_model_that_stay_are_evaluated_once(patched_bar, monkeypatch):
    """Two of them, beside each other under a plate that comes down in three steps."""
    model, asked, points = replace(patched_bar), [], []
    kinds = {HeldRobot: "__init__", type(model.model): "ends_at_displacement"}
    for kind, name in kinds.items():
        function = getattr(kind, name)
        monkeypatch.setattr(kind, name, lambda *given, function=function: asked.append(function) or function(*given))
    compliance = type(model).compliance
    monkeypatch.setattr(
        type(model), "compliance", lambda *given: points.append(given[1].tolist()) or compliance(*given)
    )
    robots = [PlacedModel(model, t=np.array([0.0, 40.0 * i, 0.0]), itself=False) for i in range(2)]
    top, state = model.model.shape(DELTA)[:, 2].max(), None
    for depth in (0.2, 0.4, 0.4):
        plate = Plane(R=np.diag([1.0, -1.0, -1.0]), t=np.array([0.0, 0.0, top - depth]))
        state = ContactScene(robots, ObstacleSet((plate,)), meet=False).step([DELTA, DELTA.copy()], state)
    assert state.converged and state.forces.any()
    assert len(asked) == len(set(asked)) == 2
    assert points and all(points.count(each) == 1 for each in points)  # whichever robot has them


def test_few_states_are_kept(patched_bar):
    model = replace(patched_bar)
    first = held(model, DELTA)
    assert held(model, DELTA.copy()) is first and held(model, DELTA, np.zeros(model.model.rows.n_e)) is not first
    for i in range(HELD):
        held(model, DELTA + 0.01 * i)
    assert held(model, DELTA + 0.01) is held(model, DELTA + 0.01) and len(model.kept) == HELD


def test_a_wrench_moves_rows_as_the_compliance_under_it_says(patched_bar):
    """Rows are of second order in the wrench, and the compliance, their derivative, of first: central differences of
    rows are exact."""
    wrench, step = np.array([0.02, -0.03, 0.05]), 1e-3
    by_wrench = HeldRobot(patched_bar, DELTA, wrench).C_es
    for axis, along in enumerate(step * np.eye(3)):
        behind, ahead = (HeldRobot(patched_bar, DELTA, wrench + side * along).rows for side in (-1, 1))
        np.testing.assert_allclose((ahead - behind) / (2 * step), by_wrench[axis], rtol=1e-6, atol=1e-9)
    assert np.abs(by_wrench - HeldRobot(patched_bar, DELTA, None).C_es).max() > 1e-4
