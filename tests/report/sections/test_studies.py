import pytest
from report.synthetic import point, trained

from cfem.core.errors import InputError
from cfem.report.sections.studies import (
    mesh_row,
    sampling_rows,
    sampling_section,
    sampling_table,
    sizes_section,
    sizes_table,
)
from cfem.report.spec import Published


def controller(step_us: float, mean: float | None) -> dict:
    return {"step_us": {"median": step_us}, "distance_to_reachable_goals": mean and {"mean": mean}}


def test_methods_are_compared_at_all_points_of_all_curves_in_order():
    large, small = trained("mlp"), trained("mlp", losses=(1.0,))
    small["learning_curve"] = [point(5, 1.0)]
    rows = sampling_rows("grid", "network", [large, small])
    assert [row["samples"] for row in rows] == [5, 10, 20]
    assert sampling_table(rows).rows[0][:3] == ("network, grid", "5", "1")


MESH = {"cells": 1600, "nodes": 500}
CONTROL = {
    "trajectories": {
        "near": {"fe-based": controller(40_000, 0.1), "s": controller(100, 0.2), "s@1": controller(1, 9.0)},
        "far": {"fe-based": controller(60_000, None), "s": controller(300, None), "s@1": controller(1, None)},
    }
}


def test_steps_a_second_are_the_median_over_trajectories_of_full_effort():
    published = Published(source="a paper", loss=4e-6)
    row = mesh_row("coarse", MESH, trained("spectral"), CONTROL, published)
    assert row["steps_fe"] == pytest.approx(20.0) and row["steps_learned"] == pytest.approx(5000.0)
    assert row["missed_learned_mm"] == 0.2 and row["missed_fe_mm"] == 0.1
    first, last, paper = sizes_table([row]).rows
    assert first[:2] == ("coarse, 1600 cells, 500 nodes", "10") and first[5] == ""
    assert last[1] == "20" and last[4:] == ("10", "5000", "20", "0.2 / 0.1 mm")
    assert paper[:3] == ("coarse, a paper", "–", "4.00·10⁻⁶")


def test_a_study_without_fe_based_control_says_so():
    alone = {"trajectories": {"near": {"s": controller(100, 0.2)}}}
    with pytest.raises(InputError, match="fe_based"):
        mesh_row("coarse", MESH, trained("spectral"), alone, None)


def test_studies_are_drawn():
    rows = [
        {"method": method, "model": "spectral", "kind": "spectral", **point(samples, 1e-3)}
        for method in ("grid", "scrambled-halton")
        for samples in (36, 100)
    ]
    assert "spectral, grid" in sampling_section(rows).parts[0].legend
    known = Published(source="a paper", samples=6500, loss=4e-6)
    sizes = [
        mesh_row("m", {"cells": cells, "nodes": 500}, trained("spectral"), CONTROL, published)
        for cells, published in ((1600, None), (9000, known), (20_000, None))
    ]
    picture, table = sizes_section(sizes).parts
    assert "a paper, 6500 samples" in picture.legend and len(table.rows) == 7
    assert len(sizes_section(sizes[:2]).parts) == 1
