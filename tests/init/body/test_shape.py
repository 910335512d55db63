"""Files as bodies: sizes in mm whatever their unit, and one clear error for what is no body."""

import re
from pathlib import Path

import numpy as np
import pytest
from init.bodies import write_cells, write_stl

from cfem.core.errors import InputError
from cfem.init.body.shape import geometry, make_shape, read_source
from cfem.robot.mesh.meshing import corner_mesh
from cfem.robot.spec import Meshing


def test_a_closed_surface_becomes_a_coarse_mesh(tmp_path):
    write_stl(tmp_path / "box.stl", (0.06, 0.01, 0.01))
    source = read_source(tmp_path / "box.stl")
    assert source.volume == pytest.approx(6e-6) and source.area == pytest.approx(2.6e-3)
    assert not source.has_unit
    shape = make_shape(source, 1000.0, 1000)
    assert shape.extent == pytest.approx([60, 10, 10]) and shape.mesh.volumes.sum() == pytest.approx(6000)
    assert 50 < len(shape.mesh.cells) < 1000


def test_a_round_body_gets_a_size_at_which_straight_edges_keep_its_volume(tmp_path):
    arm = read_source(Path(__file__).parents[3] / "docs" / "tutorial" / "s-arm.step")
    shape = make_shape(arm, 1.0, 5000)
    meshing = Meshing(size=f"{shape.size!r} mm", element="tet4")
    finer, volume = corner_mesh(geometry(arm.path, 1.0), meshing, [], Path(), "geometry")
    assert shape.mesh.volumes.sum() < 0.97 * volume < 0.975 * volume < finer.volumes.sum()
    assert len(finer.cells) == pytest.approx(5000, rel=0.2)


@pytest.mark.parametrize("element", ["tet4", "hex8"])
def test_a_mesh_is_taken_as_it_is(tmp_path, element):
    write_cells(tmp_path / "own.vtu", element)
    source = read_source(tmp_path / "own.vtu")
    assert (source.volume, source.area) == pytest.approx((6000, 2600))
    shape = make_shape(source, 10.0, 0)
    assert shape.extent == pytest.approx([600, 100, 100]) and list(shape.mesh.node_sets) == ["wall"]


@pytest.mark.parametrize(
    "name, content, part",
    [
        ("none.step", None, "no such file"),
        ("a.xyz", b"v 0 0 0", "'.xyz' cannot be read as a shape.*one of .step"),
        ("a.step", b"not a STEP file", "a.step"),
        ("a.stl", b"solid a\nendsolid a\n", "has no triangles"),
        ("a.vtu", b"<VTKFile", "a.vtu: is not in a mesh format that can be read"),
    ],
)
def test_what_is_no_body(tmp_path, name, content, part):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=part):
        read_source(tmp_path / name)


def test_an_open_surface_is_refused(tmp_path):
    write_stl(tmp_path / "open.stl", facets=slice(None, None, 2))
    with pytest.raises(InputError, match=r"open\.stl.*not closed"):
        read_source(tmp_path / "open.stl")


def test_of_two_bodies_in_one_surface_one_is_taken_and_said(tmp_path):
    write_stl(tmp_path / "one.stl")
    one = (tmp_path / "one.stl").read_text()
    number = r"vertex (\S+) (\S+) (\S+)"
    away = re.sub(
        number, lambda found: "vertex " + " ".join(str(2 * float(each) + 300) for each in found.groups()), one
    )
    (tmp_path / "two.stl").write_text(one + away)
    alone = read_source(tmp_path / "one.stl").volume
    for body, times in ((1, 8), (2, 1)):
        source = read_source(tmp_path / "two.stl", body=body)
        assert source.volume == pytest.approx(times * alone)
        assert f"took body {body} of 2" in source.mended[0]
        mesh = make_shape(source, 1.0, 1000).mesh
        assert np.abs(mesh.volumes).sum() == pytest.approx(times * alone, rel=0.05)
        assert (mesh.X.min() >= 300) == (body == 1)
