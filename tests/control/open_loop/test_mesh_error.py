"""Which tracking results have an estimate of their mesh's error, and what is said where there is none."""

from pathlib import Path

import pytest

from cfem.control.open_loop.mesh_error import discretisation
from cfem.control.spec import ControlSpec
from cfem.core.spec import load_spec

BAR = Path(__file__).parents[3] / "pipelines" / "bar"


@pytest.mark.parametrize(
    "changes, words",
    [
        (["mesh_error=null"], "mesh_error is null"),
        (["obstacles={lid: {kind: plane, point: {mm: [0, 0, 9]}, normal: [0, 0, -1]}}", "fe_based=false"], "contact"),
        (
            ["plant=model", "fe_based=false", "trajectories={a: {kind: goals, points: {mm: [[55, 0, 5]]}}}"],
            "no FE robot",
        ),
    ],
)
def test_what_leaves_it_out_is_said(changes, words):
    spec = load_spec(BAR / "control.yaml", ControlSpec, changes)
    assert words in discretisation(spec, None, None, None, BAR, [])["left_out"]
