"""Tables of measurements, and what is wrong with them in one sentence."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from surrogate.stored import store_dataset

from cfem.condensed import Rows
from cfem.core.errors import InputError
from cfem.identify.robot.measurements import read_measurements

ROWS = Rows(("tip.x", "tip.y"), ("left", "right"))
CSV = """left.displacement [mm], right.displacement [cm], tip.x [mm], tip.y.displacement [mm], left.force [mN]
1, 0.2, 3.5, ,
4, 0.5, , 6.5, 7000
"""
YAML = """
- {left.displacement: 1 mm, right.displacement: 2 mm, tip.x: 3.5 mm}
- {left.displacement: 4 mm, right.displacement: 0.5 cm, tip.y.displacement: 6.5 mm, left.force: 7 N}
"""


def write(folder, name, text):
    (folder / name).write_text(text)
    return folder / name


def test_csv_yaml_and_parquet_say_the_same(tmp_path):
    columns = {"left.displacement [mm]": [1.0, 4.0], "right.displacement [mm]": [2, 5], "tip.x [mm]": [3.5, None]}
    columns |= {"tip.y.displacement [mm]": [None, 6.5], "left.force [N]": [None, 7.0]}
    pq.write_table(pa.table(columns), tmp_path / "m.parquet")
    tables = [write(tmp_path, "m.csv", CSV), write(tmp_path, "m.yaml", YAML), tmp_path / "m.parquet"]
    nan = np.nan
    for path in tables:
        found = read_measurements(path, ROWS, "displacement")
        assert found.u == pytest.approx(np.array([[1, 2], [4, 5]]))
        assert np.array_equal(found.x_e, [[3.5, nan], [nan, nan]], equal_nan=True)
        assert np.array_equal(found.delta_e, [[nan, nan], [nan, 6.5]], equal_nan=True)
        assert np.array_equal(found.dual, [[nan, nan], [7, nan]], equal_nan=True)
    assert len(read_measurements(tables[0], ROWS, "displacement", chosen=[1])) == 1


def test_sources_that_are_not_used_are_hidden(tmp_path):
    found = read_measurements(write(tmp_path, "m.csv", CSV), ROWS, "displacement")
    assert not np.isfinite(found.of(["effectors"]).dual).any() and np.isfinite(found.of(["effectors"]).x_e).any()
    assert not np.isfinite(found.of(["actuators"]).x_e).any() and np.isfinite(found.of(["actuators"]).dual).any()


def test_a_dataset_serves_as_measurements(tmp_path):
    store_dataset(tmp_path, train=5, test=3)
    rows = Rows(("tip.x", "tip.y", "tip.z"), ("cable0", "cable1"))
    found = read_measurements(tmp_path, rows, "displacement", chosen=[0, 3])
    assert found.u.shape == (2, 2) and np.isfinite(found.delta_e).all() and np.isfinite(found.dual).all()
    swapped = read_measurements(tmp_path, rows, "force", "test")
    assert len(swapped) == 3 and swapped.kind == "force"
    with pytest.raises(InputError, match="drives cable0 and cable1, the model left and right"):
        read_measurements(tmp_path, ROWS, "displacement")
    with pytest.raises(InputError, match="has no row 9: its 5 rows are 0 to 4"):
        read_measurements(tmp_path, rows, "displacement", chosen=[9])


def test_states_of_many_robots_are_no_measurements_of_one(tmp_path):
    store_dataset(tmp_path, train=5, test=3, parameters=True)
    rows = Rows(("tip.x", "tip.y", "tip.z"), ("cable0", "cable1"))
    with pytest.raises(InputError, match=r"train\.parquet: its states are of robots that differ in poisson"):
        read_measurements(tmp_path, rows, "displacement")
    assert len(read_measurements(tmp_path, rows, "displacement", chosen=[2])) == 1


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("m.csv", "left.displacement,right.displacement [mm]\n1,2\n", "a name and its unit"),
        ("m.csv", "left.displacement [mm],right.displacement [mm]\n1\n", "m.csv:2: 1 cells, and the titles are 2"),
        (
            "m.csv",
            "left.displacement [N],right.displacement [mm]\n1,2\n",
            "'left.displacement': .*not a unit of length",
        ),
        ("m.csv", "left.displacement [mm],right.displacement [mm],tap.x [mm]\n1,2,3\n", "'tap.x': expected one of"),
        ("m.csv", "left.displacement [mm],tip.x [mm]\n1,2\n", "m.csv:2: has no 'right.displacement'"),
        ("m.csv", "left.displacement [mm],right.displacement [mm]\n", "no measurements"),
        (
            "m.csv",
            "left.displacement [mm],right.displacement [mm]\n1,one\n",
            "m.csv:2: column 'right.displacement .mm.': 'one' is not a number",
        ),
        ("m.csv", "left.displacement [mm],right.displacement [mm],tip.x [deg]\n1,2,3\n", "'tip.x': .*unit of length"),
        ("m.csv", "left.displacement [mm],right.displacement [mm^3]\n1,2\n", "'right.displacement': .*unit of length"),
        (
            "m.csv",
            "left.displacement [mm],right.displacement [mm],left.force [kPa]\n1,2,3\n",
            "'left.force': .*not a unit of force",
        ),
        (
            "m.csv",
            "left.displacement [mm],right.displacement [mm],left.displacement [mm]\n1,2,3\n",
            "two columns are called 'left.displacement .mm.'",
        ),
        ("m.csv", "", "is empty"),
        ("m.yaml", "left.displacement: 1 mm\n", "a list of states"),
        ("m.yaml", "- {left.displacement: 1, right.displacement: 2 mm}\n", "state 1: 'left.displacement': .*its unit"),
        ("m.yaml", "- {left.displacement: [1\n", "not valid YAML"),
        ("m.parquet", "nothing", "damaged"),
        ("m.txt", "1 2 3", "not a table that can be read: expected .yaml"),
    ],
)
def test_bad_tables_say_where(tmp_path, name, text, message):
    with pytest.raises(InputError, match=message) as caught:
        read_measurements(write(tmp_path, name, text), ROWS, "displacement")
    assert str(tmp_path) in str(caught.value)


def test_a_missing_table(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        read_measurements(tmp_path / "none.csv", ROWS, "displacement")


def test_a_table_of_a_spreadsheet_begins_with_a_mark(tmp_path):
    (tmp_path / "m.csv").write_bytes(b"\xef\xbb\xbf" + CSV.encode())
    assert read_measurements(tmp_path / "m.csv", ROWS, "displacement").u[0] == pytest.approx([1, 2])


def test_columns_of_chambers_and_rotations_have_their_own_units(tmp_path):
    rows, units = Rows(("tip.x", "tip.rx"), ("air",)), [("mm^3", "MPa")]
    text = "air.displacement [ml],air.force [kPa],tip.x [mm],tip.rx [deg]\n1,20,3,180\n"
    found = read_measurements(write(tmp_path, "m.csv", text), rows, "displacement", actuator_units=units)
    assert found.u == pytest.approx(np.array([[1000.0]])) and found.dual == pytest.approx(np.array([[0.02]]))
    assert found.x_e == pytest.approx(np.array([[3.0, np.pi]]))
    for wrong in (text.replace("[ml]", "[mm]"), text.replace("[kPa]", "[N]"), text.replace("[deg]", "[mm]")):
        with pytest.raises(InputError, match="is not a unit of"):
            read_measurements(write(tmp_path, "m.csv", wrong), rows, "displacement", actuator_units=units)
