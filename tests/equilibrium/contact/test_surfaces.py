"""FE robots that touch each other, and one whose parts do."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

import cfem
from cfem.condensed.patches import Patches, cut
from cfem.constraint.surface import outer_surface
from cfem.constraint.surface_points import at_nodes
from cfem.contact.step_status import StepStatus
from cfem.equilibrium.contact.skinned_robot import SkinnedRobot
from cfem.equilibrium.contact.surfaces import SHORT, SurfaceScene
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh

PIPELINES = Path(__file__).parents[3] / "pipelines"
MU, APART = 0.3, 16.0  # mm: of the axes of the two prongs
TO, WAY = np.array([1.1, 1.0]), (0.6, 0.8, 0.9, 1.0)  # mm, and the shares of it that are gone through


def skinned(folder, name, *pose, itself=False):
    specs = shutil.copytree(PIPELINES / name, folder / "pipelines" / name)
    scene = specs / "scene.yaml"
    scene.write_text(scene.read_text().replace("  size: 8 mm", "  {size: 5 mm, element: hex8}"))  # the bar's
    cfem.run_stage("mesh", scene)
    robot = build_robot(*load_scene_and_mesh(scene))
    surface = outer_surface(robot.X, robot.body.mesh.facets)
    patches = cut(surface.rest, surface.weights, 6.0, surface.triangles)
    return SkinnedRobot(robot, surface.nodes, surface.triangles, patches, *pose, itself=itself)


@pytest.fixture(scope="module")
def pincer(tmp_path_factory):
    return SurfaceScene([skinned(tmp_path_factory.mktemp("pincer"), "pincer", itself=True)], mu=MU)


@pytest.fixture(scope="module")
def pressed(pincer):
    state = None
    for share in WAY:
        state = pincer.step([share * TO], state)
    return state


def test_parts_of_one_robot_press_each_other_as_two_robots_do(pincer, pressed, tmp_path):
    """The lower prong is the bar, the upper one the bar upside down, each with the patches that it has in the pincer.
    Far patches of the same prong may be faces of the pincer alone, with weights of 1e-4."""
    bar, prongs, R, t = skinned(tmp_path, "bar"), [], np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, APART])
    whole, rest = pincer.robots[0], pincer.robots[0].robot.X[pincer.robots[0].nodes]
    for pose in ((np.eye(3), np.zeros(3)), (R, t)):
        mine = cKDTree(rest).query(bar.robot.X[bar.nodes] @ pose[0].T + pose[1])[1]
        numbers, of = np.unique(whole.patches.of[mine], return_inverse=True)
        places = (whole.patches.rest[numbers] - pose[1]) @ pose[0]
        patches = Patches(of, whole.patches.shares[mine], places)
        prongs.append(SkinnedRobot(bar.robot, bar.nodes, bar.triangles, patches, *pose, itself=False))
    meeting, two = SurfaceScene(prongs, mu=MU), None
    assert [one.patches.spacing for one in prongs] == pytest.approx([whole.patches.spacing] * 2)
    for share in WAY:
        two = meeting.step([share * TO[:1], share * TO[1:]], two)
    assert two.converged and pressed.converged and pressed.pressed > 0.01
    assert pressed.pressed == pytest.approx(two.pressed, rel=5e-4)
    assert np.concatenate([one.lambda_a for one in two.solved]) == pytest.approx(pressed.solved[0].lambda_a, rel=1e-4)
    turned = R @ two.solved[1].delta_e
    assert pressed.solved[0].delta_e == pytest.approx(np.append(two.solved[0].delta_e, turned), abs=2e-3)


def test_steps_of_any_length_lead_to_the_same_state(pincer):
    """Along a straight way, slip counts from where the prongs have touched, not from where a step began."""
    touching = pincer.go([np.array([0.9, 0.8])])
    in_four = touching
    for share in (0.25, 0.5, 0.75, 1.0):
        in_four = pincer.step([np.array([0.9, 0.8]) + share * 0.2], in_four)
    at_once = pincer.step([np.array([1.1, 1.0])], touching)
    assert at_once.converged and in_four.pressed == pytest.approx(at_once.pressed, rel=1e-4)
    assert at_once.factorizations < 12


def test_a_long_step_in_which_one_patch_takes_the_place_of_another_is_halved(pincer, pressed, monkeypatch):
    assert len(pressed.push) > 1
    first, second, both = (np.array(on, float)[:, None] * np.ones((len(on), 3)) for on in np.eye(2).tolist() + [[1, 1]])
    rest = np.zeros((len(pressed.push) - 2, 3))
    before, other, more = (replace(pressed, push=np.vstack([one, rest])) for one in (first, second, both))
    (at,), (longest,) = [one.delta_a for one in pressed.solved], pincer.longest
    for found, share, status in (
        (other, 1.0, StepStatus.SWAPPED),
        (other, SHORT, StepStatus.CONVERGED),
        (more, 1.0, StepStatus.CONVERGED),
    ):
        monkeypatch.setattr(SurfaceScene, "step", lambda *_, found=found: found)
        assert pincer.short_step([at + share * longest], before).status is status


def test_a_step_that_finds_no_state_says_so_and_keeps_the_last_one(pincer, pressed, monkeypatch):
    monkeypatch.setattr("cfem.equilibrium.contact.surfaces.ITERATIONS", 1)
    failed = pincer.step([np.array([1.4, 1.3])], pressed)
    assert not failed.converged and failed.status is StepStatus.ITERATIONS
    assert failed.solved == pressed.solved and not len(failed.pairs)


def test_rounds_that_combine_their_answers_are_fewer(pincer, monkeypatch):
    """At nodes forces turn with the surfaces that they press, which the linearisation does not know."""
    robot = pincer.robots[0].robot
    facets = robot.body.mesh.facets
    points = at_nodes(robot.X, facets, outer_surface(robot.X, facets))
    scene = SurfaceScene([replace(pincer.robots[0], patches=points)])

    def rounds():
        state, count = None, 0
        for share in WAY:
            state = scene.step([share * TO], state)
            count += state.iterations
        return count, state

    (few, state), _ = rounds(), monkeypatch.setattr("cfem.contact.acceleration.FIRST", 1000)
    many, plain = rounds()
    assert few <= 0.85 * many
    np.testing.assert_allclose(state.solved[0].delta_e, plain.solved[0].delta_e, atol=1e-5)
