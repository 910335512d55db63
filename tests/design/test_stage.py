"""`cfem optimize-design` from a spec to its artefact: bars of any length and height, learned and verified by FE."""

import json
from copy import deepcopy

import numpy as np
import pyarrow.parquet as pq
import pytest
from design.bars import QUIET, learn

from cfem.core.errors import SpecError
from cfem.design.answer import contradictions, parameters, unchecked
from cfem.design.stage import run
from cfem.robot.cad import File, SurfaceSolid
from cfem.robot.mesh.meshing import measure
from cfem.robot.stage import run as make_mesh
from cfem.surrogate.stage import run as train

QUICK = ("verify=no", "page=false", "task=null", "figures=false", "constraints={}", "largest_force=null")
SAMPLE = """
scene: scene.yaml
mesh: mesh
out: samples
parameters:
  height: {key: geometry.height, range: {mm: [9, 12]}}
  length: {key: geometry.length, range: {mm: [59, 62]}}
splits:
  train: {rows: 60, method: scrambled-halton, seed: 1}
  test: {rows: 10, method: random, seed: 2}
"""
DESIGN = """
model: model
scene: scene.yaml
mesh: mesh
out: out
actuation: {displacement: {mm: [2]}}
objectives:
  dexterity: {kind: dexterity, axis: x, rest: {mm: [58, 0, 0]}}
  strength: {kind: strength, axis: z, largest: 10 N}
  effort: {kind: python, function: "own.py:effort"}
blends:
  both: {dexterity: 1, strength: 2}
front: {of: [dexterity, effort], points: 5}
constraints:
  mass: volume <= 6900
  slender: height <= length / 5
largest_force: 50 N
grid: [6, 5]
sensitivity: 64
page: true
verify: fe
task:
  goals: {mm: [[57.5, 0, 3], [56, 0, 8]]}
  force: {N: [0, 0, 0.02]}
  starts: 2
"""
OWN = "import numpy as np\ndef effort(W, delta_free, p):\n    return ((2 - delta_free[:, 3]) / W[:, 3, 3]) ** 2\n"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("design")
    learn(folder, 8, SAMPLE, DESIGN)
    (folder / "own.py").write_text(OWN)
    return folder


@pytest.fixture(scope="module")
def done(folder):
    return run(folder / "design.yaml", [], None, QUIET)["results"]


def test_best_designs_keep_their_constraints_and_finite_elements_agree(folder, done):
    json.dumps(json.loads((folder / "out" / "design.json").read_text()), allow_nan=False)
    for name in ("dexterity", "strength", "effort", "both", "front first", "front last"):
        entry = done["designs"][name]
        p, slack = entry["p"], entry["constraints"]
        assert set(slack) == {"mass", "slender", "force of up"} and min(slack.values()) >= -1e-5
        assert entry["volume"]["cad"] == pytest.approx(10 * p["height"] * p["length"], rel=1e-9)
        assert entry["volume"]["fitted"] == pytest.approx(entry["volume"]["cad"], rel=1e-9)
        share = entry["fe"]["gap_share_of_spread"]
        assert share["dexterity"] < 0.01 and share["effort"] < 0.01 and abs(entry["fe"]["gap"]["strength"]) < 0.05
        assert entry["fe"]["effector_distance"] < 0.01
        for key, value in entry["fe"]["objectives"].items():
            assert entry["fe"]["gap"][key] == pytest.approx(entry["objectives"][key] - value)
    # a thin bar takes the least force: the thinnest of all is within the constraints
    assert done["designs"]["effort"]["p"]["height"] == pytest.approx(9.0)
    assert done["slopes_checked"] < 1e-5 and done["grid"]["feasible"] < 30


def test_the_headline_states_units_and_no_long_list_of_parameters(done):
    (line,) = (one for one in done["headline"] if one.startswith("best strength: "))
    entry = done["designs"]["strength"]
    assert f"best strength: {entry['objectives']['strength']:.5g} N; by finite elements" in line
    assert f"length {entry['p']['length']:.4g} mm" in line
    assert " rad; by finite elements" in next(one for one in done["headline"] if one.startswith("best dexterity: "))
    many = {f"p{i}": 1.0 for i in range(12)}
    assert parameters(many, {}) == "a design whose 12 parameters are in design.json"


def test_a_design_that_finite_elements_contradict_is_said(done):
    assert "judgement" not in done
    designs = deepcopy(done["designs"])
    fe = designs["effort"]["fe"]
    fe["objectives"]["effort"] *= 3
    fe["said"]["effort"] = "3 N^2"
    fe["gap_share_of_spread"]["effort"] = 2.0
    judged = contradictions(designs)
    assert [one["what"].split(":")[0] for one in judged] == ["design effort"] and judged[0]["contradicted"]
    assert "effort 3 N^2, the model" in judged[0]["what"]
    assert "200 % of its spread" in judged[0]["what"]


def test_a_guess_of_the_model_that_nothing_has_checked_is_said(done):
    designs = deepcopy(done["designs"])
    assert unchecked(designs) == []
    for entry in designs.values():
        entry |= {"outside": True, "uncertain": ["strength"]}
    assert unchecked(designs) == []  # finite elements have checked them
    unseen = {name: designs[name] for name in ("dexterity", "strength")}
    for entry in unseen.values():
        del entry["fe"]
    outside_first, outside_second, inverse = (finding["what"] for finding in unchecked(unseen))
    assert outside_first.startswith("design dexterity is outside") and outside_second.startswith("design strength is")
    assert inverse.startswith("design strength: strength inverts the compliance of the tip")


def test_it_is_told_which_parameter_matters(done):
    shares = done["sensitivity"]["effort"]
    assert set(shares) == {"first", "total"} and set(shares["total"]) == {"length", "height"}
    assert shares["total"]["height"] > 0.9  # the force of a bent bar goes with its height cubed
    assert any(one.startswith("effort depends on height") for one in done["headline"])


def test_front_tables_and_pictures(folder, done):
    out = folder / "out"
    assert done["page"] == "front.html" and (out / "front.html").read_text().count("design ") > 5
    front = pq.read_table(out / "front.parquet")
    assert front.num_rows == done["front"]["designs"] >= 5 and done["front"]["beaten_by_grid"] == 0
    assert pq.read_table(out / "grid.parquet").num_rows == 30
    meta = json.loads(front.schema.metadata[b"cfem"])
    assert meta["units"]["height"] == "mm" and "slack.mass" in front.column_names
    first = front["objective.dexterity"].to_numpy()
    assert (np.diff(first) > 0).all() and (np.diff(front["objective.effort"].to_numpy()) < 0).all()
    for name in done["figures"]:
        assert (out / name).read_bytes()[:4] == b"\x89PNG"
    assert set(done["figures"]) == {f"landscape-{name}.png" for name in done["spread"]} | {"front.png"}


def test_overrides_of_a_best_design_make_its_mesh(folder, done, tmp_path):
    overrides = done["designs"]["dexterity"]["overrides"]
    mesh = make_mesh(folder / "scene.yaml", overrides, tmp_path / "mesh", QUIET)["results"]
    assert mesh["volume"] == pytest.approx(done["designs"]["dexterity"]["volume"]["cad"], rel=1e-6)


def test_the_task_is_served_better_than_by_the_reference_and_as_the_model_says(done):
    task = done["task"]
    assert sum(np.square(task["found"]["distance"])) < sum(np.square(task["reference"]["distance"]))
    assert np.asarray(task["found"]["fe_distance"]) == pytest.approx(task["found"]["distance"], abs=0.01)


def test_a_changed_function_makes_the_output_stale(folder, done):
    assert run(folder / "design.yaml", [], None, QUIET)["status"] == "up to date"
    (folder / "own.py").write_text(OWN + "# changed\n")
    again = run(folder / "design.yaml", QUICK, folder / "again", QUIET)
    (folder / "own.py").write_text(OWN)
    assert again["status"] == "done" and "fe" not in again["results"]["designs"]["both"]
    fresh = run(folder / "design.yaml", QUICK, folder / "again", QUIET)
    assert fresh["status"] == "done"


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (["grid=[3]"], "grid: has 1 numbers of points, and 2 parameters vary"),
        (["grid=2000"], r"grid: has 4.0e\+06 designs, of 2 parameters .scatter them"),
        (["page=true", "front=null"], "page: needs a front, and verify: fe or fe-front"),
        (["sensitivity=100"], "sensitivity: must be a power of two, such as 1024, got 100"),
        (["vary=[width]"], "vary: unknown parameter 'width'.*known are height, length"),
        (
            ["actuation={displacement: {mm: [1, 2]}}"],
            "actuation.displacement: has 2 numbers, and the robot 1 actuators",
        ),
        (["actuation={displacement: {mm: [1]}, force: {N: [1]}}"], "one of the two"),
        (["blends={a: {agility: 1}}"], "blends.a: no objective 'agility'"),
        (["constraints={a: 'volume <= depth'}"], "constraints.a: unknown name 'depth'"),
        (["constraints={a: {function: 'own.py:effort'}}"], "needs at_least or at_most"),
        (["objectives.dexterity.effector=nose"], "objectives.dexterity: no effector 'nose'"),
        (["controller={parameters: {height: 10 mm}}"], "controller.parameters: each design has its own"),
        (["mesh=null"], "verify: fe needs scene and mesh"),
        (["task.weights=[1]"], "task.weights: has 1 numbers, and the robot 3"),
        (["fixed={height: 40 mm}", "front=null"], "fixed.height: 40 is out of the range"),
    ],
)
def test_a_wrong_spec_says_where(folder, tmp_path, overrides, message):
    first = ["verify=no", "page=false"] if "mesh=null" not in overrides else []
    with pytest.raises(SpecError, match=message):
        run(folder / "design.yaml", [*first, *overrides], tmp_path / "out", QUIET)


@pytest.mark.slow
def test_best_designs_come_as_cad_files_and_with_their_controllers(folder):
    asked = (
        "verify=no",
        "page=false",
        "task=null",
        "figures=false",
        "front=null",
        "blends={}",
        "cad=true",
        "grid=[3, 3]",
    )
    asked += ("controller={controller: {K_I: 0.1}}",)
    made = run(folder / "design.yaml", asked, folder / "with-cad", QUIET)
    entry = made["results"]["designs"]["dexterity"]
    volume, _ = measure(File(str(folder / "with-cad" / "dexterity.step")))
    assert volume == pytest.approx(entry["p"]["height"] * entry["p"]["length"] * 10, rel=1e-9)
    assert measure(SurfaceSolid(str(folder / "with-cad" / "dexterity.stl")))[0] == pytest.approx(volume, rel=1e-6)
    for name, one in made["results"]["controllers"].items():
        assert (folder / "with-cad" / f"{name}-controller" / "cfem_controller.c").exists()
        assert one["parity"] is None or one["parity"] < 1e-12


@pytest.mark.slow
def test_designs_are_refined_by_finite_elements(folder):
    """A model that is wrong (of few terms): finite elements still end at an optimum of their own, no worse than the
    model's best design."""
    (folder / "poor.yaml").write_text("dataset: samples\nout: poor\nmodel: {kind: spectral, max_degree: 2}\n")
    train(folder / "poor.yaml", [], None, QUIET)
    overrides = [
        *QUICK[:4],
        "model=poor",
        "front=null",
        "blends={}",
        "sensitivity=null",
        "constraints={slender: height <= length / 5.5}",
        "objectives={stiff: {kind: stiffness, direction: [0, 0, 1]}, dexterity: {kind: dexterity, axis: x}}",
        "refine={starts: 2, solves: 12, tolerance: 1e-3}",
        "cad=true",
    ]
    found = run(folder / "design.yaml", overrides, folder / "refined", QUIET)["results"]
    for name, one in found["refined"].items():
        assert one["certified"] and one["residual"] <= 1e-3 and min(one["constraints"].values()) >= -1e-4
        assert one["objectives"][name] <= one["of_the_models_design"][name] + 1e-9
        assert all(start["solves"] <= 12 for start in one["starts"]) and one["starts_that_agree"] >= 1
    # the stiffest bar is the highest that the constraint allows
    p = found["refined"]["stiff"]["p"]
    assert p["height"] == pytest.approx(p["length"] / 5.5, rel=1e-4)
    volume, _ = measure(File(str(folder / "refined" / "stiff-by-finite-elements.step")))
    assert volume == pytest.approx(10 * p["height"] * p["length"], rel=1e-6)
    assert sum("by finite elements (the model's best design in brackets)" in line for line in found["headline"]) == 2


def test_refining_needs_a_scene_and_a_mesh(folder):
    with pytest.raises(SpecError, match="refine: needs scene and mesh"):
        run(folder / "design.yaml", [*QUICK, "mesh=null", "refine={}"], None, QUIET)


def test_a_design_to_which_the_mesh_does_not_stretch_is_checked_on_its_own(folder, monkeypatch):
    """Its mesh counts as stretched too far where a cell has less than 0.93 of its volume: the thinnest bar is."""
    monkeypatch.setattr("cfem.robot.shape.morph.THINNEST", 0.93)
    overrides = [
        *QUICK[1:],
        "front=null",
        "blends={}",
        "sensitivity=null",
        "objectives={effort: {kind: python, function: 'own.py:effort'}}",
    ]
    found = run(folder / "design.yaml", overrides, folder / "own-mesh", QUIET)["results"]
    (own,) = found["meshes"]
    assert own["p"]["height"] == pytest.approx(9.0) and own["cells"] > 10
    entry = found["designs"]["effort"]
    # another mesh of linear tetrahedra has another error: the gap is that of the two, and still small
    assert 0 < abs(entry["fe"]["gap"]["effort"]) < 0.2 * entry["objectives"]["effort"]
    assert any("which has a mesh of its own of" in line for line in found["headline"])
