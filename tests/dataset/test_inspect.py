"""The description is for people: it names rows, units, failures and cost."""

import pytest
from dataset.test_reader import META, POISSON, RADIUS, ROWS, YOUNG, full_record, record, write_rows

from cfem.core.errors import InputError
from cfem.dataset.inspect import describe
from cfem.dataset.schema import schema


def test_it_counts_rows_and_reasons_and_states_units_and_cost(tmp_path):
    path = tmp_path / "train.parquet"
    write_rows(path, [record(0), record(1, converged=False), record(2)], schema(ROWS, META))
    text = describe(path)
    assert "made-up: 3 states" in text
    assert "1  the tangent is singular" in text
    lines = {tuple(line.split()[:2]): line.split() for line in text.splitlines() if line.strip()}
    low, high = sorted(record(i)["delta_e"][1] for i in (0, 2))
    unit, least, _, largest = lines["delta_e", "tip.y"][2:]
    assert unit == "mm" and [float(least), float(largest)] == pytest.approx([low, high], rel=1e-4)
    assert "per state: 1.00 factorisations, 3.00 iterations, 100 ms on one core" in text


def test_it_names_the_parameters_and_how_they_were_drawn(tmp_path):
    path = tmp_path / "train.parquet"
    write_rows(path, [full_record(0), full_record(2)], schema(ROWS, META, (POISSON, YOUNG, RADIUS), third_order=True))
    text = describe(path)
    assert "nu (material.poisson): 0.4 to 0.49, 0.45 in the scene; drawn evenly in log(1-2nu)" in text
    assert "E (material.young): 1 to 10 MPa, 3 MPa in the scene; exact, not sampled" in text
    lines = [line.split() for line in text.splitlines()]
    assert [line[2] for line in lines if line[:1] == ["u"]] == ["1"] * 4
    assert ["p", "guide", "mm"] in [line[:3] for line in lines]
    assert ["dW", "mm/N^2"] in [line[:2] for line in lines]


def test_a_dataset_of_failures_can_be_described(tmp_path):
    path = tmp_path / "train.parquet"
    write_rows(path, [record(1, converged=False)], schema(ROWS, META))
    assert "singular" in describe(path)


def test_a_folder_without_a_dataset_is_an_error(tmp_path):
    with pytest.raises(InputError, match="manifest"):
        describe(tmp_path)
