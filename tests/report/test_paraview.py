"""Series of shapes for ParaView, read back by meshio, which did not write them."""

import xml.etree.ElementTree as ET

import meshio
import numpy as np
import pytest

from cfem.report.paraview import vtu, write_series
from cfem.report.shape_history import ShapeHistory

REST = np.array([[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0], [1, 0, 0], [2, 1, 0], [1, 1, 0]], float)
FACETS = {"triangle": [[0, 1, 2], [0, 2, 3]], "quad": [[0, 1, 2, 3]], "triangle6": [[0, 1, 2, 4, 5, 6]]}


def history(facets, times=(0.0, 1.0, 4.0)):
    x = REST + np.arange(len(times))[:, None, None] * np.array([0, 0, 0.25])
    facts = {"lambda_a left [N]": np.arange(len(times)) + 0.5, "goal [mm]": np.arange(3.0 * len(times)).reshape(-1, 3)}
    index = np.arange(len(times))
    none = np.zeros((len(times), 3))
    return ShapeHistory(
        "way", "fe", REST, np.array(facets), x, index, np.array(times), False, facts, none, none, np.zeros(len(times))
    )


@pytest.mark.parametrize("kind", FACETS)
def test_a_surface_is_read_back_with_its_fields(tmp_path, kind):
    given = history(FACETS[kind])
    write_series(tmp_path, "way-fe", given)
    found = meshio.read(tmp_path / "way-fe" / "0002.vtu")
    assert found.cells[0].type == kind and (found.cells[0].data == FACETS[kind]).all()
    np.testing.assert_array_equal(found.points, given.x[2])  # quarters are exact in single precision
    np.testing.assert_array_equal(found.point_data["displacement"], given.x[2] - REST)
    assert found.field_data["lambda_a left [N]"].ravel() == [2.5] and found.field_data["TimeValue"].ravel() == [4.0]
    np.testing.assert_array_equal(found.field_data["goal [mm]"].ravel(), [6, 7, 8])


def test_a_series_names_its_files_relative_to_itself_in_the_order_of_time(tmp_path):
    assert write_series(tmp_path, "way-fe", history(FACETS["quad"])) == "way-fe.pvd"
    root = ET.parse(tmp_path / "way-fe.pvd").getroot()
    sets = root.findall("Collection/DataSet")
    assert root.get("type") == "Collection"
    assert [float(one.get("timestep")) for one in sets] == [0.0, 1.0, 4.0]
    assert [one.get("file") for one in sets] == [f"way-fe/{i:04d}.vtu" for i in range(3)]
    assert sorted(path.name for path in (tmp_path / "way-fe").iterdir()) == ["0000.vtu", "0001.vtu", "0002.vtu"]


def test_names_that_xml_would_misread_stay_whole():
    facts = {"lambda_a <a & b> [N]": 1.0}
    root = ET.fromstring(vtu(REST, 0 * REST, np.array(FACETS["quad"]), facts))
    assert root.find("UnstructuredGrid/FieldData/DataArray").get("Name") == "lambda_a <a & b> [N]"
