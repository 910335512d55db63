"""Cables of the catalogue's robots: where they were published, and inside the body when its lengths change."""

from pathlib import Path

import numpy as np
import pytest
from support.fast_cases import fast_are

from cfem.constraint.attachment import distance_outside
from cfem.core.errors import SpecError
from cfem.core.spec import load_spec
from cfem.robot.build import build_robot
from cfem.robot.mesh.meshing import make_mesh
from cfem.robot.places import cable_points, effector_points, pull_point
from cfem.robot.spec import SceneSpec

PIPELINES = Path(__file__).parents[3] / "pipelines"
# Heights and distances from the axis of the trunk's cables, as its scene stated them point by point.
HEIGHTS = [23.5, 25.5, 41, 43, 58.5, 60.5, 76, 78, 93.5, 95.5, 111, 113, 128.5, 130.5, 146, 148, 163.5, 165.5, 181, 183]
AWAY = [9.2167, 9.15, 8.6333, 8.5667, 8.05, 7.9833, 7.4667, 7.4, 6.8833, 6.8167]
AWAY += [6.3, 6.2333, 5.7167, 5.65, 5.1333, 5.0667, 4.55, 4.4833, 3.9667, 3.9]
QUARTERS = [np.array([0.0, 1, 0]), np.array([-1.0, 0, 0]), np.array([0.0, -1, 0]), np.array([1.0, 0, 0])]
UP = np.array([0.0, 0, 1])
TRUNK = [
    (10 * side, np.outer(AWAY[:count], side) + np.outer(HEIGHTS[:count], UP)) for count in (20, 10) for side in QUARTERS
]
DIAMOND = [(10 * side + 30 * UP, (97 * side + 45 * UP)[None]) for side in QUARTERS]
BAR = [(np.array([0.0, 0, 4]), np.array([[15.0, 0, 4], [35, 0, 4], [55, 0, 4]]))]
LONGER = {
    "trunk": ["geometry.length=300 mm", "geometry.base_width=34 mm", "mesh.size=25 mm"],
    "diamond": ["geometry.height=200 mm", "geometry.knee_distance=110 mm", "mesh.size=25 mm"],
    "bar": ["geometry.length=90 mm", "geometry.height=6 mm"],
}


def scene_of(robot, overrides=()):
    return load_spec(PIPELINES / robot / "scene.yaml", SceneSpec, ["mesh.cells=null", *overrides])


@pytest.mark.parametrize(
    ("robot", "published", "tip"),
    [("trunk", TRUNK, [0, 0, 195]), ("diamond", DIAMOND, [0, 0, 125]), ("bar", BAR, [59, 0, 0])],
)
def test_the_published_robots_have_their_published_points(robot, published, tip):
    scene = scene_of(robot)
    assert len(scene.actuators) == len(published)
    for item, (pull, points) in zip(scene.actuators, published, strict=True):
        np.testing.assert_allclose(pull_point(scene, item), pull, rtol=0, atol=1e-12)
        np.testing.assert_allclose(cable_points(scene, item), points, rtol=0, atol=1e-12)
    np.testing.assert_allclose(effector_points(scene, scene.effectors[0]), tip, rtol=0, atol=1e-12)


@pytest.mark.parametrize("robot", fast_are({"diamond", "bar"}, LONGER))
def test_a_robot_of_other_lengths_meshes_with_its_cables_inside(robot):
    scene, before = scene_of(robot, LONGER[robot]), scene_of(robot)
    mesh, _ = make_mesh(scene, PIPELINES / robot)
    built = build_robot(scene, mesh)  # refuses a point outside
    assert len(built.actuators) == len(before.actuators)
    tolerance = 1e-9 * mesh.size
    for item, usual in zip(scene.actuators, before.actuators, strict=True):
        points = cable_points(scene, item)
        assert distance_outside(mesh, points, None).max() <= tolerance
        assert np.abs(points - cable_points(before, usual)).max() > 0.5
    tip = effector_points(scene, scene.effectors[0])
    assert distance_outside(mesh, tip[None], None).max() <= tolerance
    assert np.linalg.norm(mesh.X - tip, axis=1).min() < 0.1 * scene.length


def test_points_of_a_cable_are_smooth_in_the_lengths():
    """So that designs have derivatives: differences of two sizes agree."""

    def moved(step):
        scene = scene_of("trunk", [f"geometry.length={195 + step} mm", f"geometry.tip_width={12 + step} mm"])
        return (cable_points(scene, scene.actuators[0]) - TRUNK[0][1]) / step

    np.testing.assert_allclose(moved(1e-5), moved(1e-3), rtol=0, atol=1e-4)


@pytest.mark.parametrize(
    ("robot", "route", "says"),
    [
        ("trunk", "{side: z+}", "one of x+, x-, y+, y-"),
        ("trunk", "{side: y+, disks: 11}", "cannot pass 11 disks, the trunk has 10"),
        ("bar", "{side: y+, disks: 1}", "the bar has none"),
        ("bar", "{x: 0 mm, y: 2 mm}", "a bar needs the side"),
        ("soft-finger", "{side: y+}", "a soft-finger needs x and y"),
        ("stiff-flop", "{side: y+}", "needs a geometry of kind"),
    ],
)
def test_a_route_that_the_body_has_not_is_one_sentence(robot, route, says):
    cable = f"{{kind: cable, name: c, route: {route}, reach: {{mm: [0, 5]}}}}"
    with pytest.raises(SpecError, match=says.replace("+", r"\+")):
        load_spec(PIPELINES / robot / "scene.yaml", SceneSpec, [f"actuators=[{cable}]"])
