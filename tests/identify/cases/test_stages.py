"""`cfem calibrate-cases` and `cfem predict-cases` on a robot whose truth is known."""

import csv
import json

import numpy as np
import pytest
from identify.cases.lab import CASES, NOISE, QUIET, ROLL, YOUNG, lab, write

from cfem.core.errors import InputError, SpecError
from cfem.identify.cases.prediction.stage import run as predict
from cfem.identify.cases.prediction.table import repeats
from cfem.identify.cases.stage import run as calibrate
from cfem.identify.cases.table import Cases


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = lab(tmp_path_factory.mktemp("lab"))
    calibrate(folder / "cases.yaml", [], None, QUIET)
    return folder


def test_truth_is_found_within_its_intervals(folder):
    results = json.loads((folder / "calibrated" / "calibration.json").read_text())
    for name, truth in (("young", YOUNG), ("roll", ROLL)):
        one = results["estimates"][name]
        assert one["interval"][0] <= truth <= one["interval"][1]
        assert one["value"] == pytest.approx(truth, rel=0.05)
    assert 0.5 * NOISE < results["scatter_mm"] < 1.6 * NOISE
    assert results["models"]["kept"]["left_out_mm"] < 4 * NOISE
    json.dumps(results, allow_nan=False)


def test_other_cases_are_predicted_to_the_noise(folder):
    manifest = predict(folder / "predict.yaml", [], None, QUIET)
    results = manifest["results"]
    assert results["mean_mm"] < 3 * NOISE and results["coordinates_within"] >= 0.9
    with open(folder / "predicted" / "predicted.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 12 and float(rows[0]["half_x_mm"]) > NOISE


def test_cases_of_the_calibration_are_no_predictions(folder, tmp_path):
    results = predict(folder / "predict.yaml", ["table=given.csv"], tmp_path / "out", QUIET)["results"]
    assert results["in_fit"] == 4 and "4 of 4 cases are of the calibration" in results["headline"][0]


def test_larger_forces_than_those_of_the_calibration_are_told(folder, tmp_path):
    header = ("case", "session", "tension_N", "marker")
    write(tmp_path / "asked.csv", [["c", "a", 0.5, "t"], ["d", "a", 1.5, "t"]], header)
    manifest = predict(folder / "predict.yaml", [f"table={tmp_path / 'asked.csv'}"], tmp_path / "out", QUIET)
    (said,) = manifest["results"]["judgement"]
    halves = {}
    for beyond in (0.03, 0.0):
        overrides = [f"table={tmp_path / 'asked.csv'}", f"beyond={beyond}"]
        predict(folder / "predict.yaml", overrides, tmp_path / f"{beyond}", QUIET)
        with open(tmp_path / f"{beyond}" / "predicted.csv", newline="") as file:
            halves[beyond] = [float(row["half_z_mm"]) for row in csv.DictReader(file) if row["marker"] == "t"]
    assert halves[0.03][0] == halves[0.0][0] and halves[0.03][1] > 1.5 * halves[0.0][1]
    assert "1 of 2 cases are of larger forces than the calibration, the first d" in str(said)


def test_repeats_are_cases_of_the_same_forces():
    places = np.zeros((3, 2, 3))
    places[1, 0, 2], places[2] = 3.0, 50.0
    cases = Cases(("a", "b", "c"), ("", "", ""), np.array([[1.0], [1.0], [2.0]]), np.ones(3), places, None)
    assert repeats(cases) == {"a": 3.0, "b": 3.0}


def test_cases_that_nobody_measured_are_predicted_too(folder, tmp_path):
    header = ("case", "session", "tension_N", "marker")
    write(tmp_path / "asked.csv", [["c", "b", 0.5, "t"]], header)
    manifest = predict(folder / "predict.yaml", [f"table={tmp_path / 'asked.csv'}"], tmp_path / "out", QUIET)
    assert manifest["results"]["cases"] == 1 and "mean_mm" not in manifest["results"]


@pytest.mark.slow
def test_models_are_compared_and_friction_is_told_apart(folder, tmp_path):
    overrides = ["find=[young, roll]", "compare={alone: [young], rubbing: [young, roll, friction]}"]
    results = calibrate(folder / "cases.yaml", overrides, tmp_path / "out", QUIET)["results"]
    assert results["models"]["alone"]["left_out_mm"] > 2 * results["models"]["kept"]["left_out_mm"]
    assert results["models"]["rubbing"]["left_out_mm"] < 5 * NOISE


def test_one_case_calibrates_and_is_called_poor(folder, tmp_path):
    with open(folder / "given.csv", newline="") as file:
        header, *rows = csv.reader(file)
    write(tmp_path / "given.csv", [row for row in rows if row[0] == "given-1"], header)
    overrides = [f"measurements={tmp_path / 'given.csv'}", "find=[young]", "compare={turned: [young, roll]}"]
    results = calibrate(folder / "cases.yaml", overrides, tmp_path / "out", QUIET)["results"]
    assert results["best"] is None and "no case can be left out" in str(results["judgement"])


def test_a_force_of_another_unit_is_called_poor(folder, tmp_path):
    with open(folder / "given.csv", newline="") as file:
        header, *rows = csv.reader(file)
    column = header.index("tension_N")
    wrong = [[*row[:column], 1e-3 * float(row[column]), *row[column + 1 :]] for row in rows]
    write(tmp_path / "given.csv", wrong, header)
    overrides = [f"measurements={tmp_path / 'given.csv'}", "find=[young]"]
    results = calibrate(folder / "cases.yaml", overrides, tmp_path / "out", QUIET)["results"]
    assert results["judgement"][0]["what"].startswith("the fit leaves") and "units" in results["judgement"][0]["what"]
    right = json.loads((folder / "calibrated" / "calibration.json").read_text())
    assert "the fit leaves" not in str(right["judgement"])


@pytest.mark.slow
def test_offsets_of_markers_are_found(folder, tmp_path):
    with open(folder / "given.csv", newline="") as file:
        header, *rows = csv.reader(file)
    moved = [[*row[:6], float(row[6]) + (4 if row[3] == "t" else 0)] for row in rows]
    write(tmp_path / "given.csv", moved, header)
    overrides = [f"measurements={tmp_path / 'given.csv'}", "offsets={sd: 5 mm}", "find=[young]"]
    results = calibrate(folder / "cases.yaml", overrides, tmp_path / "out", QUIET)["results"]
    assert np.linalg.norm(results["offsets_mm"]["all"]["t"]) == pytest.approx(4, abs=1.5)
    assert np.nanmean(list(results["left_out_mm"]["given-1"].values())) < 2


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"x_mm": lambda x: x / 1000, "y_mm": lambda y: y / 1000, "z_mm": lambda z: z / 1000}, "the unit is another"),
        ({"tension_N": lambda _: ""}, "given.csv:2: column 'tension_N': is empty"),
        ({"z_mm": lambda _: "high"}, "'high' is not a number"),
        ({"marker": lambda _: "q"}, "appears twice|none of the markers"),
    ],
)
def test_bad_tables_are_told(folder, tmp_path, change, message):
    with open(folder / "given.csv", newline="") as file:
        header, *rows = csv.reader(file)
    columns = {header.index(name): how for name, how in change.items()}
    numeric = {4, 5, 6}
    rows = [
        [columns[i](float(cell) if i in numeric else cell) if i in columns else cell for i, cell in enumerate(row)]
        for row in rows
    ]
    write(tmp_path / "given.csv", rows, header)
    with pytest.raises(InputError, match=message):
        calibrate(folder / "cases.yaml", [f"measurements={tmp_path / 'given.csv'}"], tmp_path / "out", QUIET)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("key: frame.turn.x", "key: frame.turn.w", "the rig has no"),
        ("effector: tip", "effector: top", "follows 'top'"),
        ("sd: 4 deg", "sd: 4 mm", "mm.*angle"),
        ("find: [young, roll]", "find: [stiffness]", "none of the parameters"),
        ("unit: N}", "unit: mm}", "not a unit of force"),
    ],
)
def test_bad_specs_are_told(folder, tmp_path, old, new, message):
    (folder / "wrong.yaml").write_text(CASES.replace(old, new))
    with pytest.raises(SpecError, match=message):
        calibrate(folder / "wrong.yaml", [], tmp_path / "out", QUIET)


def test_a_case_without_equilibrium_spoils_no_other(folder, tmp_path):
    header = ("case", "session", "tension_N", "marker")
    write(tmp_path / "asked.csv", [["c", "a", 0.5, "t"], ["d", "a", 4000.0, "t"]], header)
    manifest = predict(folder / "predict.yaml", [f"table={tmp_path / 'asked.csv'}"], tmp_path / "out", QUIET)
    assert list(manifest["results"]["failed"]) == ["d"] and "1 of 2 cases" in manifest["results"]["headline"][0]
