"""A box with a large chamber from a file, through all stages, with `control.yaml` as `cfem init` writes it."""

import numpy as np
import pytest
from pyarrow.parquet import read_table
from support.blocks import hexahedra

import cfem
from cfem.mechanics.mesh import Mesh, boundary_facets
from cfem.robot.mesh.mesh_file import write_mesh

SCENE = """name: box
out: ../../data/box/mesh
length: 80 mm
geometry: {kind: mesh-file, path: box.vtu}
mesh: {size: 10 mm, element: hex8}
material: {young: 0.2 MPa, poisson: 0.45}
fixed: [{kind: plane, point: {mm: [0, 0, 0]}, normal: [-1, 0, 0]}]
actuators: [{kind: cavity, name: air, inside: {mm: [40, 15, 9]}, reach: {mm^3: [0, 3000]}, unilateral: true}]
effectors: [{name: tip, point: {mm: [80, 15, 15]}, radius: 6 mm}]
"""
SAMPLE = """scene: scene.yaml
mesh: ../../data/box/mesh
out: ../../data/box/samples
space: pulling
splits: {train: {rows: 10, method: scrambled-halton, seed: 1}, test: {rows: 3, method: random, seed: 2}}
"""
TRAIN = """dataset: ../../data/box/samples
out: ../../models/box/spectral
model: {kind: spectral}
"""
CONTROL = """scene: scene.yaml
mesh: ../../data/box/mesh
models: {spectral: ../../models/box/spectral}
out: ../../data/box/control
trajectories: {closed-curve: {kind: image, centre: [0.45], radii: [0.3], goals: 24}}
"""


@pytest.fixture(scope="module")
def box(tmp_path_factory):
    """Folder of the specs; the chamber lies below the middle, so that it bends the box upwards."""
    specs = tmp_path_factory.mktemp("project") / "pipelines" / "box"
    specs.mkdir(parents=True)
    full = hexahedra((80, 30, 30), (6, 3, 3))
    full.X[:, 2] = np.interp(full.X[:, 2], [0, 10, 20, 30], [0, 4, 14, 30])
    centre = full.X[full.cells].mean(axis=1)
    cells = full.cells[~((np.abs(centre - [40, 15, 9]) < [27, 1, 1]).all(axis=1))]
    write_mesh(specs / "box.vtu", Mesh(full.X, cells, boundary_facets(cells)))
    for name, text in {"scene": SCENE, "sample": SAMPLE, "train": TRAIN, "control": CONTROL}.items():
        (specs / f"{name}.yaml").write_text(text)
    for stage in ("mesh", "sample", "train"):
        spec = specs / ("scene.yaml" if stage == "mesh" else f"{stage}.yaml")
        cfem.run_stage(stage, spec, **({"workers": 1} if stage == "sample" else {}))
    return specs


def control(box, name, *overrides):
    overrides = ["mesh_error=null", "reached=0.01 mm", *overrides]
    found = cfem.run_stage("control", box / "control.yaml", out=box / name, overrides=overrides)["results"]
    return found, read_table(box / name / "trajectories.parquet")


def test_images_of_a_large_chamber_are_reached_with_the_defaults(box):
    found, table = control(box, "defaults")
    row = found["trajectories"]["closed-curve"]["spectral"]
    assert row["reached"] == row["goals"] == 24 and row["not_converged"] == 0
    assert max(table["predicted_distance"].to_pylist()) < 1e-3 and "judgement" not in found


@pytest.mark.parametrize(
    "search",
    ["search.step=0.1 mm^3", "search.tolerance=3000 mm^3", "search.regularisation=1e3", "search.iterations=1"],
)
def test_a_search_that_is_held_back_makes_the_run_poor_and_no_goal_unreachable(box, search):
    found, table = control(box, "held", search, "trajectories.closed-curve.goals=6")
    (first, *_) = found["judgement"]
    assert "did not converge" in first["what"]
    assert "out of reach" not in table["verdict"].to_pylist() and "out of reach" not in found["headline"][0]


def test_goals_beside_the_curve_of_one_chamber_are_out_of_reach(box):
    stated = "{kind: goals, points: {mm: [[81, 15, 30], [81, 25, 15], [85, 15, 15]]}%s}"
    found, table = control(box, "beside", f"trajectories={{beside: {stated % ''}}}")
    assert set(table["verdict"].to_pylist()) == {"out of reach"}
    (one,) = found["judgement"]
    assert one["what"] == "beside, spectral: 3 of 3 goals are missed, and 3 of them are out of reach"
    found, _ = control(box, "meant", f"trajectories={{beside: {stated % ', beyond_reach: true'}}}")
    assert "judgement" not in found
