"""`cfem control` of robots that hold an object by their surface, with a model of the free robot: four bars, two below
and two above, side by side."""

import json

import numpy as np
import pyarrow.parquet as pq
import pytest
from support.cut_short import cut_short, demand_equal

import cfem
from cfem.control.holding.body import box_body
from cfem.core.errors import CfemError

CONTROL = """
scene: pipelines/bar/scene.yaml
mesh: data/bar/mesh
models: {spectral: models/bar/spectral}
out: held
object:
  centre: {mm: [58, 0, 8.2]}
  half_size: {mm: [5, 14, 3]}
  force: {mN: [0, -2, 0]}
  law: coulomb
  friction: 0.8
robots:
  - {name: one, translate: {mm: [0, -7, 0]}}
  - {name: two, translate: {mm: [0, 7, 0]}}
  - {name: three, rotate: {axis: [1, 0, 0], angle: 180 deg}, translate: {mm: [0, -7, 16.4]}}
  - {name: four, rotate: {axis: [1, 0, 0], angle: 180 deg}, translate: {mm: [0, 7, 16.4]}}
trajectories: {up: {kind: goals, points: {mm: [[58, 0, 8.25], [58, 0, 8.3]]}}}
search: {weights: [0, 0, 1], regularisation: 1e-8, preload: 0.12 mm}
reached: 0.005 mm
"""


@pytest.fixture
def spec(bar):
    path = bar / "held.yaml"
    path.write_text(CONTROL)
    return path


def test_bars_raise_a_block_that_no_sample_has_held(spec, tmp_path):
    results = cfem.run_stage("control", spec, out=tmp_path / "held")["results"]
    up = results["trajectories"]["up"]["spectral"]
    assert (up["reached"], up["plant_converged"]) == (2, 2)
    assert results["object"]["failures"] == 0 and results["object"]["law_residual"] < 1e-8
    assert results["object"]["margin"] == pytest.approx(results["object"]["margin_planned"], rel=0.1)
    table = pq.read_table(tmp_path / "held" / "trajectories.parquet")
    meta = json.loads(table.schema.metadata[b"cfem"])
    assert meta["rows"][:4] == ["object.x", "object.y", "object.z", "one.cable"]
    rises = [row["x_e"][2] for row in table.to_pylist()]
    np.testing.assert_allclose(rises, [8.25, 8.3], atol=5e-3)
    with np.load(tmp_path / "held" / "states.npz") as states:
        assert states["object_points"] == 8
        np.testing.assert_allclose(states["up/x"][:, -8:, 2].mean(axis=1), rises, atol=1e-4)


def test_an_interrupted_run_goes_on_with_a_body_of_a_file(spec, bar, tmp_path):
    """The block as an STL file; its file has another origin."""
    body = box_body((1.0, 2.0, 3.0), (5.0, 14.0, 3.0))
    facets = "".join(
        "facet normal 0 0 0\nouter loop\n"
        + "".join(f"vertex {x} {y} {z}\n" for x, y, z in body.vertices[triangle])
        + "endloop\nendfacet\n"
        for triangle in body.triangles
    )
    (bar / "block.stl").write_text(f"solid block\n{facets}endsolid block\n")
    asked = [
        "object={centre: {mm: [58, 0, 8.2]}, file: block.stl, force: {mN: [0, -2, 0]}, law: coulomb, friction: 0.8}"
    ]
    for out in ("whole", "cut"):
        if out == "cut":
            cut_short(spec, 1, overrides=asked, out=tmp_path / out)
        cfem.run_stage("control", spec, overrides=asked, out=tmp_path / out)
    demand_equal(tmp_path / "whole", tmp_path / "cut")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            "object.law=bilateral",
            r"a model of the free robot holds an object by friction alone.*give object.law: coulomb",
        ),
        ("object.centre={mm: [58, 0, 7]}", r"object.centre: robot 'one' starts 1 mm inside the object, at \(.* mm"),
        ("object.friction=0", "the grip cannot hold the object"),
    ],
)
def test_what_cannot_be_held_is_refused_before_anything_moves(spec, tmp_path, change, said):
    with pytest.raises(CfemError, match=said):
        cfem.run_stage("control", spec, overrides=[change], out=tmp_path / "refused")
