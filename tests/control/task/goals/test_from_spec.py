"""Goals of every kind of trajectory, and what does not fit the robot."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from pydantic import TypeAdapter

from cfem.condensed import Rows
from cfem.control.task.goals.from_spec import demand_fits, demand_near, goals_of
from cfem.control.task.goals.trajectory_spec import GoalsSpec, TrajectorySpec
from cfem.core.errors import InputError, NumericalError, SpecError
from cfem.core.yaml import read_yaml

PIPELINES = Path(__file__).parents[4] / "pipelines"
TRAJECTORY = TypeAdapter(TrajectorySpec)
ROBOT = SimpleNamespace(
    rows=SimpleNamespace(n_e=3, n_a=2), rest_e=np.array([0.0, 10.0, -120.0]), aims=np.ones(3, dtype=bool)
)
NOWHERE = np.zeros(0)


class Fem:
    """Ends where the shares of its pull say."""

    def pull(self, share):
        return SimpleNamespace(x_e=np.array([*share, share.sum()]))


class Snapping(Fem):
    """Has no stable state where the first actuator is pulled by more than `beyond` of its reach."""

    def __init__(self, beyond):
        self.beyond = beyond

    def pull(self, share):
        if share[0] > self.beyond:
            raise NumericalError("FE robot: the equilibrium is unstable")
        return super().pull(share)


def goals(robot=ROBOT, shift=NOWHERE, **spec):
    return goals_of("curve", TRAJECTORY.validate_python(spec), Path(), robot, Fem(), shift)


def test_given_points_are_taken_and_move_with_the_design():
    points = {"mm": [[0, 1, 2], [3, 4, 5]]}
    np.testing.assert_array_equal(goals(kind="goals", points=points), [[0, 1, 2], [3, 4, 5]])
    moved = goals(kind="goals", points=points, shift=np.array([0.0, 0.5, -1.0]))
    np.testing.assert_array_equal(moved, [[0, 1.5, 1], [3, 4.5, 4]])


def test_a_straight_line_is_its_two_ends_and_a_number_of_goals():
    line = goals(kind="goals", points={"mm": [[0, 0, -120], [0, 30, -80]]}, goals=6)
    np.testing.assert_allclose(line, np.stack([np.zeros(6), np.arange(0, 31, 6), np.arange(-120, -79, 8)], axis=1))
    bent = goals(kind="goals", points={"mm": [[0, 0, 0], [0, 0, 0], [3, 0, 0], [3, 1, 0]]}, goals=5)
    np.testing.assert_allclose(bent, [[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0], [3, 1, 0]], atol=1e-12)
    np.testing.assert_array_equal(goals(kind="goals", points={"mm": [[1, 2, 3]]}, goals=2), [[1, 2, 3]] * 2)


WATCHED = SimpleNamespace(**{**vars(ROBOT), "rows": Rows(("tip.x", "tip.y", "tip.z"), ("a", "b"))})


def from_file(folder, text, **more):
    (folder / "path.csv").write_text(text, encoding="utf-8")
    trajectory = TRAJECTORY.validate_python({"kind": "goals", "file": "path.csv", **more})
    return goals_of("curve", trajectory, folder, WATCHED, Fem(), NOWHERE)


def test_goals_come_from_a_table_in_any_order_of_its_columns_and_in_its_units(tmp_path):
    text = "\ufefftip.z [cm];tip.x [mm];tip.y [m]\n-12,0;1,5;0,01\n-11,5;2,5;0,02\n"
    np.testing.assert_allclose(from_file(tmp_path, text), [[1.5, 10, -120], [2.5, 20, -115]])
    np.testing.assert_allclose(from_file(tmp_path, text, about="rest", goals=3)[1], [2.0, 25, -237.5])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            "tip.x [mm],tip.y [mm]\n1,2\n",
            r"path\.csv: has no column 'tip\.z' \(the goals need tip\.x, tip\.y, tip\.z\)",
        ),
        ("tip.x [mm],tip.y [mm],tip.z [mm]\n1,,2\n", r"path\.csv.*2.*has no number for tip\.y"),
        ("tip.x [mm],tip.y [mm],tip.z [mm]\n", "holds no"),
        ("tip.x,tip.y,tip.z\n1,2,3\n", "expected a name and its unit"),
    ],
)
def test_a_table_that_lacks_something_is_refused_with_its_place(tmp_path, text, words):
    with pytest.raises(InputError, match=words):
        from_file(tmp_path, text)


def test_images_without_a_stable_state_are_left_out():
    image = TRAJECTORY.validate_python({"kind": "image", "centre": 0.5, "radii": 0.4, "goals": 8})
    every = goals_of("curve", image, Path(), ROBOT, Fem(), NOWHERE)
    stable = goals_of("curve", image, Path(), ROBOT, Snapping(0.7), NOWHERE)
    np.testing.assert_array_equal(stable, every[every[:, 0] <= 0.7])
    assert len(stable) == 5


def test_an_image_that_mostly_has_no_stable_state_is_an_error():
    image = TRAJECTORY.validate_python({"kind": "image", "centre": 0.5, "radii": 0.4, "goals": 8})
    words = r"no stable state is found for 5 of 8 goals; the first is goal 0, at \[0.9, 0.5\] of the reach"
    with pytest.raises(NumericalError, match=words):
        goals_of("curve", image, Path(), ROBOT, Snapping(0.49), NOWHERE)


def test_an_arc_begins_at_rest_where_it_is_asked_to():
    arc = {"kind": "arc", "centre": {"mm": [0, 0, 0]}, "radius": "120 mm", "start": "-90 deg", "end": "0 deg"}
    plain = goals(**arc, plane="yz", goals=4, from_rest=0)
    np.testing.assert_allclose(plain[[0, -1]], [[0, 0, -120], [0, 120, 0]], atol=1e-12)
    late = goals(**arc, plane="yz", goals=4, from_rest=3)
    np.testing.assert_allclose(late[0], ROBOT.rest_e)
    np.testing.assert_allclose(late[3:], plain, atol=1e-12)


def test_goals_about_rest_follow_a_longer_robot_and_those_of_the_published_one_stay_where_they_are():
    """The tip of the diamond is 125 mm up where it is 163 mm high: its paper's circle is at 133 mm."""
    read = TypeAdapter(dict[str, TrajectorySpec]).validate_python
    spec = read(read_yaml(PIPELINES / "diamond" / "control.yaml")[0]["trajectories"])
    for name, height in (("circle", 133.0), ("circle-above", 141.0)):
        for rest in (125.0, 187.5):
            robot = SimpleNamespace(**{**vars(ROBOT), "rest_e": np.array([0.0, 0.0, rest])})
            found = goals_of(name, spec[name], Path(), robot, Fem(), NOWHERE)
            np.testing.assert_array_equal(found[:, 2], height + rest - 125)
            np.testing.assert_allclose(np.linalg.norm(found[:, :2], axis=1), 20)


def test_points_about_rest_leave_what_no_goal_is_set_for_at_rest():
    rest = np.array([0.0, 10.0, -120.0, 3.0])
    robot = SimpleNamespace(rows=SimpleNamespace(n_e=4, n_a=2), rest_e=rest, aims=np.array([True, True, True, False]))
    found = goals(robot, kind="goals", about="rest", points={"mm": [[1, 2, 3]]})
    np.testing.assert_array_equal(found, [[1, 12, -117, 3]])
    every = goals(robot, kind="goals", about="rest", points={"mm": [[1, 2, 3, 4]]})
    np.testing.assert_array_equal(every, [[1, 12, -117, 7]])


def test_a_curve_in_the_cube_is_where_finite_elements_end():
    found = goals(kind="image", centre=[0.4, 0.5], radii=[0.1, 0.2], goals=8)
    assert found.shape == (8, 3)
    np.testing.assert_allclose(found[0], [0.5, 0.5, 1.0], atol=1e-12)


@pytest.mark.parametrize(
    "spec, words",
    [
        (
            {"kind": "goals", "points": {"mm": [[0, 1, 2]]}},
            r"a goal has 3 numbers, the robot 6 effector rows .*weight 0 in search\.weights leaves a row free",
        ),
        ({"kind": "image", "centre": [0.4], "radii": [0.1], "goals": 3}, "centre has 1 numbers, the robot 2"),
    ],
)
def test_what_does_not_fit_the_robot_is_named(spec, words):
    robot = SimpleNamespace(rows=SimpleNamespace(n_e=6, n_a=2), rest_e=np.zeros(6), aims=np.ones(6, dtype=bool))
    with pytest.raises(SpecError, match=words):
        goals(robot, **spec)


def test_one_share_is_that_of_all_actuators():
    one = goals(kind="image", centre=0.4, radii=[0.1, 0.2], goals=8)
    np.testing.assert_array_equal(one, goals(kind="image", centre=[0.4, 0.4], radii=[0.1, 0.2], goals=8))
    with pytest.raises(ValueError, match="leaves the range"):
        TRAJECTORY.validate_python({"kind": "image", "centre": 0.4, "radii": [0.1, 0.5], "goals": 8})


def test_a_curve_is_compared_with_the_robot_before_anything_is_solved():
    image = TRAJECTORY.validate_python({"kind": "image", "centre": [0.4] * 3, "radii": 0.1, "goals": 8})
    demand_fits("curve", image, 3, 3, 3)
    with pytest.raises(SpecError, match="centre has 3 numbers, the robot 4 actuators") as error:
        demand_fits("curve", image, 4, 3, 3)
    assert error.value.where == "trajectories.curve"
    points = TRAJECTORY.validate_python({"kind": "goals", "points": {"mm": [[0, 1, 2]]}})
    demand_fits("curve", points, 4, 6, 3)
    with pytest.raises(SpecError, match="a goal has 3 numbers, the robot 6"):
        demand_fits("curve", points, 4, 6, 6)


def test_no_goal_is_set_for_a_centre_of_mass():
    """Its rows are at rest in every goal, and have no weight."""
    aims = np.array([True, True, True, False, False, False])
    robot = SimpleNamespace(rows=SimpleNamespace(n_e=6, n_a=2), rest_e=np.arange(6.0), aims=aims)
    points = GoalsSpec(kind="goals", points={"mm": [[1.0, 2, 3], [4, 5, 6]]})
    found = goals_of("a", points, Path(), robot, None, np.zeros(0))
    assert found.tolist() == [[1, 2, 3, 3, 4, 5], [4, 5, 6, 3, 4, 5]]


@pytest.mark.parametrize(
    ("goal", "words"),
    [
        ([0, 3e5 - 110, 0], r"goal 1 is 3e\+05 mm from where the effector rests, 2.5e\+03 times the robot's length"),
        (
            [0, 260, -120],
            "goal 1 is 250 mm from where the effector rests, 2.08 times the robot's length: goals are in mm",
        ),
        ([0, 0.03, -0.11], "goal 1 would be near the robot if it were in metres: goals are in mm"),
    ],
)
def test_goals_of_another_unit_are_refused(goal, words):
    robot = SimpleNamespace(rows=Rows(("tip.x", "tip.y", "tip.z"), ("a",)), rest_e=ROBOT.rest_e, length=120.0)
    demand_near("curve", np.array([[0.0, 30.0, -110.0], [0.0, 240.0, -110.0], [0, 0, -10], [0, 1, -61]]), robot)
    with pytest.raises(SpecError, match=words):
        demand_near("curve", np.array([[0, 10, -120.0], goal]), robot)
