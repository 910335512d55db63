"""A cable that leaves the body between its points is found, with the place."""

import numpy as np
import pytest
from robot.scenes import scene
from support.blocks import block

from cfem.core.errors import SpecError
from cfem.core.stage import Options
from cfem.mechanics.mesh import Mesh, boundary_facets
from cfem.robot.checks.cable_passage import demand_inside, gaps
from cfem.robot.mesh.mesh_file import write_mesh
from cfem.robot.stage import run

QUIET = Options(quiet=True)


@pytest.fixture(scope="module")
def corner():
    """An L of 30 x 30 x 10 mm: what has x > 10 and y > 10 is cut away."""
    whole = block((30, 30, 10), (6, 6, 2))
    kept = whole.cells[~(whole.X[whole.cells].mean(axis=1)[:, :2] > 10).all(axis=1)]
    used, cells = np.unique(kept, return_inverse=True)
    cells = cells.reshape(-1, whole.cells.shape[1])
    return Mesh(whole.X[used], cells, boundary_facets(cells))


ACROSS = np.array([[2.0, 28, 5], [28, 2, 5]])
ALONG = np.array([[5.0, 28, 5], [5, 5, 5], [28, 5, 5]])


def test_across_the_inner_corner_through_the_air(corner):
    (gap,) = gaps(corner, ACROSS, 1.0)
    # on x + y = 30 the air is between x = 10 and x = 20: 0.5 mm on either side is allowed, and the middle is 5 mm away
    assert gap.segment == 0 and gap.length == pytest.approx(9 * 2**0.5, rel=0.1)
    assert gap.distance == pytest.approx(5.0, rel=0.2) and gap.where == pytest.approx([15, 15, 5], abs=1.0)


def test_along_both_legs_inside(corner):
    assert gaps(corner, ALONG, 1.0) == []


def test_on_the_surface_is_inside(corner):
    assert gaps(corner, np.array([[0.0, 0, 0], [30, 0, 0]]), 0.0) == []


def cables(points, more=""):
    listed = ", ".join(f"[{', '.join(str(value) for value in point)}]" for point in points)
    return f"[{{kind: cable, name: c, points: {{mm: [{listed}]}}, reach: {{mm: [0, 3]}}{more}}}]"


def test_the_mesh_command_says_where_and_allows_what_is_meant(corner, tmp_path):
    write_mesh(tmp_path / "corner.vtu", corner)
    own = {
        "geometry": "{kind: mesh-file, path: corner.vtu}",
        "fixed": "[{kind: plane, point: {mm: [0, 30, 0]}, normal: [0, 1, 0]}]",
        "effectors": "[{name: tip, point: {mm: [30, 5, 5]}}]",
    }
    refused = scene(tmp_path, actuators=cables(ACROSS), **own)
    said = r"scene\.yaml:8: actuators\.0\.points\.0: cable 'c' leaves the body between points 0 and 1: for 1\d.* mm"
    with pytest.raises(SpecError, match=said) as error:
        demand_inside(refused, corner)
    assert "at (14.8, 15.2, 5) mm" in str(error.value) and "through_air: true" in str(error.value)
    with pytest.raises(SpecError, match="leaves the body"):
        run(tmp_path / "scene.yaml", [], None, QUIET)
    demand_inside(scene(tmp_path, actuators=cables(ACROSS, ", through_air: true"), **own), corner)
    demand_inside(scene(tmp_path, actuators=cables(ALONG), **own), corner)
