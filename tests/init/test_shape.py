"""Files as bodies: sizes in mm whatever their unit, and one clear error for what is no body."""

import pytest
from init.bodies import write_cells, write_stl

from cfem.core.errors import InputError
from cfem.init.shape import make_shape, natural_unit, read_source


def test_a_closed_surface_becomes_a_coarse_mesh(tmp_path):
    write_stl(tmp_path / "box.stl", (0.06, 0.01, 0.01))
    source = read_source(tmp_path / "box.stl")
    assert source.volume == pytest.approx(6e-6) and source.area == pytest.approx(2.6e-3)
    assert natural_unit(source) == "m" and not source.has_unit
    shape = make_shape(source, 1000.0, 1000)
    assert shape.extent == pytest.approx([60, 10, 10]) and shape.volume == pytest.approx(6000)
    assert 50 < len(shape.mesh.cells) < 1000


@pytest.mark.parametrize("element", ["tet4", "hex8"])
def test_a_mesh_is_taken_as_it_is(tmp_path, element):
    write_cells(tmp_path / "own.vtu", element)
    source = read_source(tmp_path / "own.vtu")
    assert (source.volume, source.area) == pytest.approx((6000, 2600)) and natural_unit(source) == "mm"
    shape = make_shape(source, 10.0, 0)
    assert shape.extent == pytest.approx([600, 100, 100]) and list(shape.mesh.node_sets) == ["wall"]


@pytest.mark.parametrize(
    "name, content, part",
    [
        ("none.step", None, "no such file"),
        ("a.obj", b"v 0 0 0", "'.obj' cannot be read as a shape.*one of .step"),
        ("a.step", b"not a STEP file", "a.step"),
        ("a.stl", b"solid a\nendsolid a\n", "not closed"),
        ("a.vtu", b"<VTKFile", "a.vtu: is not in a mesh format that can be read"),
    ],
)
def test_what_is_no_body(tmp_path, name, content, part):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=part):
        read_source(tmp_path / name)


def test_an_open_surface_is_refused(tmp_path):
    write_stl(tmp_path / "open.stl", facets=slice(2, None))
    with pytest.raises(InputError, match=r"open\.stl.*not closed"):
        read_source(tmp_path / "open.stl")
