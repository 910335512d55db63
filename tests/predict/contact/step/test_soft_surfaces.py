"""Learned robots that touch each other, against finite elements whose surfaces do the same."""

from itertools import pairwise, product

import numpy as np
import pytest
from support.fast_cases import fast_are

from cfem.contact.law.modes import Mode
from cfem.contact.obstacle import Plane
from cfem.contact.obstacle_set import ObstacleSet
from cfem.core.errors import InputError
from cfem.equilibrium.contact.patch_compliance import patch_response
from cfem.equilibrium.contact.skinned_robot import SkinnedRobot
from cfem.equilibrium.contact.surfaces import SurfaceScene as MeetingInFe
from cfem.predict.contact.step.bodies import PlacedModel
from cfem.predict.contact.step.rounds import ACCELERATED, Rounds
from cfem.predict.contact.step.scene import ContactScene, contact_step
from cfem.predict.contact.surface.patched_model import PatchedModel, patches_of
from cfem.predict.load import load_model
from cfem.predict.series.few_states import patch_states

OVER = np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, 16.0])  # the twin: upside down above, 6 mm away
HERE = np.eye(3), np.zeros(3)


@pytest.fixture(scope="module")
def patched(bar, robot):
    model = load_model(bar / "models" / "bar" / "spectral")
    patches, states = patches_of(model, 6.0), patch_states(model.domain, 1)
    return PatchedModel(model, patches, patch_response(robot, model.skin.watched, patches, states))


@pytest.fixture(scope="module")
def twins(patched):
    return [PlacedModel(patched, *pose) for pose in (HERE, OVER)]


def test_apart_they_are_free(twins, patched):
    found = ContactScene(twins).go([[0.4], [0.3]])
    assert found.converged and found.pressed == 0.0 and found.gap > 1.0
    for delta, e, lam in zip((0.4, 0.3), found.delta_e, found.lambda_a, strict=True):
        free = patched.model.at_displacement([delta])
        assert np.array_equal(e, patched.model.ends_at_displacement(np.array([delta]))[0])
        assert lam == pytest.approx(free.lambda_a, rel=1e-12)
        np.testing.assert_allclose(e, free.delta_e, rtol=0, atol=1e-12)  # mm: another order of the same sums


def test_apart_the_gap_is_that_of_the_robot_asked_for(patched):
    """Of three, one 6 mm above the first and one 8 mm below it: as in scenes of two, and of robots that rest, whose
    sides are plane, as they stand."""
    beside = np.eye(3), np.array([0.0, 0.0, -18.0])
    first, above, side = (PlacedModel(patched, *pose, itself=False) for pose in (HERE, OVER, beside))
    for deltas in ([0.0], [0.0], [0.0]), ([0.4], [0.3], [0.2]):
        scene = ContactScene([first, above, side])
        state = scene.go(deltas)
        gaps = [-scene.force_or_gap(state, number) for number in (1, 2)]
        for gap, other, delta in zip(gaps, (above, side), deltas[1:], strict=True):
            two = ContactScene([first, other])
            assert gap == pytest.approx(-two.force_or_gap(two.go((deltas[0], delta)), 1), abs=1e-12)
        if not any(deltas[0]):
            np.testing.assert_allclose(gaps, [6.0, 8.0], atol=1e-6)
        alone = ContactScene([side, first])
        assert -alone.force_or_gap(alone.go((deltas[2], deltas[0])), 1) == pytest.approx(gaps[1], abs=1e-12)


def test_two_that_press_each_other_do_as_finite_elements_do(twins, robot, patched):
    deltas = [1.0], [0.9]
    found, skin = ContactScene(twins).go(deltas), patched.model.skin
    fe = [SkinnedRobot(robot, skin.nodes, skin.triangles, patched.patches, *pose) for pose in (HERE, OVER)]
    truth = MeetingInFe(fe).go(deltas)
    assert found.converged and truth.converged and truth.pressed > 0.002
    assert found.pressed == pytest.approx(truth.pressed, rel=0.02)
    assert min(found.gap, truth.gap) > -1e-6 * robot.length
    for delta, e, lam, solved in zip(deltas, found.delta_e, found.lambda_a, truth.solved, strict=True):
        free = patched.model.at_displacement(delta)
        assert np.linalg.norm(e - solved.delta_e) < 0.1 * np.linalg.norm(solved.delta_e - free.delta_e)
        assert lam == pytest.approx(solved.lambda_a, abs=0.1 * np.abs(solved.lambda_a - free.lambda_a).max())


MU = 0.3


@pytest.fixture(scope="module")
def rubbed(twins):
    """Bars that press each other and slide, at the state before and the last one."""
    rough = ContactScene(twins, mu=MU)
    before = rough.go([np.array([1.1]), np.array([0.9])])
    return before, rough.step([np.array([1.2]), np.array([0.95])], before)


def test_friction_does_as_in_finite_elements(rubbed, robot, patched):
    skin = patched.model.skin
    fe = [SkinnedRobot(robot, skin.nodes, skin.triangles, patched.patches, *pose) for pose in (HERE, OVER)]
    rough = MeetingInFe(fe, mu=MU)
    truth = rough.step([np.array([1.2]), np.array([0.95])], rough.go([np.array([1.1]), np.array([0.9])]))
    found = rubbed[1]
    assert found.converged and truth.converged and truth.pressed > 0.01 and truth.factorizations < 12
    assert set(found.modes.values()) == {mode for mode in truth.modes.values() if mode is not Mode.OPEN}
    assert found.pressed == pytest.approx(truth.pressed, rel=0.02)
    alike = np.linalg.norm(found.push.sum(axis=0) - truth.push.sum(axis=0))
    assert alike < 0.02 * np.linalg.norm(truth.push.sum(axis=0))
    for delta, e, solved in zip(found.deltas, found.delta_e, truth.solved, strict=True):
        free = patched.model.at_displacement(delta)
        assert np.linalg.norm(e - solved.delta_e) < 0.05 * np.linalg.norm(solved.delta_e - free.delta_e)


def test_friction_of_soft_surfaces_turns_along_a_step(patched):
    """The upper bar lies across: what slides along the lower bar at first slides along the upper one afterwards. Two
    whole steps in parts, against steps 16 times shorter; in one part friction is that of the mean motion."""
    turn = np.array([[np.cos(0.4), -np.sin(0.4), 0.0], [np.sin(0.4), np.cos(0.4), 0.0], [0.0, 0.0, 1.0]])
    shift = np.array([50.0, 0.0, 16.0]) - turn @ OVER[0] @ [50.0, 0.0, 0.0]
    crossed = [PlacedModel(patched, *HERE, itself=False), PlacedModel(patched, turn @ OVER[0], shift, itself=False)]
    way = [np.array([1.5, 0.9]), np.array([1.6, 0.9]), np.array([1.6, 1.0])]

    pressed = ContactScene(crossed, mu=MU).go([way[0][:1], way[0][1:]])

    def walked(times, parts):
        scene, state = ContactScene(crossed, mu=MU, parts=parts), pressed
        for begin, end in pairwise(way):
            for share in np.arange(1, times + 1) / times:
                target = begin + share * (end - begin)
                state = scene.step([target[:1], target[1:]], state)
                assert state.converged
        return np.append(np.concatenate(state.delta_e), state.pressed), [*state.modes.values()]

    (exact, modes), (one_part, _), (parts, _) = walked(16, 1), walked(1, 1), walked(1, 16)
    assert modes == [Mode.SLIP]
    assert np.abs(parts - exact).max() < 0.3 * np.abs(one_part - exact).max()


@pytest.mark.parametrize("mu", fast_are({MU}, [0.0, MU]))
def test_a_pushed_robot_lets_its_cable_go_as_in_finite_elements(robot, patched, mu):
    """A bar that bends up from below lifts the other one beyond what its cable bends it, then goes down again."""
    places, skin = [HERE, (np.eye(3), np.array([0.0, 0.0, -16.0]))], patched.model.skin
    meeting = ContactScene([PlacedModel(patched, *one, unilateral=robot.unilateral) for one in places], mu=mu)
    fe = [SkinnedRobot(robot, skin.nodes, skin.triangles, patched.patches, *pose) for pose in places]
    truth, found, solved, slack = MeetingInFe(fe, mu=mu), None, None, []
    for deltas in ([0.05, 1.65], [0.05, 2.2], [0.05, 1.9], [0.3, 2.2]):
        deltas = [np.array([one]) for one in deltas]
        found, solved = meeting.go(deltas, found), truth.go(deltas, solved)
        assert found.converged and solved.converged
        slack.append(bool(solved.solved[0].slack[0]))
        assert slack[-1] == (found.lambda_a[0][0] == 0.0) == (found.deltas[0][0] > deltas[0][0])
        assert found.pressed == pytest.approx(solved.pressed, rel=0.01)
        for e, at, lam, one in zip(found.delta_e, found.deltas, found.lambda_a, solved.solved, strict=True):
            assert np.linalg.norm(e - one.delta_e) < 0.01
            assert at == pytest.approx(one.delta_a, abs=1e-3) and lam == pytest.approx(one.lambda_a, abs=1e-3)
    assert slack == [False, True, True, False]


def test_forces_and_moments_balance_and_friction_takes_energy(rubbed):
    """Of normal forces and of friction, each; what slides is held back by all the friction that there is."""
    before, found = rubbed
    pairs = found.pairs
    normal = found.pressing[:, None] * pairs.frames[:, 0]
    for push in (normal, found.push - normal):
        forces = pairs.relative.T @ push
        assert np.abs(forces.sum(axis=0)).max() < 1e-9 * found.pressed
        assert np.abs(np.cross(found.places, forces).sum(axis=0)).max() < 1e-5 * found.pressed
    pressing = found.push.any(axis=1)
    touching, push = pairs.some(pressing), found.push[pressing]
    assert np.abs(touching.gaps).max() < 1e-6
    slips = before.memory.slips(touching, found.places)
    friction = (touching.frames[:, 1:] @ push[:, :, None])[..., 0]
    assert np.linalg.norm(slips, axis=1).min() > 1e-3
    assert np.linalg.norm(friction, axis=1) == pytest.approx(MU * found.pressing[pressing], rel=1e-6)
    taken = -(friction * slips).sum(axis=1)
    assert taken == pytest.approx(np.linalg.norm(friction, axis=1) * np.linalg.norm(slips, axis=1), rel=1e-6)


@pytest.mark.parametrize("mu", fast_are({MU}, [0.0, MU]))
def test_the_work_of_the_cables_along_a_closed_way_is_what_friction_takes(twins, mu):
    """Without friction nothing, but for 5 % of that: where faces are is not part of the normal's derivative."""
    meeting, worked, taken, size = ContactScene(twins, mu=mu), 0.0, 0.0, 0.0
    corners = [(1.0, 0.9), (1.1, 0.9), (1.1, 1.0), (1.0, 1.0)]
    at = meeting.go([np.array([one]) for one in (1.0, 0.9)])
    ways = [(a, b) for a, b in zip(corners, [*corners[1:], corners[0]], strict=True)]
    for lap in (0, 1):  # the first one forgets how it began
        for (a, b), share in product(ways, np.arange(1, 9) / 8):
            now = meeting.step([np.array([x + share * (y - x)]) for x, y in zip(a, b, strict=True)], at)
            assert now.converged
            if lap:
                means = [(x + y) / 2 for x, y in zip(at.lambda_a, now.lambda_a, strict=True)]
                steps = [y - x for x, y in zip(at.deltas, now.deltas, strict=True)]
                worked += float(np.vdot(means, steps))
                slid = np.flatnonzero(now.push.any(axis=1))
                slid_ones = now.pairs.some(slid)
                known = at.memory.with_new(slid_ones, at.places, now.places, now.places)
                slips = known.slips(slid_ones, now.places)
                friction = (now.pairs.frames[slid, 1:] @ now.push[slid, :, None])[..., 0]
                taken -= float((friction * slips).sum())
                size += float((now.pressing[slid] * np.linalg.norm(slips, axis=1)).sum())
            at = now
    assert taken == pytest.approx(mu * size, rel=0.05, abs=1e-9)
    assert worked == pytest.approx(taken, abs=0.05 * MU * size)


def test_answers_combined_take_fewer_rounds_to_the_same_states(twins, monkeypatch):
    """The more the robots press each other, the slower plain rounds settle: faces turn with what presses on them."""
    ways = {}
    for accelerated in (0, ACCELERATED):
        monkeypatch.setattr(f"{Rounds.__module__}.ACCELERATED", accelerated)
        scene, state, ways[accelerated] = ContactScene(twins, mu=MU), None, []
        for share in np.arange(13) / 10:
            deltas = [np.array([1.6 * share]), np.array([share])]
            state = scene.start(deltas) if state is None else scene.step(deltas, state)
            assert state.converged
            ways[accelerated].append(state)
    plain, combined = ways.values()
    for a, b in zip(plain, combined, strict=True):
        np.testing.assert_allclose(b.forces, a.forces, rtol=0, atol=1e-5 * max(a.pressed, 1e-3))
    assert plain[-1].pressed > 0.02
    rounds = [sum(state.iterations for state in states) for states in (plain, combined)]
    assert rounds[1] < 0.85 * rounds[0], rounds


def test_what_sticks_stays_where_it_is_on_the_other(twins, rubbed):
    """A cable is let off a little: friction turns round, and holds before it lets go again."""
    meeting, there = ContactScene(twins, mu=MU), rubbed[1]
    deltas = np.array([1.1995]), np.array([0.95])
    back = meeting.step(deltas, there)
    assert back.converged and set(back.modes.values()) == {Mode.STICK}
    slot = next(iter(back.modes))
    held = back.pairs.some(back.pairs.slots == slot)
    assert np.abs(there.memory.slips(held, back.places)).max() < 1e-6
    assert not np.allclose(back.push[back.pairs.slots == slot], there.push[there.pairs.slots == slot], rtol=1e-3)


def test_the_way_does_not_matter_without_friction(twins):
    scene = ContactScene(twins)
    found = scene.go([[1.0], [0.9]])
    onwards = scene.go([[1.0], [0.9]], scene.go([[0.95], [0.85]]))
    assert onwards.pressed == pytest.approx(found.pressed, rel=1e-4)


def test_one_robot_among_obstacles_alone_does_as_a_touched_one(patched):
    ceiling = Plane(R=np.diag([1.0, -1.0, -1.0]), t=np.array([0.0, 0.0, 8.0]))
    found = ContactScene([PlacedModel(patched, itself=False)], ObstacleSet((ceiling,))).go([[1.2]])
    truth = contact_step(patched, np.array([1.2]), [ceiling])
    assert truth.forces.any() and found.between(0, 1) == pytest.approx(truth.between(0, 1), rel=1e-6)
    assert found.delta_e[0] == pytest.approx(truth.delta_e[0], abs=1e-8)
    assert found.lambda_a[0] == pytest.approx(truth.lambda_a[0], rel=1e-6)


def test_a_straight_robot_does_not_touch_itself(patched):
    found = ContactScene([PlacedModel(patched)]).go([[2.0]])
    assert found.converged and found.pressed == 0.0
    assert np.array_equal(found.delta_e[0], patched.model.ends_at_displacement(np.array([2.0]))[0])


def test_robots_that_overlap_at_first_are_refused(patched):
    inside = PlacedModel(patched, OVER[0], np.array([0.0, 0.0, 9.0]))
    with pytest.raises(InputError, match=r"overlap by (0\.[89]\d*|1(\.\d+)?) mm where their actuators are at 0"):
        ContactScene([PlacedModel(patched), inside]).go([[0.1], [0.1]])
