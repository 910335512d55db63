"""Plants that move between ticks, in full finite elements and condensed."""

import numpy as np
import pytest
from fe_motion.moving import moving_bar
from motion.learned import model, problem, states

from cfem.equilibrium.system.actuation import force
from cfem.fe_motion.simulate import StepControl, simulate
from cfem.fe_motion.start import at_rest
from cfem.motion.altered import Altered
from cfem.plant.fem_plant import pushed
from cfem.plant.imperfect_plant import Imperfection, ImperfectPlant
from cfem.plant.moving_plant import MovingFemPlant, MovingModelPlant

DT, SUBSTEPS = 4e-3, 4


def fem(**more):
    return MovingFemPlant(problem().robot, DT, SUBSTEPS, **more)


@pytest.mark.parametrize("kind", ["force", "displacement"])
def test_a_robot_that_stands_stays(kind):
    solved = states()[4]
    u = solved.lambda_a if kind == "force" else solved.delta_a
    plant = fem()
    stands = plant.settle(u, kind)
    np.testing.assert_allclose(stands.x_e, problem().robot.rest_e + solved.delta_e, atol=1e-6)
    for t in (1, 2, 3):
        found = plant.step(u, kind)
        assert found.t == t and found.status == "converged"
    np.testing.assert_allclose(found.x_e, stands.x_e, atol=1e-6)
    np.testing.assert_allclose(found.lambda_a, solved.lambda_a, rtol=1e-5)


def test_ticks_are_the_motion_without_ticks():
    """A ramp over some ticks, in one piece and tick by tick."""
    solved, plant = states()[4], fem()
    plant.settle(solved.lambda_a, "force")
    steps = [plant.step(solved.lambda_a * (1 + 0.1 * k), "force") for k in (1, 2, 3)]
    whole = simulate(
        plant._problems[0],
        at_rest(plant._problems[0], solved.state),
        lambda t: force(solved.lambda_a * (1 + 0.1 * t / DT)),
        3 * DT,
        pace=StepControl(DT / SUBSTEPS, tolerance=None),
    )
    assert plant.steps == len(whole.samples) - 1 == 3 * SUBSTEPS and plant.refused == 0
    np.testing.assert_allclose(steps[-1].x_e, problem().robot.rest_e + whole.samples[-1].delta_e, atol=1e-7)


@pytest.mark.parametrize("kind", ["force", "displacement"])
def test_condensed_it_moves_as_in_full(kind):
    solved = states()[4]
    u = solved.lambda_a if kind == "force" else solved.delta_a
    full, condensed = fem(), MovingModelPlant(model(), DT, SUBSTEPS)
    full.settle(u, kind)
    if kind == "force":
        condensed._motion = at_rest_of(solved.delta_a)
        condensed._told = u
    else:
        condensed.settle(u, kind)
    found = np.array(
        [[one.step(u * (1 + 0.2 * np.sin(0.6 * k) ** 2), kind).x_e for one in (full, condensed)] for k in range(1, 13)]
    )
    travel = np.linalg.norm(np.ptp(found[:, 0], axis=0))
    assert np.linalg.norm(found[:, 0] - found[:, 1], axis=1).max() < 0.03 * travel


def at_rest_of(delta_a):
    from cfem.motion.step import at_rest

    return at_rest(model(), delta_a)


def test_a_push_comes_at_its_tick():
    push = np.array([0.0, 0.02, 0.0])
    plant = fem(pushed=pushed(problem().robot, push), since=3)
    still = plant.settle(states()[4].delta_a).x_e
    found = [plant.step(states()[4].delta_a).x_e for _ in range(6)]
    np.testing.assert_allclose(found[1], still, atol=1e-6)
    assert found[5][1] - still[1] > 1e-3
    condensed = MovingModelPlant(model(), DT, SUBSTEPS, push, 3)
    begin = condensed.settle(states()[4].delta_a).x_e
    moved = [condensed.step(states()[4].delta_a).x_e for _ in range(6)]
    np.testing.assert_allclose(moved[5] - begin, found[5] - still, atol=0.1 * np.linalg.norm(found[5] - still))


def test_a_moving_plant_is_asked_at_each_tick():
    """One at rest that is told the same is not."""
    bare = MovingModelPlant(Altered(model(), 1.1), DT, 1)
    plant = ImperfectPlant(bare, Imperfection(delay=1), 0)
    plant.settle(np.array([1.5]))
    first = plant.step(np.array([2.0]))
    seen = [plant.step(np.array([2.0])) for _ in range(4)]
    assert first.t == 0 and [one.t for one in seen] == [1, 2, 3, 4]
    assert len({tuple(one.x_e) for one in seen}) == 4


def test_what_cannot_be_done_is_a_measurement_that_says_so():
    plant = MovingModelPlant(model(), DT, 1)
    plant.settle(np.array([1.5]))
    failed = plant.step(np.array([np.nan]))
    assert np.isnan(failed.x_e).all() and "not found" in failed.status


def test_bars_without_density_say_so():
    from dataclasses import replace

    from cfem.core.errors import CfemError

    robot = replace(moving_bar().robot, density=None)
    with pytest.raises(CfemError, match="density"):
        MovingFemPlant(robot, DT, 1)
