"""Designs judged by finite elements alone: gradients against differences of whole solves, and a whole search."""

import json
from itertools import product

import numpy as np
import pytest
from support.fast_cases import fast_are

from cfem.core.errors import NumericalError, SpecError
from cfem.core.spec import load_spec
from cfem.core.stage import Options
from cfem.design.fe import partials
from cfem.design.formulation import problem_of
from cfem.design.spec import DesignSpec
from cfem.design.stage import run
from cfem.parametric.load import differentiable
from cfem.robot.cad import File
from cfem.robot.mesh.meshing import measure
from cfem.robot.stage import run as make_mesh

QUIET = Options(quiet=True)
SCENE = """
name: bar
out: mesh
length: 60 mm
geometry: {kind: bar, length: 60 mm, width: 10 mm, height: 10 mm}
mesh: {size: 10 mm, element: tet10p0}
material: {law: neo-hookean, young: 1 MPa, poisson: 0.45, density: 1070 kg/m^3}
materials:
  - region: {kind: box, corners: {mm: [[20, -5, -5], [40, 5, 5]]}}
    material: {young: 2 MPa, poisson: 0.45, density: 1000 kg/m^3}
fixed: [{kind: plane, point: {mm: [0.01, 0, 0]}, normal: [-1, 0, 0]}]
actuators:
  - {kind: cable, name: up, points: {mm: [[15, 0, 3], [55, 0, 3]]}, pull_point: {mm: [0, 0, 3]}, reach: {mm: [0, 4]}}
effectors: [{name: tip, point: {mm: [58, 0, 0]}}]
"""
DESIGN = """
by: fe
scene: scene.yaml
mesh: mesh
out: out
actuation: {displacement: {mm: [3]}}
parameters:
  E: {key: material.young, range: {MPa: [0.5, 2]}}
  E2: {key: materials.0.material.young, range: {MPa: [0.5, 4]}}
  z: {key: actuators.0.points.0.2, range: {mm: [2, 4]}}
objectives:
  bend: {kind: python, function: "own.py:bend", sense: maximise}
  stiff: {kind: stiffness, direction: [0, 0, 1]}
  strain: {kind: strain}
constraints: {soft: E + E2 <= 5}
largest_force: 12 N
screen: 3
starts: 1
figures: false
"""
OWN = "def bend(W, delta_free, p):\n    return delta_free[:, 2] * W[:, 3, 3] + p[:, 0]\n"
SHAPES = SCENE.replace("materials:\n", "").split("  - region")[0] + SCENE[SCENE.index("fixed:") :]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fe")
    for name, text in {"scene.yaml": SCENE, "design.yaml": DESIGN, "own.py": OWN, "shape.yaml": SHAPES}.items():
        (folder / name).write_text(text)
    make_mesh(folder / "scene.yaml", [], None, QUIET)
    make_mesh(folder / "shape.yaml", ["out=shape"], None, QUIET)
    return folder


def problem(folder, *overrides):
    spec = load_spec(folder / "design.yaml", DesignSpec, overrides)
    kinds = [getattr(one, "number", one.kind) for one in spec.objectives.values()]
    family = differentiable(folder / spec.scene, folder / spec.mesh, spec.parameters, kinds)
    return problem_of(spec, family, folder / spec.scene, folder)[0]


MANY = (
    "objectives={bend: {kind: python, function: 'own.py:bend'}, stiff: {kind: stiffness, direction: [0, 0, 1]}, "
    "strain: {kind: strain}, stress: {kind: stress}, mass: {kind: mass}, volume: {kind: volume}, "
    "push: {kind: force, direction: [0, 0, 1], goal: {mm: [57, 0, 2]}}, "
    "strength: {kind: strength, axis: z, largest: 10 N}, ring: {kind: frequency}, "
    "loose: {kind: frequency, actuators: free}}"
)
OVER = (
    "objectives={reach: {kind: workspace, points: 3}, handy: {kind: manipulability, points: 2}, "
    "stiff: {kind: stiffness, direction: [0, 1, 0], points: 2}}"
)


LED, LOADED = "actuation={displacement: {mm: [3]}}", "actuation={force: {N: [1.5]}}"


@pytest.mark.parametrize(
    "asked, actuation", fast_are([(MANY, LOADED), (OVER, LED)], product([MANY, OVER], [LED, LOADED]))
)
def test_slopes_are_those_of_whole_solves(folder, asked, actuation):
    mine = problem(folder, asked, actuation)
    assert mine.slope_error(np.array([0.4, 0.6, 0.3])) < 2e-5


def test_slopes_by_shape_and_by_a_parameter_that_is_exact_elsewhere(folder):
    asked = (
        "parameters={E: {key: material.young, range: {MPa: [0.5, 2]}}, "
        "L: {key: geometry.length, range: {mm: [58.5, 62]}}}",
        "objectives={stiff: {kind: stiffness, direction: [0, 0, 1]}, volume: {kind: volume}, strain: {kind: strain}}",
        "constraints={}",
    )
    mine = problem(folder, *asked, "scene=shape.yaml", "mesh=shape")
    assert mine.slope_error(np.array([0.4, 0.6])) < 5e-6
    values, slopes = mine.with_slopes(np.array([0.4, 0.6]))
    assert values[1] == pytest.approx(100 * (58.5 + 0.6 * 3.5)) and slopes[1] == pytest.approx([0.0, 350.0])


def test_a_gradient_costs_one_solve_whatever_the_number_of_parameters(folder):
    mine = problem(folder)
    mine.with_slopes(np.full(3, 0.5))
    before = mine.family.solves
    mine.with_slopes(np.full(3, 0.51))
    assert mine.family.solves == before + 1 and mine.evaluations == 2


ROBUST = (
    "objectives={stiff: {kind: stiffness, direction: [0, 0, 1]}, "
    "sure: {kind: robust, of: stiff, scatter: {E: 0.01 MPa, z: 0.02 mm}, "
    "share: 0.8, robots: 24}}"
)


def test_a_robust_objective_is_that_of_scattered_robots_to_first_order(folder):
    """Against 24 robots, solved one by one; E varies by its logarithm, and does not vary here but scatters."""
    mine = problem(folder, ROBUST, "vary=[E2, z]", "constraints={}")
    z = np.array([0.6, 0.3])
    value = mine(z[None]).objectives[0]
    p = mine.p(z[None])
    sure = mine.objectives["sure"]
    robots = mine.family.at(mine.kind, mine.u, sure.parameters(p))
    sampled = sure(sure.number(robots)[None])[0]
    assert 0 < value[1] - value[0] < 1e-3
    assert value[1] - value[0] == pytest.approx(sampled - value[0], rel=0.15)  # a quantile of few robots scatters


@pytest.mark.slow
def test_the_slopes_of_a_robust_objective_are_differences_of_its_values(folder):
    mine = problem(folder, ROBUST, "constraints={}")
    assert mine.slope_error(np.array([0.4, 0.6, 0.3])) < 1e-4
    before = mine.family.solves
    mine.with_slopes(np.array([0.41, 0.6, 0.3]))
    assert mine.family.solves <= before + 4  # one for what is plain, three for the robust one


def test_partials_of_a_function_of_a_states_numbers(folder):
    mine = problem(folder)
    states = mine.states(np.full((1, 3), 0.5))

    def rows(found):
        return np.stack([found.W[:, 0, 3] ** 2, found.delta_free[:, 1] * found.p[:, 2], found.numbers["mass"]], axis=1)

    values, outputs, by_z = partials(rows, states, np.diag([0.0, 0.0, 2.0]))
    assert values == pytest.approx(rows(states)[0])
    W = outputs[0][0].W
    assert W[0, 3] == W[3, 0] == pytest.approx(states.W[0, 0, 3], rel=1e-9)  # half of 2 W each, of a pair that is one
    assert outputs[1][0].free[1] == pytest.approx(states.p[0, 2], rel=1e-9)
    assert outputs[2][0].numbers["mass"] == pytest.approx(1.0)
    assert by_z[1] == pytest.approx([0, 0, 2 * states.delta_free[0, 1]], rel=1e-6)


def test_a_design_that_cannot_be_solved_counts_as_worse_than_all(folder, monkeypatch):
    mine = problem(folder)
    grid = mine.screen(2, np.full(3, 0.5))
    assert len(grid.z) == 2

    def fails(*_, **__):
        raise NumericalError("no equilibrium")

    monkeypatch.setattr(mine.family, "solve", fails)
    values, slopes = mine.with_slopes(np.full(3, 0.6))
    n_f = len(mine.objectives)
    assert (values[:n_f] > grid.scores.objectives.max(axis=0)).all() and (values[n_f:] < 0).all()
    assert not slopes.any() and mine.failed == 1
    with pytest.raises(NumericalError, match="solve none of the 2 designs tried first"):
        mine.screen(2, np.full(3, 0.5))


def test_a_search_from_a_spec_to_its_artefact(folder):
    two = "objectives={bend: {kind: python, function: 'own.py:bend', sense: maximise}, strain: {kind: strain}}"
    results = run(folder / "design.yaml", [two], None, QUIET)["results"]
    bend = results["designs"]["bend"]
    start = json.loads((folder / "out" / "design.json").read_text())["grid"]
    assert start == {"designs": 3, "feasible": 3} or start["designs"] == 3
    assert results["slopes_checked"] < 2e-5 and results["solves"] < 120
    assert results["spread"]["strain"][0] >= results["designs"]["strain"]["objectives"]["strain"] - 1e-9
    assert bend["constraints"]["soft"] >= -1e-6
    assert any("finite-element solves" in line for line in results["headline"])


FORM = "shape: {controls: [{at: {mm: [30, 0, 5]}, move: {mm: [0, 0, 0.5]}, radius: 20 mm}]}"


def test_a_free_form_leaves_as_triangles_of_its_mesh_and_says_so(folder):
    """The bar that vibrates fastest, of a bulge that may grow: finite elements, a STEP file of the mesh's volume."""
    (folder / "formed.yaml").write_text(SHAPES + FORM)
    make_mesh(folder / "formed.yaml", ["out=formed"], None, QUIET)
    overrides = [
        "scene=formed.yaml",
        "mesh=formed",
        "parameters={bulge: {key: shape.controls.0.move.2, range: {mm: [-1, 1]}}}",
        "objectives={ring: {kind: frequency}, volume: {kind: volume}}",
        "constraints={}",
        "cad=true",
    ]
    results = run(folder / "design.yaml", overrides, folder / "formed-out", QUIET)["results"]
    assert results["slopes_checked"] < 2e-5
    ring = results["designs"]["ring"]
    assert -ring["objectives"]["ring"] > 5.0 and 5800 < ring["objectives"]["volume"] < 6200
    volume, _ = measure(File(str(folder / "formed-out" / "ring.step")))
    assert volume == pytest.approx(ring["objectives"]["volume"], rel=1e-6)
    assert any("flat facets of the mesh" in line for line in results["headline"])


BAD = {
    "no parameters": (["parameters={}"], "parameters: by: fe needs the numbers that vary"),
    "a model beside": (["model=somewhere"], "model: goes with by: model"),
    "no mesh": (["mesh=null"], "by: fe needs scene and mesh"),
    "a task": (["task={goals: {mm: [[1, 2, 3]]}}"], "task: needs a model"),
    "a robust mean": (
        ["objectives={a: {kind: dexterity}, b: {kind: robust, of: a, scatter: {E: 0.1 MPa}, statistic: mean}}"],
        "objectives.b: finite elements take scatter to first order, to which the mean is 'a' itself",
    ),
    "verify": (["verify=fe"], "finite elements judge every design already"),
    "no model": (["by=model"], "model: needed where a model judges designs"),
}


@pytest.mark.parametrize("overrides, part", BAD.values(), ids=BAD.keys())
def test_bad_specs_are_one_sentence(folder, overrides, part):
    with pytest.raises(SpecError, match=part):
        load_spec(folder / "design.yaml", DesignSpec, overrides)


def test_what_the_robot_cannot_give_is_said(folder, monkeypatch):
    monkeypatch.setattr("cfem.design.formulation.MOST_STATES", 10)
    with pytest.raises(SpecError, match="20 actuations along each of 1 reaches are more than 10 states"):
        problem(folder, "objectives={reach: {kind: manipulability, points: 20}}")
    bare = SCENE.replace(", density: 1000 kg/m^3", "")
    (folder / "bare.yaml").write_text(bare)
    make_mesh(folder / "bare.yaml", ["out=bare"], None, QUIET)
    with pytest.raises(SpecError, match="mass needs the density of each material"):
        problem(folder, "objectives={heavy: {kind: mass}}", "scene=bare.yaml", "mesh=bare")
