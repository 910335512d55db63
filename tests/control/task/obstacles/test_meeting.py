"""`obstacles:` of control.yaml: plans know them, the FE robot meets them, and what is wrong is said once."""

from copy import copy
from types import SimpleNamespace

import numpy as np
import pytest
import yaml
from pyarrow.parquet import read_table
from support.cut_short import cut_short, demand_equal

import cfem
from cfem.condensed.model_error import ContactError, ContactFactors
from cfem.control.task.obstacles import meeting
from cfem.core.artefact.files import content_sha256
from cfem.core.errors import InputError, SpecError
from cfem.predict.contact.obstacle_spec import BoxObstacle, CapsuleObstacle, MeshObstacle, PlaneObstacle, SphereObstacle
from cfem.predict.contact.step.bodies import PlacedModel
from cfem.predict.load import load_model
from cfem.robot.load import made_from

CEILING = {"kind": "plane", "point": {"mm": [0, 0, 9]}, "normal": [0, 0, -1]}
TWIN = {"kind": "robot", "model": "../../models/bar/spectral", "shares": [[0]]}
GOALS = {"there": {"kind": "goals", "points": {"mm": [[58.9, 0, 1.5], [58.8, 0, 1.8]]}}}


def control(bar, name, obstacles, **more):
    spec = {
        "scene": "scene.yaml",
        "mesh": "../../data/bar/mesh",
        "models": {"spectral": "../../models/bar/spectral"},
        "out": f"../../data/bar/{name}",
        "trajectories": GOALS,
        "search": {"step": "0.5 mm"},
        **({"obstacles": obstacles, "contact": {"patches": "8 mm", "error_places": 0}} if obstacles else {}),
        **more,
    }
    path = bar / "pipelines" / "bar" / f"{name}.yaml"
    path.write_text(yaml.safe_dump(spec))
    return path


@pytest.mark.slow
def test_a_stated_force_is_what_finite_elements_feel(bar):
    obstacles = {"ceiling": {**CEILING, "press": "30 mN"}}
    search = {"step": "0.5 mm", "weights": [0, 0, 0]}
    found = cfem.run_stage("control", control(bar, "press", obstacles, search=search))["results"]
    met = found["obstacles"]["ceiling"]
    assert met["unit"] == "N" and met["wanted"] == pytest.approx(0.03)
    assert met["error_max"] < 0.05 * 0.03
    assert found["trajectories"]["there"]["spectral"]["reached"] == 2
    assert found["headline"][0].startswith("ceiling: pressed with 0.0")
    assert "held at 2 of 2 goals" in found["headline"][0]
    assert "2 of 2 commands carried out" in found["headline"][-1]


def test_the_error_of_the_contact_is_stated_and_kept(bar):
    """Few places, which promise little; the second run calibrates no more."""
    obstacles = {"ceiling": {**CEILING, "press": "30 mN"}}
    more = {"search": {"step": "0.5 mm", "weights": [0, 0, 0]}, "contact": {"patches": "8 mm", "error_places": 4}}
    found = cfem.run_stage("control", control(bar, "stated", obstacles, **more))["results"]
    stated = found["contact_error"]["spectral"]
    assert [stated[name]["places"] for name in ("one", "several")] == [2, 2]
    assert stated["goals"] == stated["stated"] == 2
    assert any(line.startswith("contact by spectral: force of each obstacle within") for line in found["headline"])
    rows = read_table(bar / "data" / "bar" / "stated" / "trajectories.parquet").to_pylist()
    assert all(0 < row["force_error"] < 0.2 * 0.03 and 0 < row["model_error"] < 1.0 for row in rows)
    assert len(cfem.load_model(bar / "models" / "bar" / "spectral").contact_errors) == 1


@pytest.mark.slow
def test_a_stated_force_is_what_finite_elements_feel_that_touch_at_every_node(bar, monkeypatch):
    """Plan and FE robot touch at nodes unless patches are asked for."""
    monkeypatch.delattr("cfem.control.task.obstacles.meeting.patched_model_of")
    obstacles = {"ceiling": {**CEILING, "press": "30 mN"}}
    more = {"search": {"step": "0.5 mm", "weights": [0, 0, 0]}, "contact": {"error_places": 0}}
    found = cfem.run_stage("control", control(bar, "press-mesh", obstacles, **more))["results"]
    met = found["obstacles"]["ceiling"]
    assert met["wanted"] == pytest.approx(0.03) and met["error_max"] < 0.05 * 0.03
    assert found["trajectories"]["there"]["spectral"]["reached"] == 2
    assert "2 of 2 commands carried out" in found["headline"][-1]


def test_the_resolution_of_the_mesh_has_no_patches(bar):
    both = {"resolution": "mesh", "patches": "8 mm"}
    with pytest.raises(SpecError, match="leave out patches"):
        cfem.run_stage("control", control(bar, "refused", {"ceiling": CEILING}, contact=both))


def test_a_goal_without_the_force_that_is_wanted_is_not_reached(bar):
    """Its cable may not pull enough to press by 2 N; the tip may be anywhere."""
    obstacles = {"ceiling": {**CEILING, "press": "2 N"}}
    search = {"step": "0.5 mm", "weights": [0, 0, 0], "largest_force": "0.1 N"}
    found = cfem.run_stage("control", control(bar, "hard", obstacles, search=search, plant="model"))["results"]
    assert found["obstacles"]["ceiling"]["largest"] < 1.9
    assert "where 2 N are wanted: held at 0 of 2 goals" in found["headline"][0]
    row = found["trajectories"]["there"]["spectral"]
    assert row["reached"] == row["reachable"] == 0 and row["goals"] == 2


def test_a_distance_is_kept(bar):
    """The goals lie beyond it: without the obstacle the robot comes nearer."""
    obstacles = {"ceiling": {**CEILING, "avoid": "1.5 mm"}}
    goals = {"up": {"kind": "goals", "points": {"mm": [[57, 0, 4]]}}}
    found = cfem.run_stage("control", control(bar, "avoid", obstacles, trajectories=goals))["results"]
    assert found["obstacles"]["ceiling"]["least"] == pytest.approx(1.5, abs=0.01)
    near = {"ceiling": {**CEILING, "avoid": "0.1 mm"}}
    closer = cfem.run_stage("control", control(bar, "near", near, trajectories=goals))["results"]
    assert closer["obstacles"]["ceiling"]["least"] < 1.4


def test_the_model_alone_can_be_the_plant(bar):
    obstacles = {"ceiling": {**CEILING, "largest_force": "20 mN"}}
    goals = {"up": {"kind": "goals", "points": {"mm": [[57, 0, 4]]}}}
    found = cfem.run_stage("control", control(bar, "model", obstacles, trajectories=goals, plant="model"))["results"]
    assert found["obstacles"]["ceiling"]["largest"] == pytest.approx(0.02, rel=1e-3)
    assert "commands carried out" not in found["headline"][-1]  # by no FE robot


@pytest.mark.parametrize(
    ("obstacle", "what"),
    [
        ({"kind": "plane", "point": {"mm": [0, 0, 4]}, "normal": [0, 0, -1]}, r"starts 1 mm inside it, at \("),
        ({**CEILING, "avoid": "1 mm", "press": "1 N"}, "pressed or avoided"),
        ({**CEILING, "press": "3 N", "largest_force": "1 N"}, "3 N is more than largest_force, 1 N"),
        ({"kind": "sphere", "centre": {"mm": [0, 0, 90]}, "radius": "-1 mm"}, "radius"),
        ({"kind": "cone"}, "kind"),
    ],
)
def test_what_is_wrong_with_an_obstacle_is_said(bar, obstacle, what):
    with pytest.raises(SpecError, match=what):
        cfem.run_stage("control", control(bar, "wrong", {"thing": obstacle}))


def test_patches_as_large_as_the_robot_are_refused(bar):
    with pytest.raises(
        SpecError, match=r"patches: 50 mm is too coarse for a robot that is 60 mm long \(take about 3 mm"
    ):
        cfem.run_stage("control", control(bar, "coarse", {"ceiling": CEILING}, contact={"patches": "50 mm"}))


def test_robots_that_overlap_are_refused_before_finite_elements_take_a_while(bar, monkeypatch):
    monkeypatch.delattr("cfem.control.task.obstacles.meeting.patched_model_of")
    inside = {**TOUCHED, "translate": {"mm": [0, 0, 9]}}
    with pytest.raises(SpecError, match=r"obstacles\.twin: the robot starts 4\.5 mm inside it.*move it away"):
        cfem.run_stage("control", control(bar, "overlap", {"twin": inside}))


def test_friction_below_zero_is_refused(bar):
    with pytest.raises(SpecError, match="friction"):
        cfem.run_stage("control", control(bar, "rough", {"ceiling": CEILING}, contact={"friction": -0.1}))


def test_a_mesh_that_is_not_closed_is_refused(bar):
    path = bar / "pipelines" / "bar" / "open.stl"
    corners = ["vertex 0 0 50", "vertex 1 0 50", "vertex 0 1 50"]
    path.write_text(
        "solid a\nfacet normal 0 0 1\nouter loop\n" + "\n".join(corners) + "\nendloop\nendfacet\nendsolid a"
    )
    with pytest.raises(InputError, match=r"open\.stl"):
        cfem.run_stage("control", control(bar, "open", {"thing": {"kind": "mesh", "file": "open.stl"}}))


@pytest.mark.slow
def test_a_payload_and_an_obstacle_go_together(bar):
    """The plan knows that the load presses too."""
    obstacles = {"ceiling": {**CEILING, "press": "30 mN"}}
    search, loads = {"step": "0.5 mm", "weights": [0, 0, 0]}, {"tip": {"force": {"N": [0, 0.004, -0.01]}}}
    spec = control(bar, "loaded-press", obstacles, search=search, loads=loads)
    found = cfem.run_stage("control", spec)["results"]
    assert found["obstacles"]["ceiling"]["error_max"] < 0.05 * 0.03 and found["load_error"] > 0


def test_an_obstacle_that_moves_is_pressed_where_it_is(bar):
    """It comes down by 1.5 mm, and its force is held; finite elements move it too."""
    way = {"mm": [[0, 0, 0], [0, 0, -1.5]]}
    obstacles = {"ceiling": {**CEILING, "press": "30 mN", "path": way}}
    search, goals = {"step": "0.5 mm", "weights": [0, 0, 0]}, {"mm": [[58.9, 0, 1.5]] * 4}
    told = {"there": {"kind": "goals", "points": goals}}
    spec = control(bar, "moves", obstacles, search=search, trajectories=told)
    found = cfem.run_stage("control", spec)["results"]
    assert found["obstacles"]["ceiling"]["error_max"] < 0.05 * 0.03
    assert "4 of 4 commands carried out" in found["headline"][-1]


def test_another_robot_is_kept_clear_of(bar):
    """The same bar hangs above, upside down, and bends down as the robot would rise."""
    other = {
        **TWIN,
        "shares": [[0.0], [0.05]],
        "rotate": {"axis": [1, 0, 0], "angle": "180 deg"},
        "translate": {"mm": [0, 0, 16]},
        "avoid": "2.5 mm",
    }
    goals = {"up": {"kind": "goals", "points": {"mm": [[57, 0, 4]] * 2}}}
    found = cfem.run_stage("control", control(bar, "other", {"twin": other}, trajectories=goals))["results"]
    assert found["obstacles"]["twin"]["least"] == pytest.approx(2.5, abs=0.02)


@pytest.mark.parametrize(
    ("change", "what"),
    [
        ({"path": {"mm": [[0, 0, 0], [0, 0, -9]]}}, r"its way leads .* mm into where the robot is held, .* % through"),
        ({**TWIN, "shares": [[0, 1]]}, "has 1 actuators, and each row of `shares`"),
        ({**TWIN, "shares": [[2]]}, "between 0 and 1"),
        ({**TWIN, "translate": {"mm": [0, 3, 2]}}, r"starts .* mm inside it"),
        ({**TWIN, "model": "../../models/nothing"}, "no such file"),
    ],
)
def test_what_is_wrong_with_one_that_moves_is_said(bar, change, what):
    one = change if "kind" in change else {**CEILING, **change}
    with pytest.raises((InputError, SpecError), match=what):
        cfem.run_stage("control", control(bar, "way", {"thing": one}))


@pytest.mark.parametrize("more", [{"fe_based": True}, {"design": {"young": "1 MPa"}}])
def test_what_does_not_go_together_is_refused(bar, more):
    with pytest.raises(SpecError, match=r"obstacles need fe_based: false|'design' does not go with an obstacle"):
        cfem.run_stage("control", control(bar, "both", {"ceiling": CEILING}, **more))


def test_shapes_are_where_they_are_stated(tmp_path):
    quarter = {"axis": [0, 0, 1], "angle": "90 deg"}
    cases = [
        (PlaneObstacle(kind="plane", point={"mm": [0, 0, 2]}, normal=[0, 0, 2]), [5, 5, 3], 1.0),
        (SphereObstacle(kind="sphere", centre={"mm": [1, 0, 0]}, radius="2 mm"), [1, 5, 0], 3.0),
        (
            BoxObstacle(kind="box", centre={"mm": [0, 0, 0]}, half_size={"mm": [1, 2, 3]}, rotate=quarter),
            [4, 0, 0],
            2.0,
        ),
        (CapsuleObstacle(kind="capsule", ends={"mm": [[0, 0, 0], [4, 0, 0]]}, radius="1 mm"), [2, 3, 0], 2.0),
        (CapsuleObstacle(kind="capsule", ends={"mm": [[0, 0, 0], [4, 0, 0]]}, radius="1 mm"), [7, 0, 0], 2.0),
    ]
    for spec, point, distance in cases:
        assert spec.made(tmp_path).distance(np.array([point], float))[0] == pytest.approx(distance)


def test_a_closed_mesh_is_read_in_its_unit_and_placed(tmp_path):
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
    faces = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
    lines = ["solid t"]
    for face in faces:
        lines += ["facet normal 0 0 0", "outer loop", *("vertex {} {} {}".format(*corners[i]) for i in face)]
        lines += ["endloop", "endfacet"]
    (tmp_path / "t.stl").write_text("\n".join([*lines, "endsolid t"]))
    spec = MeshObstacle(kind="mesh", file="t.stl", unit="10 mm", translate={"mm": [0, 0, 5]})
    assert spec.made(tmp_path).distance(np.array([[2.0, 2.0, 3.0]]))[0] == pytest.approx(2.0)


TOUCHED = {
    **TWIN,
    "shares": [[0.1], [0.11]],
    "rotate": {"axis": [1, 0, 0], "angle": "180 deg"},
    "translate": {"mm": [0, 0, 16]},
}


@pytest.mark.parametrize("scene", [None, "scene.yaml"])
def test_another_robot_stands_where_its_course_has_it_and_yields_as_its_model_is_cut(bar, monkeypatch, scene):
    """Its mesh is the run's, or that of its own scene; nothing but that and the loads says what is kept."""
    base, asked = bar / "pipelines" / "bar", []
    model = load_model(bar / "models" / "bar" / "spectral")
    patched = SimpleNamespace(patches="patches", model=model)
    monkeypatch.setattr(meeting, "patched_model_of", lambda *given: asked.append(given) or patched)
    monkeypatch.setattr(meeting, "PlacedModel", lambda *given: given)
    cut = SimpleNamespace(cut=(8.0, True), friction=0.0)
    spec = SimpleNamespace(scene="scene.yaml", mesh="../../data/bar/mesh", contact=cut, at_nodes=False, error_places=0)
    if scene:
        spec.scene, spec.mesh = "nothing.yaml", "nowhere"
    obstacle = SimpleNamespace(scene=scene, model="../../models/bar/spectral")
    turn, shift = np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, 16.0])
    course = SimpleNamespace(model=model, R=turn, t=shift)
    other = meeting.other_robot(spec, obstacle, base, "twin", course)
    ((of_model, folder, robot, made_of, *cut),) = asked
    assert of_model is model and folder == base / obstacle.model and cut == [8.0, True]
    expected = made_from(base / "scene.yaml", bar / "data" / "bar" / "mesh") | {"loads": {}}
    assert content_sha256(made_of) == content_sha256(expected)
    assert other.course is course
    with_model, R, t, itself, unilateral = other.learned
    assert with_model is patched and (R is turn) and (t is shift) and itself is False
    np.testing.assert_array_equal(unilateral, robot.unilateral)
    assert other.fe.robot is robot and (other.fe.R is turn) and (other.fe.t is shift) and not other.fe.itself
    assert other.fe.patches == "patches" and other.fe.nodes is model.skin.nodes
    stranger = SimpleNamespace(model=copy(model), R=turn, t=shift)
    stranger.model.meta = model.meta | {"robot": "of another scene"}
    with pytest.raises(InputError, match=r"obstacles\.twin\.scene"):
        meeting.other_robot(spec, obstacle, base, "twin", stranger)


def test_the_error_among_soft_obstacles_is_stated_where_that_of_each_robot_is_known(patched_bar, robot):
    spec = SimpleNamespace(contact=SimpleNamespace(friction=0.0))
    obstacles = SimpleNamespace(rigid={}, pressed=("twin",), avoided=(), moving={}, itself=())
    factors = ContactFactors(probability=0.95, places=20, force=2.0, tip=1.0)
    given = {"probability": 0.95, "left_out": 0, "friction": 0.0, "several": None, "most": 1, "points": 9}
    mine = ContactError(one=factors, off=[1e-3] * len(patched_bar.patches), **given)
    placed = PlacedModel(patched_bar, np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, 16.0]), False)
    course = SimpleNamespace(deltas=lambda share: np.array([0.95]))

    def model(of_other):
        twin = SimpleNamespace(learned=placed, course=course, stated=of_other)
        return meeting._contact_model(spec, obstacles, {"twin": twin}, patched_bar, robot, mine)

    assert model(None).stated == () and model(None).at_displacement([1.05]).bounds is None
    stated = model(mine)
    state = stated.at_displacement([1.05])
    force = state.delta_e[-1]
    assert 0 < state.bounds.force < 0.1 * force and stated.error(state).tip > state.bounds.tip > 0


@pytest.mark.slow
@pytest.mark.parametrize("cut", [{}, {"patches": "8 mm"}])
def test_another_robot_yields_and_is_pressed_with_friction(bar, cut):
    """Two bars bend towards each other, the other one more at the second goal; both give way, in the plan and in finite
    elements, at every node and by patches."""
    search = {"step": "0.2 mm", "weights": [0, 0, 0]}
    twin = {"twin": {**TOUCHED, "press": "15 mN"}}
    more = {"search": search, "contact": {**cut, "friction": 0.3, "error_places": 10}}
    found = cfem.run_stage("control", control(bar, f"twins-{len(cut)}", twin, **more))["results"]
    assert found["obstacles"]["twin"]["error_max"] < 0.03 * 0.015
    assert "2 of 2 commands carried out" in found["headline"][-1]
    if cut:  # patches come and go at edges
        assert found["contact_error"] == {}
        return
    stated = found["contact_error"]["spectral"]
    assert stated["goals"] == stated["stated"] == stated["within"] == 2
    assert found["obstacles"]["twin"]["error_max"] < stated["largest"]["force_error"] < 0.2 * 0.015


@pytest.mark.slow
@pytest.mark.parametrize("mu", [0.0, 0.3])
def test_plans_alone_press_another_robot_and_keep_a_force(bar, mu):
    """The plant goes straight to where the search went by trials, which friction remembers."""
    search = {"step": "0.2 mm", "weights": [0, 0, 0]}
    contact = {"patches": "8 mm", "friction": mu}
    twin = {"twin": {**TOUCHED, "press": "15 mN"}}
    more = {"search": search, "contact": contact, "plant": "model"}
    found = cfem.run_stage("control", control(bar, f"twins-model-{mu}", twin, **more))["results"]
    assert found["obstacles"]["twin"]["error_max"] < 1e-2 * 0.015


@pytest.mark.parametrize(
    ("obstacles", "what"),
    [
        ({"a": {"kind": "itself"}, "b": {"kind": "itself"}}, "a and b are both the robot itself"),
        ({"a": {"kind": "itself", "avoid": "1 mm"}}, "itself takes press or largest_force"),
        ({"twin": {**TOUCHED, "scene": "nothing.yaml"}}, r"nothing\.yaml.*no such file"),
        ({"twin": {**TOUCHED, "translate": {"mm": [0, 0, 9]}}}, r"obstacles\.twin: the robot starts 4\.5 mm inside it"),
    ],
)
def test_what_is_wrong_with_soft_ones_is_said(bar, obstacles, what):
    with pytest.raises((InputError, SpecError), match=what):
        cfem.run_stage("control", control(bar, "soft", obstacles, plant="model"))


def test_a_robot_that_touches_itself_goes_with_goals(bar):
    """A straight bar does not reach itself: the plan is that of the bar alone."""
    for name, obstacles in (("itself", {"own": {"kind": "itself"}}), ("alone", {})):
        cfem.run_stage("control", control(bar, name, obstacles, plant="model", fe_based=False))
    tables = (read_table(bar / "data" / "bar" / name / "trajectories.parquet") for name in ("itself", "alone"))
    mine, other = (np.array(one["delta_a"].to_pylist()) for one in tables)
    assert mine == pytest.approx(other, rel=1e-3)


@pytest.mark.slow
def test_a_payload_and_another_robot_go_together(bar):
    """The load bends the robot away from its twin, which it presses as hard; finite elements carry it too."""
    twin = {"twin": {**TOUCHED, "press": "15 mN"}}
    search, loads = {"step": "0.2 mm", "weights": [0, 0, 0]}, {"tip": {"force": {"N": [0, 0.002, -0.005]}}}
    spec = control(
        bar,
        "loaded-lid",
        twin,
        search=search,
        loads=loads,
        contact={"patches": "8 mm", "friction": 0.3},
    )
    found = cfem.run_stage("control", spec)["results"]
    assert found["obstacles"]["twin"]["error_max"] < 0.03 * 0.015 and found["load_error"] > 0
    assert "2 of 2 commands carried out" in found["headline"][-1]


def test_an_interrupted_run_goes_on_in_contact(bar, tmp_path):
    """A ceiling that comes down, with friction: what has stuck and slipped is not forgotten."""
    way = {"mm": [[0, 0, 0], [0.2, 0, -0.5]]}
    told = {"there": {"kind": "goals", "points": {"mm": [[58.9, 0, 1.5]] * 2}}}
    how = {"contact": {"patches": "8 mm", "friction": 0.3}, "search": {"step": "0.5 mm", "weights": [0, 0, 0]}}
    spec = control(bar, "comes-down", {"ceiling": {**CEILING, "press": "30 mN", "path": way}}, trajectories=told, **how)
    cfem.run_stage("control", spec, out=tmp_path / "whole")
    cut_short(spec, 1, out=tmp_path / "cut")
    cfem.run_stage("control", spec, out=tmp_path / "cut")
    demand_equal(tmp_path / "whole", tmp_path / "cut")
