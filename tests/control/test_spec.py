from pathlib import Path

import pytest

from cfem.control.spec import ControlSpec
from cfem.core.errors import SpecError
from cfem.core.spec import load_spec

PIPELINES = Path(__file__).parents[2] / "pipelines"


@pytest.mark.parametrize("scene", ["bar", "soft-finger", "diamond", "trunk"])
def test_pipelines_are_valid(scene):
    assert load_spec(PIPELINES / scene / "control.yaml", ControlSpec).trajectories


@pytest.mark.parametrize(
    "override, words",
    [
        ("trajectories.swing.radii=[0.6]", "leaves the range"),
        ("trajectories.swing.radii=[0.1, 0.1]", "one number per actuator"),
        ("trajectories.swing.kind=ark", "arc"),
        ("search.step=5", "such as '1 mm'; got the bare number 5 .of a chamber: in mm.3"),
        ("plant=model", "fe_based: needs plant: fem"),
        ("search.itterations=3", "iterations"),
    ],
)
def test_mistakes_are_named(override, words):
    with pytest.raises(SpecError, match=words):
        load_spec(PIPELINES / "bar" / "control.yaml", ControlSpec, [override])
