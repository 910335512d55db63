"""`cfem measurements`: from exports to the table, whatever the markers are called, and one error for each bad input."""

import csv

import numpy as np
import pytest
from identify.recordings.recordings import FALL, PLACES, motion, write_optitrack

from cfem.core.errors import InputError
from cfem.core.stage import Options
from cfem.identify.recordings.stage import run

LABELS = [f"Unlabeled {i}" for i in (1413, 9, 22, 5, 6, 7)]
QUIET = Options(quiet=True)


def spec(folder, more="", rest="true"):
    markers = "\n".join(f"  {name}: {{mm: {place}}}" for name, place in PLACES.items())
    recordings = "recordings:\n  - {file: a.csv, case: half, session: monday, forces: {weight: 0.5}}\n"
    text = f"{recordings}out: out\nrest: {rest}\nmarkers:\n{markers}\nsettle: {{window: 0.4 s, within: 0.3 mm}}\n{more}"
    (folder / "measurements.yaml").write_text(text)


def table(folder):
    run(folder / "measurements.yaml", [], None, QUIET)
    with open(folder / "out" / "cases.csv", newline="") as file:
        return {row["marker"]: row for row in csv.DictReader(file)}


def moved(row):
    return np.array([float(row[f"{a}_mm"]) - float(row[f"rest_{a}_mm"]) for a in "xyz"])


@pytest.mark.parametrize("order", [[0, 1, 2, 3, 4, 5], [4, 2, 0, 1, 5, 3]])
def test_markers_are_named_by_their_places(tmp_path, order):
    time, points = motion()
    write_optitrack(tmp_path / "a.csv", time, points[:, order], LABELS)
    spec(tmp_path)
    rows = table(tmp_path)
    for name, place in PLACES.items():
        rest = [float(rows[name][f"rest_{a}_mm"]) for a in "xyz"]
        np.testing.assert_allclose(rest, place, atol=0.05)
        np.testing.assert_allclose(moved(rows[name]), FALL if name.startswith("tip") else 0, atol=0.05)
        noise = [float(rows[name][f"sd_{a}_mm"]) for a in "xyz"]
        assert np.mean(noise) > 0.012 and (name.startswith("tip") or np.mean(noise) < 0.03)
    assert rows["tip1"]["weight"] == "0.5" and rows["tip1"]["session"] == "monday"


def test_hidden_and_swapped_markers_do_no_harm(tmp_path):
    time, points = motion()
    points[:, 1] = np.nan  # base2 is hidden throughout
    points[150:, [3, 4]] = points[150:, [4, 3]]  # tip1 and tip2 swap names while they fall
    points[200:230, 5] = np.nan
    write_optitrack(tmp_path / "a.csv", time, points, LABELS)
    spec(tmp_path)
    rows = table(tmp_path)
    assert rows["base2"]["x_mm"] == ""
    for name in ("tip1", "tip2", "tip3"):
        np.testing.assert_allclose(moved(rows[name]), FALL, atol=0.05)


def test_without_rest_the_base_lays_the_frame(tmp_path):
    time, points = motion()
    write_optitrack(tmp_path / "a.csv", time[250:], points[250:], list(PLACES))
    spec(tmp_path, "registration: {by: [base1, base2, base3]}\n", rest="false")
    rows = table(tmp_path)
    there = [float(rows["tip2"][f"{a}_mm"]) for a in "xyz"]
    np.testing.assert_allclose(there, PLACES["tip2"] + FALL, atol=0.5)


def bad(folder, points, message, time=None, labels=LABELS, **options):
    write_optitrack(folder / "a.csv", motion()[0] if time is None else time, points, labels)
    spec(folder, **options)
    with pytest.raises(InputError, match=message):
        run(folder / "measurements.yaml", [], None, QUIET)


def test_another_unit_is_told(tmp_path):
    labelled = "registration: {by: [base1, base2, base3], tolerance: 5 mm}\n"
    bad(tmp_path, 1000 * motion()[1][250:], "never settles|another unit|lie as three", motion()[0][250:],
        list(PLACES), more=labelled, rest="false")  # fmt: skip


def test_a_left_handed_frame_is_told(tmp_path):
    bad(tmp_path, motion()[1] * [1, 1, -1], "left-handed")


def test_a_recording_that_never_settles_is_told(tmp_path):
    time, points = motion()
    points = points + 30 * np.sin(20 * time)[:, None, None]
    bad(tmp_path, points, "never settles")


def test_a_recording_without_rest_is_told(tmp_path):
    bad(tmp_path, motion()[1][300:], "settles only once", motion()[0][300:])
