"""Parts of the body that pass through each other in sampled states: figures, and what is called POOR."""

import numpy as np
import pytest
from sample.synthetic import Factory
from support.closed import box_arrays

from cfem.contact.surface.overlap import boundary_of
from cfem.sample import shard
from cfem.sample.artefact import fill
from cfem.sample.overlap import deeper, finding, overlaps
from cfem.sample.processes.workers import Workers
from cfem.sample.spec import SampleSpec

SPEC = SampleSpec(
    scene="scene.yaml",
    mesh="mesh",
    out="out",
    splits={"train": {"rows": 6, "method": "scrambled-halton", "seed": 1}},
    skeleton=4,
)
DEEP = {"states": 4, "overlapping": 2, "depth_mm": 2.4, "place_mm": [1.0, 2.0, 3.25]}


def test_the_deepest_of_the_states_is_told_with_its_place():
    low, faces = box_arrays([0, 0, 0], [4, 4, 2])
    high, _ = box_arrays([0.5, 0.5, 2.5], [3.5, 3.5, 4])
    X = np.vstack([low, high])
    boundary = boundary_of(X, np.vstack([faces, faces + len(low)]))
    down = (np.arange(len(X)) >= len(low))[:, None] * np.array([0.0, 0.0, -1.0])
    figures = overlaps(boundary, [X + way * down for way in (0.0, 0.4, 0.9, 0.7)])
    assert figures["states"] == 4 and figures["overlapping"] == 2
    assert figures["depth_mm"] == pytest.approx(0.4, abs=1e-9) and figures["place_mm"][2] == 2.5
    assert overlaps(boundary, [X])["place_mm"] is None


def test_more_than_a_hundredth_of_the_length_is_poor():
    (said,) = finding(DEEP, 120.0)
    assert said["what"].startswith(
        "parts of the body pass through each other by 2.4 mm (2 % of the length), at (1, 2, 3.25)"
    )
    assert "in 2 of 4 states" in said["what"]
    assert finding(DEEP, 241.0) == [] and finding(None, 120.0) == []


def test_figures_of_two_skeletons_join():
    more = {"states": 16, "overlapping": 1, "depth_mm": 1.0, "place_mm": [0.0, 0.0, 0.0]}
    assert deeper(more, DEEP) == deeper(DEEP, more) == {**DEEP, "states": 20, "overlapping": 3}
    assert deeper(None, DEEP) == DEEP and deeper(None, None) is None


def test_a_dataset_says_so_and_one_without_a_boundary_nothing(tmp_path, monkeypatch):
    plain = fill(tmp_path / "plain", SPEC, Factory(), "", Workers(1, None, None))
    assert plain["overlap"] is None and plain["judgement"] == []
    monkeypatch.setattr(shard, "overlaps", lambda robot, states: DEEP)
    told = fill(tmp_path / "told", SPEC, Factory(), "", Workers(1, None, None))
    assert told["overlap"] == DEEP and "pass through each other" in told["judgement"][0]["what"]
    assert told["content"] == plain["content"]
