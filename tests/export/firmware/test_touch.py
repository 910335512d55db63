"""Contact anywhere in C against Python's: obstacles, the law, and whole steps."""

import ctypes
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from export.planning import LONGEST, Planning, demand_same_ticks
from support.benchmark import benchmark
from support.fast_cases import fast_are

import cfem
from cfem.contact.law.check import check
from cfem.contact.law.newton import newton
from cfem.contact.law.problem import ContactProblem
from cfem.contact.obstacle import Box, Capsule, ClosedMesh, Plane, Sphere
from cfem.contact.obstacle_set import ObstacleSet
from cfem.contact.patch_forces import pressed
from cfem.core.artefact.content import artefact_content
from cfem.core.errors import InputError, NumericalError, SpecError
from cfem.export.compiled.build import STANDARD, compiler, run
from cfem.export.compiled.touch import CompiledTouch
from cfem.export.firmware.copying import copy_sources
from cfem.export.firmware.touch import write_c_touch
from cfem.predict.contact.model import ContactModel
from cfem.predict.contact.step.scene import contact_step
from cfem.predict.contact.step.state import TRUSTED
from cfem.predict.contact.surface.kept_patches import patched_model_of
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh
from cfem.robot.spec import scene_meaning

a_problem = benchmark("contact_random").a_problem

needs_compiler = pytest.mark.skipif(compiler() is None, reason="no C compiler")
STRICT = ("-O2", "-Wall", "-Wextra", "-Werror", "-pedantic")
CEILING = {"kind": "plane", "point": {"mm": [0, 0, 9]}, "normal": [0, 0, -1]}
ITERATIONS, BAD_INPUT, NO_STATE_OF_MODEL = 2, 4, 5  # of cfem_touch.h
OUTSIDE, HELD, NO_MODEL = 4, 16, 64  # of cfem.h


def export(bar, out, obstacles, **contact):
    words = [
        "formats=[c]",
        "scene=scene.yaml",
        f"c.obstacles={obstacles}",
        f"c.contact={ {'patches': '8 mm', **contact} }",
        f"c.controller.step={LONGEST} mm",
    ]
    return cfem.run_stage("export", bar / "pipelines" / "bar" / "export.yaml", out=out, overrides=words)


@pytest.fixture(scope="module")
def exported(bar, tmp_path_factory):
    out = tmp_path_factory.mktemp("touch") / "exported"
    return out, export(bar, out, {"ceiling": CEILING}, friction=0.4)["results"]


@pytest.fixture(scope="module")
def patched(bar, exported):  # whose patches the export has left beside the model
    scene = bar / "pipelines" / "bar" / "scene.yaml"
    spec, mesh = load_scene_and_mesh(scene)
    made_of = {"scene": scene_meaning(scene), "mesh": artefact_content(scene.parent / spec.out), "loads": {}}
    folder = bar / "models" / "bar" / "spectral"
    return patched_model_of(cfem.load_model(folder), folder, build_robot(spec, mesh), made_of, 8.0)


@needs_compiler
def test_the_export_says_how_far_c_is_from_python(exported):
    out, results = exported
    assert results["parity"]["c contact"] < 1e-8
    assert [line for line in results["headline"] if "contact" in line and "from contact in Python" in line]
    assert [
        line for line in results["headline"] if line.startswith("c: coefficients ") and "from the trained model" in line
    ]
    assert results["c"]["contact"]["patches"] > 10
    assert {"cfem_touch.c", "cfem_touch_data.h"} <= {path.name for path in (out / "c").iterdir()}


@pytest.fixture(scope="module")
def compiled(exported):
    return CompiledTouch(exported[0] / "c", STRICT)


def alone(state):
    """The arrays of the only robot's state under the names that C has."""
    of_robot = {name: getattr(state, name)[0] for name in ("delta_e", "lambda_a", "rows")}
    on_patches = {"forces": state.push, "normals": state.pairs.frames[:, 0], "everywhere": state.places}
    return of_robot | on_patches | {"delta_a": state.deltas[0], "error": state.error}


@needs_compiler
def test_a_cable_that_lets_go_of_what_sticks_leads_through_the_states_of_python(compiled, patched):
    """In a few rounds each, where the body softens."""
    ceiling, before, rounds = Plane(R=np.diag([1.0, -1.0, -1.0]), t=np.array([0.0, 0.0, 9.0])), None, []
    compiled.reset()
    for delta in [*np.linspace(1.0, 7.2, 12), *np.linspace(7.1, 4.8, 16)]:
        before = contact_step(patched, [delta], [ceiling], mu=0.4, before=before)
        found = compiled([delta], [ceiling], 0.4)
        assert before.converged and found.status == 0 and found.iterations == before.iterations
        np.testing.assert_allclose(found.delta_e, before.delta_e[0], atol=1e-7)
        rounds.append(found.iterations)
    assert max(rounds) < 20 and np.mean(rounds) < 4


@needs_compiler
@pytest.mark.parametrize("delta", [5.2, 5.8, 6.2])
def test_one_long_step_whose_rounds_would_lead_back_and_forth_takes_shares_of_them(compiled, patched, delta):
    """A free bar is up to 20 mm within the ceiling. Whole changes of the forces throw it out and let it in again."""
    ceiling = Plane(R=np.diag([1.0, -1.0, -1.0]), t=np.array([0.0, 0.0, 9.0]))
    compiled.reset()
    found, state = compiled([delta], [ceiling], 0.4), contact_step(patched, [delta], [ceiling], mu=0.4)
    assert found.status == 0 and state.converged and not state.trusted
    assert 8 < found.iterations == state.iterations < 20


@needs_compiler
@pytest.mark.parametrize(("delta", "outside"), [(-0.5, True), (0.5, False), (7.9, False), (8.5, True), (12.0, True)])
def test_c_and_python_say_which_actuators_the_model_was_not_trained_on(compiled, patched, delta, outside):
    compiled.reset()
    found, state = compiled([delta], []), contact_step(patched, [delta], [])
    assert found.status == 0 and state.converged
    assert found.outside == state.outside == outside


def foremost(patched, delta):
    places = patched.patches.mean(patched.model.shape(delta))
    return places[np.argmax(places[:, 2])]


@needs_compiler
@pytest.mark.parametrize("mu", fast_are({0.4}, [0.0, 0.4]))
def test_steps_are_those_of_python(compiled, patched, mu):
    at = foremost(patched, np.array([2.0]))
    down = np.diag([1.0, -1.0, -1.0])
    x, z = at[0] / 2, at[2]
    shapes = {
        "plane": Plane(R=down, t=at - [0, 0, 0.3]),
        "sphere": Sphere(4.0, t=at + [1.0, 0.5, 3.7]),
        "capsule": Capsule(3.0, 8.0, R=np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]]), t=at + [0, 0, 2.8]),
        "box": Box(np.array([3.0, 2.0, 2.0]), t=at + [0.5, 0.3, 1.8]),
    }
    worlds = [[one] for one in shapes.values()] + [
        [shapes["sphere"], Box(np.array([4.0, 4, 1]), t=np.array([x, 0, z]))]
    ]
    for obstacles in worlds:
        compiled.reset()
        before, touched = None, 0
        for delta in np.linspace(0.5, 2.6, 8)[:, None]:
            before = contact_step(patched, delta, obstacles, mu=mu, before=before)
            found = compiled(delta, obstacles, mu)
            assert before.converged and found.status == 0 and found.iterations == before.iterations
            np.testing.assert_array_equal(found.patches, before.pairs.points)
            np.testing.assert_array_equal(found.obstacles, before.pairs.partners - 1)
            assert (found.deep, found.unsettled) == (before.deep, before.unsettled)
            for name in ("forces", "normals", "delta_e", "lambda_a", "everywhere", "rows", "error"):
                wanted = alone(before)[name]
                size = np.abs(wanted).max(initial=1e-6)
                np.testing.assert_allclose(getattr(found, name), wanted, atol=1e-8 * size, rtol=0, err_msg=name)
            holds = ~np.isnan(before.stuck[:, 0])
            np.testing.assert_array_equal(found.holds, holds)
            np.testing.assert_allclose(found.stuck[holds], before.stuck[holds], atol=1e-8)
            touched += bool(before.forces.any())
        assert touched


@needs_compiler
@pytest.mark.parametrize("mu", [0.0, 0.4, 1.5])
def test_where_a_long_step_could_end_in_several_states_both_say_so(compiled, patched, mu):
    """Boxes that are there at once, up to 2 mm within the bar. Rounding decides which state some of these steps end
    in: none of those that C and Python both know."""
    places = patched.patches.mean(patched.model.shape([1.5]))
    rng, loose, known = np.random.default_rng(11), np.flatnonzero(~patched.held_still), 0
    for seed in range(120):
        box = Box(np.array([3.0, 2, 2]), R=turn(seed))
        at, inwards, depth = places[rng.choice(loose)], turn(seed + 1000)[0], rng.uniform(0.05, 2.0)
        way = np.linspace(0.0, 8.0, 801)[:, None] * inwards  # of the box, which begins with the patch at its centre
        box = replace(box, t=at + way[np.argmin(np.abs(Box(box.half, R=box.R, t=at).distance(at - way) + depth))])
        compiled.reset()
        found, other = contact_step(patched, [1.5], [box], mu=mu), compiled([1.5], [box], mu)
        assert other.deep == found.deep
        assert compiled([1.5], [box], mu).deep == contact_step(patched, [1.5], [box], mu=mu, before=found).deep
        if not found.trusted or other.deep or other.error > TRUSTED:
            continue
        known += 1
        assert found.converged == (other.status == 0)
        if found.converged:
            np.testing.assert_allclose(other.delta_e, found.delta_e[0], atol=1e-6)
    assert 15 < known < 70


@needs_compiler
@pytest.mark.parametrize("seed", [8, 10])
def test_a_patch_that_a_round_throws_far_off_comes_back_as_in_python(compiled, patched, seed):
    """Farther than distances are asked of patches that do not touch."""
    place, R = patched.patches.mean(patched.model.shape([2.0]))[1], turn(seed)
    box = Box(np.array([3.0, 2, 2]), R=R, t=place - 1.5 * R[:, 0])
    compiled.reset()
    before, found = contact_step(patched, [2.0], [box], mu=1.5), compiled([2.0], [box], 1.5)
    assert before.converged and found.status == 0 and found.iterations == before.iterations
    np.testing.assert_allclose(found.delta_e, before.delta_e[0], atol=1e-6)


@needs_compiler
@pytest.mark.parametrize("mu", [0.0, 0.4])
def test_cables_go_slack_as_in_python(compiled, patched, mu):
    """A ball lifts the bar farther than its cable bends it, then comes down again."""
    delta, before, slack = np.array([0.3]), None, []
    places = patched.patches.mean(patched.model.shape(delta))
    at = places[np.argmin(places[:, 2] - places[:, 0] / 10)]
    compiled.reset()
    for depth in (0.3, 2.0, 2.5, 0.2):
        ball = Sphere(8.0, t=at + np.array([0.0, 0.0, depth - 8.0]))
        before = contact_step(patched, delta, [ball], mu=mu, before=before, unilateral=np.ones(1, dtype=bool))
        found = compiled(delta, [ball], mu, slack=True)
        assert before.converged and found.status == 0
        slack.append(bool(found.lambda_a[0] == 0.0))
        assert slack[-1] == (before.lambda_a[0][0] == 0.0) == (found.delta_a[0] > delta[0])
        for name in ("forces", "delta_e", "delta_a", "lambda_a", "everywhere", "rows"):
            wanted = alone(before)[name]
            size = np.abs(wanted).max(initial=1e-6)
            np.testing.assert_allclose(getattr(found, name), wanted, atol=1e-9 * size, rtol=0, err_msg=name)
    assert slack == [False, True, True, False]


@needs_compiler
@pytest.mark.parametrize("mu", [0.0, 0.4])
def test_a_tick_plans_with_contact_as_python_does(exported, patched, mu):
    """Goals of the tip behind a wall that the middle of the bar meets: each tick is the inverse step at the touched
    robot, which yields less than the free one."""
    at = foremost(patched, np.array([1.0]))
    wall = Plane(R=np.diag([1.0, -1.0, -1.0]), t=at - [0, 0, 0.1])
    among = ContactModel(patched, {"wall": wall}, mu=mu, parts=1)  # as C has it
    planning, now = Planning(exported[0] / "c", [wall], mu, STRICT), np.zeros(1)
    among.settle(now)
    assert demand_same_ticks(planning, among, now, (0.8, 1.6, 1.8, 1.7, 1.5)) > 1e-3
    assert among.before.forces.any()


@needs_compiler
@pytest.mark.parametrize("depth", [0.01, 1.0])
def test_a_tick_says_that_contact_bends_the_robot_too_far(exported, patched, depth):
    """A ball pushes the tip along the bar."""
    places = patched.patches.mean(patched.model.shape(np.zeros(1)))
    ball = Sphere(20.0, t=places[np.argmax(places[:, 0])] + [20.0 - depth, 0, 0])
    among = ContactModel(patched, {"ball": ball}, mu=1.5, parts=1)
    among.settle(np.zeros(1))
    found = Planning(exported[0] / "c", [ball], 1.5, STRICT).step(patched.model.rest_e)
    assert not found.status & NO_MODEL and among.before.forces.any()
    assert bool(found.status & OUTSIDE) == (among.before.error > TRUSTED) == (depth == 1.0)


@needs_compiler
@pytest.mark.parametrize(("shares", "settles"), [((0.55, 0.95), True), ((0.7, 0.95), False)])
def test_a_tick_says_that_forces_between_obstacles_hardly_settle(exported, patched, shares, settles):
    """Two balls press the bar by 0.1 mm, one from above and one from below, at these shares of its length."""
    places = patched.patches.mean(patched.model.shape(np.zeros(1)))
    along, up = places[:, 0] / places[:, 0].max(), places[:, 2] / np.abs(places[:, 2]).max()
    balls = []
    for share, side in zip(shares, (1, -1), strict=True):
        at = places[np.argmin(np.abs(along - share) - side * up)]
        balls.append(Sphere(4.0, t=at + [0, 0, side * 3.9]))
    among = ContactModel(patched, dict(zip("ab", balls, strict=True)))
    among.settle(np.zeros(1))
    found = Planning(exported[0] / "c", balls, 0.0, STRICT).step(patched.model.rest_e)
    among.settle(found.delta_a)
    assert among.before.error <= TRUSTED and not among.before.deep and not found.status & NO_MODEL
    assert bool(found.status & OUTSIDE) == among.before.unsettled == (not settles)


def longest_held(exported, patched, seed, share=0.3, ticks=100):
    """Ticks in a row at which a robot behind a wall is held, whose goals are outliers for a while."""
    rng, model = np.random.default_rng(seed), patched.model
    wall = Plane(R=np.diag([1.0, -1.0, -1.0]), t=foremost(patched, np.array([1.0])) - [0, 0, 0.1])
    planning, longest, held = Planning(exported[0] / "c", [wall], 0.4, STRICT), 0, 0
    low, high = model.reach[0]
    for tick in range(ticks):
        goal = model.rest_e + model.at_displacement([1.0 + 0.6 * np.sin(0.1 * tick)]).delta_e
        rng.normal(size=3)
        if 20 <= tick < 60 and rng.random() < share:
            away = rng.normal(size=3)
            goal = goal + 10.0 ** rng.uniform(0, 6) * away / np.linalg.norm(away)
        found = planning.step(goal)
        held = held + 1 if found.status & HELD else 0
        longest = max(longest, held)
        assert low - 1e-9 <= found.delta_a[0] <= high + 1e-9
    return longest


@needs_compiler
@pytest.mark.parametrize("seed", [4, 7, 24])
def test_a_robot_without_a_plan_where_it_stands_is_not_held_for_ever(exported, patched, seed):
    """On one side of the place no contact state is found, or on both: differences are of the other, or it retreats."""
    assert longest_held(exported, patched, seed) < 5


@pytest.mark.slow
@needs_compiler
def test_none_of_100_is_held_for_ever(exported, patched):
    assert max(longest_held(exported, patched, seed) for seed in range(100)) < 5


@needs_compiler
def test_nonsense_ends_with_a_status(compiled, patched):
    mid = Plane(t=np.array([0.0, 0, 500]))
    compiled.reset()
    assert compiled([np.nan], [mid]).status == BAD_INPUT
    assert compiled([1.0], [mid], -0.1).status == BAD_INPUT
    swallowed = compiled([1.0], [mid], 0.5)
    assert swallowed.iterations <= 60 and np.isfinite(swallowed.forces).all()
    for R, core, rounding in (  # Python refuses to make these
        (np.diag([1.0, 1, -1]), [1, 1, 1], 0),
        (np.diag([-797.0, 1, 1]), [1, 1, 1], 0),
        (np.eye(3)[[0, 0, 2]], [1, 1, 1], 0),
        (np.eye(3), [1, -1, 1], 0),
        (np.eye(3), [1, np.nan, 1], 0),
        (np.eye(3), [1, 1, 1], -0.1),
    ):
        body = SimpleNamespace(R=R, t=np.array([0.0, 0, 500]), core=np.array(core, float), rounding=rounding)
        assert compiled([1.0], [body]).status == BAD_INPUT
    free = compiled([1.0], [])
    assert free.status == 0 and not len(free.patches)
    np.testing.assert_allclose(free.delta_e, patched.model.at_displacement([1.0]).delta_e, atol=1e-10)


def law(library, W, free, mu, lam, systems=2000):
    """cfem_law from the forces lam of m points, which it overwrites: 0, or 1 where it finds none."""
    m, left = lam.size // 3, ctypes.c_int(systems)
    room = np.zeros(18 * m**2 + 48 * m + 8)
    given = W.ctypes, free.ctypes, ctypes.c_double(mu), lam.ctypes, room.ctypes, ctypes.byref(left)
    status = library.cfem_law(m, *given)
    assert 0 <= left.value <= systems
    return status


@needs_compiler
def test_a_step_that_leads_nowhere_ends_within_the_systems_allowed(compiled):
    """A friction at which nothing slips, deep in an obstacle."""
    swallowing = Plane(R=np.diag([1.0, -1.0, -1.0]), t=np.array([0, 0, -25.7]))
    solved = []
    for delta, mu in [(delta, mu) for delta in (2.0, 3.0) for mu in (1e4, 1e6)]:
        compiled.reset()
        state = compiled([delta], [swallowing], mu)
        assert state.status == ITERATIONS or state.systems < 2000
        solved.append(state.systems)
    assert max(solved) == 2000


@needs_compiler
@pytest.mark.parametrize("delta", [-10.0, 20.0, 1e6])
def test_actuators_that_cannot_be_meant_have_no_state_in_c_and_python(compiled, patched, delta):
    """Beyond the training states by more than their range."""
    compiled.reset()
    found = compiled([delta], [])
    assert found.status == NO_STATE_OF_MODEL and not found.systems and found.outside
    with pytest.raises(NumericalError, match="far outside"):
        contact_step(patched, [delta], [])


@needs_compiler
def test_what_the_law_is_said_to_be_obeyed_by_obeys_it(tmp_path):
    """Random problems of up to 12 points: every answer passes a check that knows nothing of how it was found."""
    library = built(tmp_path, "cfem_law.c")
    rng, solved = np.random.default_rng(0), 0
    hard = [a_problem(seed) for seed in (169, 979)]  # Newton's method does not solve these
    for problem in hard:
        lam = np.zeros(3 * problem.m)
        assert law(library, problem.W, problem.free, problem.mu, lam) == 0
        assert check(problem, "coulomb", lam).valid()
    for seed in range(60):
        m, mu = 1 + seed % 12, (0.0, 0.3, 0.8)[seed % 3]
        modes = rng.normal(size=(3 * m, 4))
        W = modes @ modes.T + 0.3 * np.diag(np.tile([1.0, 0.8, 0.8], m))
        free, lam = rng.normal(size=3 * m), np.zeros(3 * m)
        status = law(library, W, free, mu, lam)
        solved += status == 0
        if status == 0:
            assert check(ContactProblem(W, free, mu=mu), "coulomb", lam).valid()
    assert solved == 60
    W[0, 0] = np.nan
    assert law(library, W, free, mu, lam) == 1


@needs_compiler
def test_of_several_states_c_and_python_choose_the_same(tmp_path):
    """The one that Newton's method leads to from the forces of the last round; else from none, or along friction. The
    first problem has several, and Newton's method from the last forces finds none."""
    library, alone = built(tmp_path, "cfem_law.c"), []
    for seed in (3002, *range(30)):
        problem = replace(a_problem(seed), mu=4.0 if seed == 3002 else (0.5, 1.5)[seed % 2])
        m, size = problem.m, np.abs(problem.free).max() / np.diag(problem.W).max()
        known = size * np.abs(np.random.default_rng(seed).normal(size=(m, 3))) * [1, 0.3, 0.3]
        lam = known.copy()
        assert law(library, problem.W, problem.free, problem.mu, lam) == 0
        gap = (problem.free + problem.W @ known.ravel()).reshape(-1, 3)
        found = pressed(problem.W, gap, np.tile(np.eye(3), (m, 1, 1)), known, problem.mu)
        np.testing.assert_allclose(lam, found[1], atol=1e-8 * np.abs(found[1]).max(), rtol=0)
        alone.append(newton(problem.W, problem.free, problem.mu, known)[0] is None)
    assert alone[0]


@needs_compiler
def test_obstacles_are_those_of_python(tmp_path, patched):
    several = ObstacleSet(
        (
            Plane(t=np.array([0, 0, 1.0])),
            Sphere(2.0, t=np.ones(3)),
            Box(np.array([1.0, 2, 3]), R=turn(1)),
            Capsule(1.0, 2.5, R=turn(2)),
        )
    )
    write_c_touch(tmp_path, patched, several.obstacles, 0.0, np.zeros(1))
    copy_sources(tmp_path, "controller")
    text = (tmp_path / "cfem_touch_data.c").read_text()
    rows = text[text.index("const cfem_obstacle") :]
    (tmp_path / "shapes.c").write_text(f'#include "cfem_obstacle.h"\n#include <math.h>\n{rows}')
    library = built(tmp_path, "cfem_obstacle.c", "shapes.c")
    library.cfem_obstacle_distance.restype = ctypes.c_double
    size = len(bytes((ctypes.c_double * 16)())) + 8
    bodies = ctypes.addressof((ctypes.c_char * (4 * size)).in_dll(library, "cfem_obstacles"))
    on_an_axis = several.obstacles[1].t + [0, 0, 2.5]
    for x in [*3 * np.random.default_rng(0).normal(size=(50, 3)), on_an_axis]:
        for number, one in enumerate(several.obstacles):
            body, frame, bend = ctypes.c_void_p(bodies + number * size), np.zeros((3, 3)), np.zeros((3, 3))
            distance = library.cfem_obstacle_distance(body, x.ctypes)
            library.cfem_obstacle_frame(body, x.ctypes, frame.ctypes)
            library.cfem_obstacle_bend(body, x.ctypes, bend.ctypes)
            assert distance == pytest.approx(one.distance(x[None])[0], abs=1e-12)
            which = np.array([number])
            np.testing.assert_allclose(frame, several.frames(which, x[None])[0], atol=1e-12)
            np.testing.assert_allclose(bend, several.bends(which, x[None])[0], atol=1e-12)


def turn(seed):
    Q = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    return Q * np.sign(np.linalg.det(Q))


def built(folder, *names):
    copy_sources(folder, "touch", "controller/cfem_linear.h")
    run([compiler(), *STANDARD, *STRICT, "-shared", "-fPIC", "-o", "lib.so", *names, "-lm"], folder)
    return ctypes.CDLL(str(folder / "lib.so"))


def test_what_c_cannot_touch_is_refused(bar, patched, tmp_path):
    with pytest.raises(InputError, match="closed meshes"):
        write_c_touch(tmp_path, patched, [ClosedMesh.__new__(ClosedMesh)], 0.0, np.zeros(1))
    with pytest.raises(SpecError, match="press"):
        export(bar, tmp_path / "press", {"ceiling": {**CEILING, "press": "1 N"}})
    with pytest.raises(SpecError, match="scene"):
        words = ["formats=[c]", f"c.obstacles={ {'ceiling': CEILING} }"]
        cfem.run_stage("export", bar / "pipelines" / "bar" / "export.yaml", out=tmp_path / "b", overrides=words)
