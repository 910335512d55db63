"""A learned robot that touches anything anywhere, against finite elements whose surface touches the same."""

from dataclasses import replace

import numpy as np
import pytest
from support.forces import compliance_of, put
from support.obstacle_step import obstacle_step

from cfem.contact.obstacle import Box, Capsule, Plane, Sphere
from cfem.contact.step_status import StepStatus
from cfem.core.errors import InputError, SpecError
from cfem.equilibrium.contact.patch_compliance import patch_response, with_patches
from cfem.equilibrium.newton import NewtonSettings
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import Actuation, displacement
from cfem.equilibrium.system.problem import Problem
from cfem.predict.contact.forces.loaded_robots import LoadedRobots
from cfem.predict.contact.step.on_obstacles import TOLERANCE
from cfem.predict.contact.step.scene import contact_step
from cfem.predict.contact.step.state import TRUSTED

DELTA = np.array([2.0])


@pytest.fixture(scope="module")
def patched(patched_bar):
    return patched_bar


def wall(patched, depth, delta=DELTA):
    """A plane that the foremost patches are `depth` mm behind."""
    places = patched.patches.mean(patched.model.shape(delta))
    normal = np.array([0.0, -1.0, 0.0])
    t = places[np.argmax(places @ -normal)] + depth * normal
    turn = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])  # z of the plane along the normal
    return Plane(R=turn, t=t)


@pytest.mark.parametrize("mu", [-1.0, np.nan, np.inf])
def test_what_is_no_friction_is_refused(patched, mu):
    with pytest.raises(SpecError, match="coefficient of friction"):
        contact_step(patched, DELTA, [wall(patched, 0.1)], mu=mu)


@pytest.mark.parametrize("mu", [0.0, 0.3, 1.5])
def test_what_makes_no_difference_makes_none(patched, mu):
    """Neither a second obstacle in the place of the first, nor one far away, nor their order, nor how the same body is
    called and turned about itself."""
    places = patched.patches.mean(patched.model.shape(DELTA))
    at = places[np.argmax(places[:, 0] - places[:, 1])]
    ball = Sphere(8.0, t=at + np.array([1.0, -7.5, 0.4]))
    far = Box(np.ones(3), t=np.array([0.0, 900.0, 0.0]))
    found = contact_step(patched, DELTA, [ball], mu=mu)
    assert found.converged and found.forces.any()
    turned = Sphere(8.0, R=np.array([[0, 1.0, 0], [0, 0, 1.0], [1.0, 0, 0]]), t=ball.t)
    for others in ([ball, ball], [far, ball], [ball, far], [turned], [Capsule(8.0, 0.0, t=ball.t)]):
        same = contact_step(patched, DELTA, others, mu=mu)
        assert same.converged and same.delta_e[0] == pytest.approx(found.delta_e[0], abs=1e-8 * patched.model.length)
        largest = np.abs(found.forces).max()
        assert same.forces == pytest.approx(found.forces, abs=1e-6 * largest)


def test_without_obstacles_in_reach_it_is_the_model(patched):
    far = Sphere(5.0, t=np.array([0.0, 500.0, 0.0]))
    found, free = contact_step(patched, DELTA, [far]), patched.model.at_displacement(DELTA)
    assert found.converged and not len(found.pairs)
    assert np.array_equal(found.delta_e[0], patched.model.ends_at_displacement(DELTA)[0])
    np.testing.assert_allclose(found.delta_e[0], free.delta_e, atol=1e-12)
    np.testing.assert_allclose(found.lambda_a[0], free.lambda_a, rtol=1e-12)
    assert np.allclose(patched.model.skin.surface(found.rows[0]), patched.model.shape(DELTA), atol=1e-12)


@pytest.mark.parametrize("depth", [0.1, 0.4])
def test_a_wall_pushes_it_as_it_pushes_finite_elements(patched, robot, depth):
    obstacle = wall(patched, depth)
    found, free = contact_step(patched, DELTA, [obstacle]), patched.model.at_displacement(DELTA)
    assert found.converged and len(found.pairs)
    near = np.flatnonzero(obstacle.distance(patched.patches.mean(patched.model.shape(DELTA))) < 2.0)
    touched = with_patches(robot, patched.model.skin.nodes, patched.patches, near)
    truth = obstacle_step(Problem(touched), displacement(DELTA), [obstacle] * len(near))
    assert truth.converged
    (solved,) = truth.solved
    force = solved.lambda_c.reshape(-1, 3).sum(axis=0)
    assert np.linalg.norm(found.forces.sum(axis=0) - force) < 0.06 * np.linalg.norm(force)
    moved = np.linalg.norm(solved.delta_e - free.delta_e)
    assert moved > depth / 2
    assert np.linalg.norm(found.delta_e[0] - solved.delta_e) < 0.06 * moved
    change = np.abs(solved.lambda_a - free.lambda_a).max()
    assert np.abs(found.lambda_a[0] - solved.lambda_a).max() < 0.1 * change


@pytest.mark.parametrize("mu", [0.0, 0.5])
def test_a_cable_that_would_have_to_push_goes_slack_as_in_finite_elements(patched, robot, mu):
    """A ball lifts the bar farther than its cable bends it, then comes down again."""
    delta, found, truth = np.array([0.3]), None, None
    places = patched.patches.mean(patched.model.shape(delta))
    at = places[np.argmin(places[:, 2] - places[:, 0] / 10)]  # below, near the tip
    near = np.flatnonzero(np.linalg.norm(places - at, axis=1) < 9.0)
    problem = Problem(with_patches(robot, patched.model.skin.nodes, patched.patches, near))
    slack = []
    for depth in (0.3, 2.0, 2.5, 0.2):
        ball = Sphere(8.0, t=at + np.array([0.0, 0.0, depth - 8.0]))
        held = contact_step(patched, delta, [ball], mu=mu, before=found)
        found = contact_step(patched, delta, [ball], mu=mu, before=found, unilateral=robot.unilateral)
        truth = obstacle_step(problem, displacement(delta), [ball] * len(near), mu=mu, before=truth)
        (solved,) = truth.solved
        assert found.converged and truth.converged
        slack.append(bool(solved.slack[0]))
        assert slack[-1] == (held.lambda_a[0][0] < 0) == (found.lambda_a[0][0] == 0.0)
        force = solved.lambda_c.reshape(-1, 3).sum(axis=0)
        assert np.linalg.norm(found.forces.sum(axis=0) - force) < 0.03 * np.linalg.norm(force)
        assert found.deltas[0] == pytest.approx(solved.delta_a, abs=0.03 * max(solved.delta_a[0] - delta[0], 1e-9))
        assert np.linalg.norm(found.delta_e[0] - solved.delta_e) < 0.03 * depth
    assert slack == [False, True, True, False]


@pytest.mark.parametrize("mu", [0.0, 0.5])
def test_what_it_answers_obeys_the_law(patched, mu):
    obstacle = wall(patched, 0.5)
    found = contact_step(patched, DELTA, [obstacle], mu=mu)
    assert found.converged
    normal, tangents = found.push @ obstacle.R[:, 2], found.push @ obstacle.R[:, :2]
    assert (normal >= -1e-12).all() and normal.max() > 0
    assert (np.linalg.norm(tangents, axis=1) <= mu * normal + 1e-9).all()
    assert found.pairs.gaps.min() > -1e-6 * patched.model.length
    assert (np.abs(found.pairs.gaps[normal > 1e-9]) < 1e-6 * patched.model.length).all()


def test_what_is_stored_is_the_work_of_the_forces(patched):
    """Of forces that grow, which bend the bar and dent it: the integral of forces over places."""
    held, patches = LoadedRobots.of(patched, DELTA), np.array([4, 9, 21])
    forces = np.array([[2.0, 1.0, -30.0], [1.0, 20.0, 4.0], [-9.0, 3.0, 20.0]]) * 1e-3
    work, shares = 0.0, np.linspace(0.0, 1.0, 41)
    places = []
    for share in shares:
        put(held, patches, share * forces)
        places.append(held.places[patches])
    for first, second, a, b in zip(shares, shares[1:], places, places[1:], strict=False):
        work += (first + second) / 2 * float((forces * (b - a)).sum())
    assert held.answers.stored == pytest.approx(work, rel=1e-4)
    assert held.answers.error > 0.002


def off_the_law(patched, delta, obstacle, mu, found, before):
    """mm by which patches are off: those that bear from the surface; those that stick from where friction holds them,
    along the surface; those that slide from the line of their friction. Where they are follows from the forces anew."""
    held = LoadedRobots.of(patched, delta)
    begin = held.free if before is None else np.where(np.isnan(before.stuck), before.places, before.stuck)
    patches = found.pairs.points
    put(held, patches, found.push)
    places, off = held.places[patches], []
    for x, force, slip in zip(places, found.push, places - begin[patches], strict=True):
        normal = obstacle.normals(x[None])[0]
        pressing, slip = force @ normal, slip - (slip @ normal) * normal
        friction = force - pressing * normal
        size = np.linalg.norm(friction)
        assert size <= mu * pressing * (1 + 1e-7)
        along = -friction / size if size > mu * pressing * (1 - 1e-7) else np.zeros(3)
        assert slip @ along >= -TOLERANCE * patched.model.length
        off += [abs(obstacle.distance(x[None])[0]), np.linalg.norm(slip - (slip @ along) * along)]
    return max(off)


@pytest.mark.parametrize("mu", [0.3, 1.5])
@pytest.mark.parametrize("kind", ["sphere", "capsule", "edge", "plane"])
def test_what_sticks_and_slides_obeys_the_law_to_the_tolerance(patched, kind, mu):
    """Of what sticks on something curved, more than the gap has to be known at the end of a round."""
    places = patched.patches.mean(patched.model.shape(DELTA))
    at, before = places[np.argmax(places[:, 2])], None
    lying, half = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]]), np.sqrt(0.5)
    on_edge = np.array([[1.0, 0, 0], [0, half, -half], [0, half, half]])
    for depth, delta in ((0.3, DELTA), (0.3, DELTA + 0.05), (0.5, DELTA + 0.05)):
        obstacle = {
            "sphere": Sphere(6.0, t=at + [1.0, 0.5, 6.0 - depth]),
            "capsule": Capsule(3.0, 8.0, R=lying, t=at + [0, 1.0, 3.0 - depth]),
            "edge": Box(np.full(3, 3.0), R=on_edge, t=at + [0, 0.05, 3 * np.sqrt(2) - depth]),
            "plane": Plane(R=np.diag([1.0, -1.0, -1.0]), t=at - [0, 0, depth]),
        }[kind]
        found = contact_step(patched, delta, [obstacle], mu=mu, before=before)
        assert found.converged and found.forces.any()
        off = off_the_law(patched, delta, obstacle, mu, found, before)
        assert off < 3 * TOLERANCE * patched.model.length
        before = found
    assert found.iterations <= 5


def test_a_step_that_is_too_long_says_so(patched):
    """A plate comes edge first. In short steps its edge pushes the patch before it; in one long step the side of the
    plate is nearer by then. A ball that pushes the tip along the bar bends it by more than the model knows."""
    places = patched.patches.mean(patched.model.shape(DELTA))
    at = places[np.argmax(places[:, 2])]

    def plate(depth):
        return Box(np.array([0.5, 3.0, 3.0]), t=at + [0.1, 0, 3.0 - depth])

    steps, before = [], None
    for depth in np.arange(1, 11) / 10:
        before = contact_step(patched, DELTA, [plate(depth)], before=before)
        steps.append(before)
    assert all(one.converged and one.trusted for one in steps)
    far = contact_step(patched, DELTA, [plate(1.0)])
    assert far.converged and far.deep and not far.trusted
    assert np.abs(far.push).max(axis=0).argmax() == 0 and np.abs(before.push).max(axis=0).argmax() == 2
    tip = places[np.argmax(places[:, 0])]
    pushed = contact_step(patched, DELTA, [Sphere(20.0, t=tip + [19.0, 0, 0])], mu=1.5)
    assert not pushed.deep and pushed.error > TRUSTED and not pushed.trusted


@pytest.mark.parametrize(("axis", "depths"), [(2, (2.0, 8.0)), (0, (0.05, 0.8))])
def test_what_is_trusted_is_within_5_percent_of_finite_elements(patched, robot, axis, depths):
    """A wall comes from below, and along the bar. The forces of the last step are more than 10 % off."""
    places, normal = patched.patches.mean(patched.model.shape(DELTA)), np.eye(3)[axis] * (1 if axis == 2 else -1)
    at = places[np.argmin(places @ normal)]
    turn = np.eye(3) if axis == 2 else np.array([[0.0, 0, -1], [0, 1, 0], [1, 0, 0]])  # z along the normal
    near = np.flatnonzero((places - at) @ normal < 3.0)
    problem = Problem(with_patches(robot, patched.model.skin.nodes, patched.patches, near))
    found, truth, states = None, None, []
    for depth in depths:
        obstacle = Plane(R=turn, t=at + depth * normal)
        found = contact_step(patched, DELTA, [obstacle], before=found)
        truth = obstacle_step(problem, displacement(DELTA), [obstacle] * len(near), before=truth)
        assert found.converged and truth.converged
        force = truth.solved[0].lambda_c.reshape(-1, 3).sum(axis=0)
        off = np.linalg.norm(found.forces.sum(axis=0) - force) / np.linalg.norm(force)
        states.append((found.trusted, found.deep, bool(off < 0.05), bool(off > 0.1)))
    assert states == [(True, False, True, False), (False, False, False, True)]


def test_a_patch_that_sticks_while_the_cable_lets_go_slides_where_that_of_finite_elements_does(patched, robot):
    """Under a ceiling, which bends the bar beyond what its model knows. The body softens. Where its compliance jumps to
    an indefinite one, a patch that sticks has no state, and rounds lead from one to the next and back."""
    ceiling = Plane(R=np.diag([1.0, -1.0, -1.0]), t=np.array([0.0, 0.0, 9.0]))
    places = patched.patches.mean(patched.model.shape([7.0]))
    near = np.flatnonzero((places[:, 2] > 5) & (places[:, 0] > 40))
    problem = Problem(with_patches(robot, patched.model.skin.nodes, patched.patches, near))
    found, truth, rounds, off = None, None, 0, []
    for delta in [*np.linspace(1.0, 7.2, 12), *np.linspace(7.1, 4.8, 16)]:
        found = contact_step(patched, [delta], [ceiling], mu=0.4, before=found)
        truth = obstacle_step(problem, displacement(np.array([delta])), [ceiling] * len(near), mu=0.4, before=truth)
        assert found.converged and truth.converged
        force = truth.solved[0].lambda_c.reshape(-1, 3).sum(axis=0)
        off.append(np.linalg.norm(found.forces.sum(axis=0) - force) / np.linalg.norm(force))
        rounds += found.iterations
    assert max(off) < 0.4 and off[-1] < 0.2  # 0.3 where it softens most; of the branch beyond it 1.2
    assert not found.trusted and rounds < 100


@pytest.mark.parametrize("delta", [8.5, 12.0, -3.0])
def test_actuators_beyond_what_the_model_was_trained_on_are_not_trusted(patched, delta):
    far = Sphere(5.0, t=np.array([0.0, 500.0, 0.0]))
    found = contact_step(patched, [delta], [far])
    assert found.converged and found.outside and not found.trusted
    assert not contact_step(patched, [7.5], [far]).outside


def test_what_began_too_deep_is_not_known_until_it_lets_go(patched):
    """The next steps are short, and the patch stays on the side on which the long one has put it."""
    places = patched.patches.mean(patched.model.shape(DELTA))
    plate = Box(np.array([0.5, 3.0, 3.0]), t=places[np.argmax(places[:, 2])] + [0.1, 0, 2.0])
    far = contact_step(patched, DELTA, [plate])
    later = contact_step(patched, DELTA, [plate], before=far)
    assert later.converged and later.forces.any() and later.deep and not later.trusted
    away = contact_step(patched, DELTA, [replace(plate, t=plate.t + [0, 0, 9.0])], before=later)
    again = contact_step(patched, DELTA, [replace(plate, t=plate.t + [0, 0, 9.0])], before=away)
    assert not again.forces.any() and again.trusted


def test_friction_holds_what_slides_without_it(patched):
    """The cable pulls on while a patch stands at a wall: with friction it stays where it was."""
    obstacle = wall(patched, 0.3)
    slips = []
    for mu in (0.0, 5.0):
        first = contact_step(patched, DELTA, [obstacle], mu=mu)
        second = contact_step(patched, DELTA + 0.02, [obstacle], mu=mu, before=first)
        both = np.intersect1d(first.pairs.points, second.pairs.points)[0]
        (before,), (after,) = (one.places[[both]] for one in (first, second))
        slips.append(np.linalg.norm(obstacle.R[:, :2].T @ (after - before)))
    assert slips[1] < 1e-6 < 1e-3 < slips[0]


@pytest.mark.parametrize("mu", [0.0, 0.5])
def test_what_no_longer_touches_is_free_and_holds_nothing(patched, mu):
    pressed = contact_step(patched, DELTA, [wall(patched, 0.3)], mu=mu)
    away = contact_step(patched, DELTA, [wall(patched, -5.0)], mu=mu, before=pressed)
    assert pressed.forces.any() and away.converged
    assert not len(away.pairs) and not len(away.modes) and np.isnan(away.stuck).all()


def test_the_forces_of_actuators_are_those_of_the_loaded_energy(patched):
    rng, h, none = np.random.default_rng(0), 1e-4, np.zeros(0)
    w, skin = 0.05 * rng.normal(size=len(patched.model.skin)), patched.model.skin

    def help_(delta):
        return w @ skin.rows(delta, none) + w @ skin.compliance(delta, none)[1] @ w / 2

    slope = (help_(DELTA + h) - help_(DELTA - h)) / (2 * h)
    work = w @ skin.gradient(DELTA, none) + w @ skin.compliance_slopes(DELTA, none)[1][0] @ w / 2
    assert work == pytest.approx(slope, rel=1e-5)


def test_more_patches_than_can_touch_at_once_are_named(patched, monkeypatch):
    monkeypatch.setattr("cfem.predict.contact.surface.surface_model.SurfaceModel.most", 1)
    assert contact_step(patched, DELTA, [wall(patched, 3.0)]).status is StepStatus.MANY


def test_patches_cover_the_surface(patched):
    patches, skin = patched.patches, patched.model.skin
    assert np.allclose(np.bincount(patches.of, patches.shares), 1.0)
    assert np.array_equal(np.sort(np.concatenate(patches.members)), np.arange(len(skin.rest)))
    assert np.allclose(patches.mean(skin.rest), patches.rest)
    assert (np.linalg.norm(skin.rest - patches.rest[patches.of], axis=1) < 2 * 8.0).all()


def test_what_does_not_fit_is_refused(patched):
    with pytest.raises(InputError, match="compliance of"):
        replace(patched, by_fe=replace(patched.by_fe, own=patched.by_fe.own[1:]))


def test_compliance_is_that_of_finite_elements_also_between_their_states(patched, robot):
    chosen = np.arange(len(patched.patches))
    for delta, known in zip(patched.by_fe.states, patched.by_fe.own, strict=True):  # as many states as terms
        found = compliance_of(LoadedRobots.of(patched, delta), chosen)
        assert np.abs(found - known).max() < 1e-3 * np.abs(known).max()
    between = patched.by_fe.states.mean(axis=0)
    skin = patched.model.skin
    truth = patch_response(robot, skin.watched, patched.patches, between[None]).own[0]
    assert np.abs(compliance_of(LoadedRobots.of(patched, between), chosen) - truth).max() < 5e-3 * np.abs(truth).max()


@pytest.mark.parametrize(("allowed", "count"), [(1e-12, 4), (0.3, 2)])
def test_mixtures_of_modes_change_the_compliance_as_all_modes_do(patched, monkeypatch, allowed, count):
    monkeypatch.setattr("cfem.predict.contact.surface.surface_model.BENT", allowed)
    patched = replace(patched)
    Q, n_e = patched.bends, patched.model.rows.n_e
    np.testing.assert_allclose(Q.T @ Q, np.eye(count), atol=1e-12)
    D = np.tensordot(patched.basis(patched.in_box(patched.by_fe.states)), patched.bent, axes=1)
    found, left, size = D[:, patched.bent_at], 0.0, 0.0
    for mine, known in zip(found, patched.by_fe.bent[..., n_e:], strict=True):
        own = np.einsum("abc,ka,lb,mc->klm", mine[:, n_e:], Q, Q, Q)
        seen = np.einsum("aeb,ka,lb->kel", mine[:, :n_e], Q, Q)
        left += np.sum((own - known[:, n_e:]) ** 2) + np.sum((seen - known[:, :n_e]) ** 2)
        size += np.sum(known**2)
    assert np.sqrt(left / size) < 3 * allowed + 1e-6  # of three loads; and what is rounded, or not quite symmetric


def test_a_dent_is_right_to_the_second_order_in_its_force(patched, robot):
    """Against finite elements with a force on a patch: half of it leaves an eighth of the error."""
    delta = patched.by_fe.states[0]
    held, size = LoadedRobots.of(patched, delta), np.diag(patched.by_fe.own[0]).reshape(-1, 3).sum(axis=1)
    number = int(np.argmin(np.where(patched.held_still, np.inf, size)))  # where what is local matters most
    touched = with_patches(robot, patched.model.skin.nodes, patched.patches, np.array([number]))
    settings, places, off = NewtonSettings(tolerance=1e-11), [], []
    direction = np.array([[-0.3, 0.5, -1.0]]) / size[number]
    for share in (0.0, 0.2, 0.4):
        force = share * direction
        at = Actuation(np.eye(1, 4), delta, np.concatenate([np.zeros(1), force[0]]))
        places.append(solve(Problem(touched), at, slack=False, settings=settings).delta_c)
        put(held, np.array([number]), force)
        moved = held.places[number] - held.free[number]
        off.append(np.linalg.norm(moved - (places[-1] - places[0])))
    assert 6.0 < off[2] / off[1] < 10.0
    assert off[2] < 0.02 * np.linalg.norm(places[2] - places[0])


@pytest.mark.parametrize("size", [0.01, 30.0])
def test_places_yield_as_their_differences_say(patched, size):
    """And alike in both directions, as one energy says; far beyond the second order too."""
    rng, held = np.random.default_rng(3), LoadedRobots.of(patched, DELTA)
    chosen = np.flatnonzero(~patched.held_still)[:6]
    forces, h = size * rng.normal(size=(6, 3)), 1e-6 * size
    found = np.empty((18, 18))
    for i, one in enumerate(np.eye(18)):
        ends = []
        for sign in (1, -1):
            put(held, chosen, forces + sign * h * one.reshape(6, 3))
            ends.append(held.places[chosen].ravel())
        found[:, i] = (ends[0] - ends[1]) / (2 * h)
    put(held, chosen, forces)
    exact = held.compliance(under_forces=True)
    np.testing.assert_allclose(exact, exact.T, atol=1e-7 * np.abs(exact).max())
    np.testing.assert_allclose(found, exact, atol=2e-7 * np.abs(exact).max())


def test_places_and_turns_are_those_of_the_surface(patched):
    held, skin = LoadedRobots.of(patched, DELTA), patched.model.skin
    surface = skin.surface(held.held[0].rows)
    assert np.allclose(held.free, patched.patches.mean(surface), atol=1e-4)
    R = patched.turns(held.held[0].rows, np.arange(len(patched.patches)))
    assert np.allclose(R @ R.swapaxes(1, 2), np.eye(3), atol=1e-12) and np.allclose(np.linalg.det(R), 1.0)
    angle = np.degrees(np.arccos((np.trace(R, axis1=1, axis2=2) - 1) / 2)).max()
    assert 1.0 < angle < 90.0  # the bar bends


def test_a_patch_stays_on_its_side_of_an_edge(patched):
    """An edge that moves into the bar pushes a patch to the side on which it came to lie, also where, from the free
    shape, the other side is nearer."""
    places = patched.patches.mean(patched.model.shape(DELTA))
    at = places[np.argmax(places[:, 1] - np.abs(places[:, 0]))]
    half = np.sqrt(0.5)
    turn = np.array([[1.0, 0, 0], [0, half, -half], [0, half, half]])

    def edge(depth, aside):
        return Box(np.array([2.0, 3.0, 3.0]), R=turn, t=at + np.array([0.0, 3 * np.sqrt(2) - depth, aside]))

    before, sides = None, []
    for depth, aside in ((0.05, 0.02), (0.3, 0.02), (0.3, -0.02)):
        before = contact_step(patched, DELTA, [edge(depth, aside)], before=before)
        assert before.converged and before.forces.any()
        sides.append(before.pairs.frames[0, 0])
    assert np.allclose(sides[1], sides[2])
    alone = contact_step(patched, DELTA, [edge(0.3, -0.1)])
    assert not np.allclose(alone.pairs.frames[0, 0], sides[2])


def test_a_curved_obstacle_takes_few_rounds(patched):
    """The normals turn with the places within a round: Newton's method ends where a fixed point takes many."""
    places = patched.patches.mean(patched.model.shape(DELTA))
    at = places[np.argmax(places[:, 1])]
    found = contact_step(patched, DELTA, [Sphere(6.0, t=at + np.array([2.0, 5.0, 2.0]))])
    assert found.converged and found.forces.any() and found.iterations <= 6
    forces = found.push[found.push.any(axis=1)]
    normals = found.pairs.frames[found.push.any(axis=1), 0]
    assert np.allclose(np.cross(forces, normals), 0.0, atol=1e-7 * np.abs(forces).max())
    assert found.between(0, 1) == pytest.approx(np.linalg.norm(forces, axis=1).sum(), rel=1e-9)
