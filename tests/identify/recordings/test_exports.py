"""Each export gives back the motion that was written."""

import warnings

import numpy as np
import pytest
from identify.recordings.recordings import PLACES, motion, write_c3d, write_optitrack, write_vicon

from cfem.core.errors import InputError
from cfem.identify.recordings.exports import read_recording

LABELS = list(PLACES)


@pytest.mark.parametrize(
    ("write", "name", "precision"),
    [(write_optitrack, "a.csv", 1e-4), (write_vicon, "a.csv", 1e-4), (write_c3d, "a.c3d", 1e-3)],
)
def test_exports_are_read(tmp_path, write, name, precision):
    if name.endswith("c3d"):
        pytest.importorskip("c3d")
    time, points = motion()
    points[50:60, 2] = np.nan
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the writer of .c3d misses analog channels
        write(tmp_path / name, time, points, LABELS)
    found = read_recording(tmp_path / name)
    assert [label.split(":")[-1] for label in found.labels] == LABELS
    np.testing.assert_allclose(found.time, time, atol=1e-6)
    np.testing.assert_allclose(found.points, points, atol=precision)
    assert found.rate == pytest.approx(100)


def test_millimetres_of_motive(tmp_path):
    time, points = motion()
    write_optitrack(tmp_path / "a.csv", time, points, LABELS, "Millimeters")
    np.testing.assert_allclose(read_recording(tmp_path / "a.csv").points, points, atol=1e-4)


@pytest.mark.parametrize(
    ("head", "size"),
    [
        ("t_s,tip_x_mm,tip_y_mm,tip_z_mm", 1),
        ("time [ms],tip_x_mm,tip_y_mm,tip_z_mm", 1),
        ("time,tip.X [m],tip.Y [m],tip.Z [m]", 1000),
        ("T,tip x,tip y,tip z", 10),
    ],
)
def test_plain_tables_are_read(tmp_path, head, size):
    (tmp_path / "a.csv").write_text(f"{head}\n0,1,2,3\n{500 if 'ms' in head else 0.5},4,5,\n")
    found = read_recording(tmp_path / "a.csv", 10.0 if size == 10 else None)
    assert found.labels == ("tip",) and found.rate == 2
    np.testing.assert_allclose(found.points[:, 0], np.array([[1, 2, 3], [4, 5, np.nan]]) * size)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("t,a_x,b_y\n0,1,2\n", "no marker with columns of x, y and z"),
        ("t,a_x_mm,a_y_m,a_z_mm\n0,1,2,3\n1,1,2,3\n", "different units"),
        ("t,a_x,a_y,a_z\n0,1,2,3\n1,1,2,3\n", "states no unit"),
        ("t_ms,a_x_mm,a_y_mm,a_z_mm\n0,1,2,3\n5,1,2,3\n5,1,2,3\n", r"a.csv:4: time does not increase .*sort the rows"),
        ("a,b\n1,2\n", "no export of OptiTrack Motive or Vicon Nexus"),
        ("Format Version,1.23,Length Units,Meters\n\n,Type,Marker\n", "Frame"),
        ("Trajectories\nabc\n", "no header of a Nexus export"),
        ("Trajectories\n100\n,,A,,\nFrame,Sub Frame,X,Y,Z\n,,furlong,,\n1,0,1,2,3\n", "unknown unit 'furlong'"),
        (
            "Trajectories\n100\n,,A,,\nFrame,Sub Frame,X,Y,Z\n,,mm,,\n1,0,1,2,up\n",
            "a.csv:6: column 'A Z': 'up' is not a number",
        ),
        ("Trajectories\n100\n,,A,,\nFrame,Sub Frame,X,Y,Z\n,,mm,,\n", "no frames"),
    ],
)
def test_each_mistake_is_told(tmp_path, text, message):
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(InputError, match=message):
        read_recording(tmp_path / "a.csv")
