"""The headline says what a reader must not miss."""

import pytest

from cfem.control.summary import headline, summarise


def rows(controller: str, inside: bool, error: float) -> list[dict]:
    common = {"status": "converged", "plant_status": "converged", "softened": False, "iterations": 3, "step_us": 90.0}
    return [
        {**common, "controller": controller, "inside": inside, "error": error, "error_to_fe_based": error}
        | {"reachable": index < 3, "kkt": 1e-12}
        for index in range(4)
    ]


@pytest.mark.parametrize("inside", [True, False])
def test_plans_outside_the_training_states_are_flagged(inside):
    found = summarise(rows("spectral", inside, 0.2), length=100.0)
    (line,) = headline({"circle": found})
    assert ("4 plans OUTSIDE" in line) is not inside
    assert "3 of 4 goals in reach" in line and "90 us a step" in line


def test_distances_are_also_shares_of_the_length():
    near = summarise(rows("spectral", True, 0.2), length=100.0)["spectral"]["distance_to_reachable_goals"]
    assert near == pytest.approx({"mean": 0.2, "max": 0.2, "mean_percent": 0.2, "max_percent": 0.2})
