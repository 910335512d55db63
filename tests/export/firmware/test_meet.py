"""Robots that meet in C against Python's: whole steps, on this machine and on an emulated processor."""

import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from export.embedded import tool
from export.planning import Planning, demand_same_ticks
from support.fast_cases import fast_are

import cfem
from cfem.contact.obstacle import Plane, Sphere
from cfem.contact.obstacle_set import ObstacleSet
from cfem.contact.prescribed_motion import ActuatedRobot
from cfem.contact.surface.triangles import mean_normals
from cfem.core.artefact.content import artefact_content
from cfem.core.errors import InputError, NumericalError, SpecError
from cfem.export import firmware
from cfem.export.compiled.build import compiler
from cfem.export.compiled.meet import CompiledMeet
from cfem.export.compiled.structures import numbers
from cfem.export.firmware.meet import areas
from cfem.predict.contact.model import ContactModel
from cfem.predict.contact.step.bodies import PlacedModel
from cfem.predict.contact.step.rounds import ITERATIONS
from cfem.predict.contact.step.scene import ContactScene
from cfem.predict.contact.surface.kept_patches import patched_model_of
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh
from cfem.robot.spec import scene_meaning

needs_compiler = pytest.mark.skipif(compiler() is None, reason="no C compiler")
STRICT = ("-O2", "-Wall", "-Wextra", "-Werror", "-pedantic")
PIPELINES = Path(__file__).parents[3] / "pipelines"
MODEL = "../../models/bar/spectral"
TWIN = {
    "kind": "robot",
    "model": MODEL,
    "shares": [[0.0], [0.15]],
    "rotate": {"axis": [1, 0, 0], "angle": "180 deg"},
    "translate": {"mm": [0, 0, 16]},
}
WALL = {"kind": "plane", "point": {"mm": [0, 6.5, 0]}, "normal": [0, -1, 0]}
BAD_INPUT, INSIDE = 4, 6  # of cfem_touch.h and cfem_meet.h


def export(bar, out, obstacles, model=MODEL):
    words = ["formats=[c]", "scene=scene.yaml", f"model={model}", f"c.obstacles={obstacles}"]
    words.append("c.contact={patches: 8 mm, friction: 0.3}")
    return cfem.run_stage("export", bar / "pipelines" / "bar" / "export.yaml", out=out, overrides=words)["results"]


@pytest.fixture(scope="module")
def exported(bar, tmp_path_factory):
    out = tmp_path_factory.mktemp("meet") / "exported"
    return out / "c", export(bar, out, {"twin": TWIN, "wall": WALL})


@pytest.fixture(scope="module")
def patched(bar, exported):  # whose patches the export has left beside the model
    scene = bar / "pipelines" / "bar" / "scene.yaml"
    spec, mesh = load_scene_and_mesh(scene)
    made_of = {"scene": scene_meaning(scene), "mesh": artefact_content(scene.parent / spec.out), "loads": {}}
    folder = bar / "models" / "bar" / "spectral"
    return patched_model_of(cfem.load_model(folder), folder, build_robot(spec, mesh), made_of, 8.0)


@pytest.fixture(scope="module")
def robots(patched):
    over = PlacedModel(patched, np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, 16.0]), itself=False)
    return [PlacedModel(patched, itself=False), over]


@needs_compiler
@pytest.mark.slow
def test_the_export_says_how_far_c_is_from_python(exported):
    assert exported[1]["parity"]["c contact"] < 1e-7 and exported[1]["c"]["contact"]["robots"] == 2


@needs_compiler
@pytest.mark.parametrize("mu", fast_are({0.3}, [0.0, 0.3]))
def test_steps_are_those_of_python(exported, robots, mu):
    """Bars that bend towards each other, one of them onto a wall at its side too."""
    compiled = CompiledMeet(exported[0], STRICT)
    wall = Plane(R=np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]), t=np.array([0.0, 5.0 + 1e-3, 0.0]))
    for solid in ((), (wall,)):
        meeting, now, pressed = ContactScene(robots, ObstacleSet(solid), mu), None, 0.0
        compiled.reset()
        for share in np.arange(11) / 10:
            deltas = [np.array([1.6 * share]), np.array([1.0 * share])]
            now = meeting.start(deltas) if now is None else meeting.step(deltas, now)
            found = compiled(deltas, solid, mu)
            assert now.converged and found.status == 0 and found.iterations == now.iterations
            for name, size in (("forces", 0.01), ("places", 10.0), ("delta_e", 1.0), ("lambda_a", 1.0), ("rows", 1.0)):
                one, other = (np.concatenate(getattr(state, name)) for state in (found, now))
                assert np.abs(one - other).max() < 1e-9 * max(size, np.abs(other).max()), name
            assert found.pressed == pytest.approx(now.pressed, rel=1e-9)
            pressed = max(pressed, now.pressed)
        assert pressed > 0.02
        assert bool(solid) == bool((now.pairs.slots >= len(now.places)).any())


@needs_compiler
def test_a_step_without_the_obstacles_of_before_does_as_in_python(exported, robots):
    """Of two walls that a bar leans on one is gone, then the other."""
    compiled, mu, now = CompiledMeet(exported[0], STRICT), 0.3, None
    turned = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    below = Plane(t=np.array([0.0, 0.0, -5.0]))
    walls = (Plane(R=turned, t=np.array([0.0, 5.0 + 1e-3, 0.0])), below)
    for solid in (walls, walls, walls, walls[:1], walls[:1], (), ()):
        deltas = [np.array([1.2 if now is None else now.deltas[0][0] + 0.1]), np.array([0.9])]
        scene = ContactScene(robots, ObstacleSet(solid), mu)
        now = scene.start([0 * d for d in deltas]) if now is None else scene.step(deltas, now)
        found = compiled(now.deltas, solid, mu)
        assert now.converged and found.status == 0
        assert np.abs(found.forces - now.forces).max() < 1e-7 * max(0.01, np.abs(now.forces).max())


@needs_compiler
@pytest.mark.parametrize("mu", fast_are({0.3}, [0.0, 0.3]))
def test_a_ball_among_soft_robots_presses_as_in_python(exported, patched, robots, mu):
    """A ball that goes with the side of a bar and into it: forces turn with a curved obstacle."""
    compiled, now, pressed = CompiledMeet(exported[0], STRICT), None, 0
    places = patched.patches.mean(patched.model.shape([0.0]))
    patch = np.argmax(places[:, 0] / 2 + places[:, 1])
    for share in np.arange(21) / 20:
        deltas = [np.array([1.6 * share]), np.array([share])]
        place = patched.patches.mean(patched.model.shape(deltas[0]))[patch]
        ball = Sphere(3.0, t=place + [0.3, 3.02 - 0.2 * share, 0.4])
        meeting = ContactScene(robots, ObstacleSet((ball,)), mu)
        now = meeting.start(deltas) if now is None else meeting.step(deltas, now)
        found = compiled(deltas, (ball,), mu)
        assert now.converged and found.status == 0
        assert abs(found.iterations - now.iterations) <= 1  # rounding decides at the tolerance
        assert np.abs(found.forces - now.forces).max() < 1e-6 * max(0.01, np.abs(now.forces).max())
        assert found.pressed == pytest.approx(now.pressed, rel=1e-6)
        pressed += bool((now.pairs.slots >= len(now.places)).any())
    assert pressed > 2


@needs_compiler
@pytest.mark.parametrize("mu", fast_are({0.3}, [0.0, 0.3]))
def test_cables_go_slack_as_in_python(exported, patched, mu):
    """A bar that bends up from below lifts the other one beyond what its cable bends it, then goes down again."""
    pulls, below = np.ones(1, dtype=bool), np.array([0.0, 0.0, -16.0])
    robots = [PlacedModel(patched, t=at, itself=False, unilateral=pulls) for at in (np.zeros(3), below)]
    compiled, meeting, now, slack = CompiledMeet(exported[0], STRICT), ContactScene(robots, mu=mu), None, []
    numbers(compiled.placed[1].R)[...], compiled.placed[1].t[:] = np.eye(3), below.tolist()
    for delta in [*np.arange(13) / 5, 2.2, 2.0, 1.7]:
        deltas = [np.array([0.05 * min(delta, 1.0)]), np.array([delta])]
        now = meeting.start(deltas) if now is None else meeting.step(deltas, now)
        found = compiled(deltas, (), mu)
        assert now.converged and found.status == 0
        slack.append(bool(now.lambda_a[0][0] == 0.0) and now.pressed > 0)
        for name, size in (("forces", 0.01), ("places", 10.0), ("deltas", 1.0), ("delta_e", 1.0), ("lambda_a", 1.0)):
            one, other = (np.concatenate(getattr(state, name)) for state in (found, now))
            assert np.abs(one - other).max() < 1e-9 * max(size, np.abs(other).max()), name
    assert slack[-6:] == [True, True, True, True, True, False]


@needs_compiler
@pytest.mark.parametrize("mu", fast_are({0.3}, [0.0, 0.3]))
def test_a_tick_plans_among_soft_robots_as_python_does(exported, patched, robots, mu):
    """The bar bends up into the twin above; then that one bends too."""
    over, course = (robots[1].R, robots[1].t), np.array([[0.0], [0.5]])
    twin = replace(robots[1], unilateral=np.ones(1, dtype=bool)), ActuatedRobot(patched.model, course, None, *over)
    among, now = ContactModel(patched, {}, mu=mu, others={"twin": twin}, parts=1), np.zeros(1)
    planning = Planning(exported[0], [], mu, STRICT)
    among.settle(now)
    assert demand_same_ticks(planning, among, now, (0.8, 1.6, 2.0, 2.4) if mu else (0.8, 1.6, 2.2, 1.9, 2.4)) > 1e-3
    pressed = among.before.pressed
    assert pressed > 0.005
    if not mu:  # with friction it matters which one goes first
        planning.others[0] = 0.5
        among.pass_to(1.0)
        assert demand_same_ticks(planning, among, among.at, (2.4, 2.5)) > 1e-3
        assert among.before.pressed > 1.2 * pressed


@needs_compiler
def test_what_cannot_be_met_ends_with_a_status(exported, patched):
    compiled = CompiledMeet(exported[0], STRICT)
    assert compiled([np.array([np.nan]), np.zeros(1)]).status == BAD_INPUT
    assert compiled([np.zeros(1), np.zeros(1)], mu=-0.1).status == BAD_INPUT
    pose = compiled.placed[1]
    for held, index in ((pose.t, 0), (pose.R[1], 1)):
        right, held[index] = held[index], np.nan
        assert compiled([np.zeros(1), np.zeros(1)]).status == BAD_INPUT
        held[index] = right
    pose.t[2] = 9.0
    assert compiled([np.zeros(1), np.zeros(1)]).status == INSIDE
    pose.t[2] = 16.0
    assert compiled([np.zeros(1), np.zeros(1)]).status == 0


@needs_compiler
@pytest.mark.slow
def test_more_patches_than_c_has_room_for_are_named(bar, tmp_path, monkeypatch):
    monkeypatch.setattr("cfem.export.firmware.meet.MOST", 2)
    with pytest.raises(NumericalError, match=r"c\.contact\.patches: more patches touch at once.*take larger patches"):
        export(bar, tmp_path / "few", {"twin": TWIN, "wall": WALL})


def test_areas_are_the_normals_of_the_bent_surface(patched):
    of, skin = patched.patches, patched.model.skin
    z = np.concatenate([[1.0], skin.rows(np.array([2.0]), np.zeros(0))])
    i, j = np.triu_indices(len(z))
    found = areas(patched) @ (z[i] * z[j])
    wanted = mean_normals(skin.surface(z[1:]), skin.triangles, of.of, len(of))
    np.testing.assert_allclose(found / np.linalg.norm(found, axis=1)[:, None], wanted, atol=1e-12)


@needs_compiler
@pytest.mark.slow
def test_it_meets_on_an_emulated_processor_as_here(exported):
    tool("arm-none-eabi-gcc")
    done = subprocess.run([tool("make"), "-s", "-C", exported[0], "meet-m7.elf"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    board = ["-M", "mps2-an500", "-nographic", "-monitor", "none", "-serial", "none", "-icount", "shift=0"]
    board += ["-semihosting-config", "enable=on,target=native", "-kernel", exported[0] / "meet-m7.elf"]
    done = subprocess.run([tool("qemu-system-arm"), *board], capture_output=True, text=True)
    said = re.search(r"meeting: (\d+) steps, 0 failed; off by at most (\S+); pressed with (\S+) N", done.stdout)
    assert done.returncode == 0 and said, done.stdout + done.stderr
    assert int(said[1]) > 10 and float(said[2]) < 1e-8 and float(said[3]) > 0.002
    cost = re.search(r"a step: mean (\d+), largest (\d+) instructions", done.stdout)
    assert 0 < int(cost[1]) < 10_000_000


def test_what_c_cannot_meet_is_refused(bar, tmp_path):
    with pytest.raises(SpecError, match=r"obstacles\.twin: in C another robot is one of the exported model"):
        export(bar, tmp_path / "a", {"twin": {**TWIN, "model": "../../models/bar/other"}})
    with pytest.raises(InputError, match="overlap by"):
        export(bar, tmp_path / "b", {"twin": {**TWIN, "translate": {"mm": [0, 0, 9]}}})


@needs_compiler
@pytest.mark.slow
def test_a_robot_that_touches_itself_does_as_in_python(tmp_path):
    specs = shutil.copytree(PIPELINES / "pincer", tmp_path / "pipelines" / "pincer")
    for stage, name in (("mesh", "scene"), ("sample", "sample"), ("train", "train")):
        cfem.run_stage(stage, specs / f"{name}.yaml")
    words = ["model=../../models/pincer/spectral", "scene=scene.yaml", "formats=[c]"]
    words += ["c.obstacles={own: {kind: itself}}", "c.contact={patches: 8 mm}"]
    found = cfem.run_stage("export", specs / "export.yaml", out=tmp_path / "out", overrides=words)["results"]
    assert found["parity"]["c contact"] < 1e-9
    done = subprocess.run([tool("make"), "-s", "-C", tmp_path / "out" / "c", "test"], capture_output=True, text=True)
    said = re.search(r"meeting: (\d+) steps, 0 failed; .* pressed with (\S+) N", done.stdout)
    assert said and int(said[1]) > 10 and float(said[2]) > 0.01, done.stdout + done.stderr


def test_c_makes_as_many_rounds_as_python():
    """Else it gives up where Python finds a state."""
    source = Path(firmware.__file__).parent / "sources" / "touch" / "cfem_rounds.c"
    assert int(re.search(r"enum \{ ITERATIONS = (\d+)", source.read_text())[1]) == ITERATIONS
