"""STL files, written here and by meshio."""

import meshio
import numpy as np
import pytest
from support.closed import box_arrays

from cfem.core.errors import InputError
from cfem.core.stl import read_stl


@pytest.mark.parametrize("binary", [True, False])
def test_vertices_are_joined_and_scaled(tmp_path, binary):
    vertices, triangles = box_arrays([0, 0, 0], [1, 2, 3])
    meshio.write(tmp_path / "box.stl", meshio.Mesh(vertices, [("triangle", triangles)]), binary=binary)
    read, numbered = read_stl(tmp_path / "box.stl", unit=10.0)
    assert read.shape == (8, 3) and numbered.shape == (12, 3)
    np.testing.assert_allclose(read[numbered], 10 * vertices[triangles], atol=1e-6)


def test_what_is_no_stl_is_refused_by_one_sentence(tmp_path):
    path = tmp_path / "body.stl"
    vertices, triangles = box_arrays([0, 0, 0], [1, 1, 1])
    mesh = meshio.Mesh(vertices, [("triangle", triangles)])
    meshio.write(path, mesh, binary=True)
    whole = path.read_bytes()
    meshio.write(path, mesh, binary=False)
    text = path.read_bytes()
    cases = {
        "is cut": [whole[:-20], text[: len(text) // 2], b"", b"solid nothing at all", b"\x00" * 90],
        "has no triangles": [whole[:80] + b"\x00" * 4, b"solid empty\nendsolid empty\n"],
        "no number": [text.replace(b"vertex 1", b"vertex one", 1)],
        "not finite": [text.replace(b"vertex 1", b"vertex nan #", 1).replace(b"nan #", b"nan ", 1)],
    }
    for words, files in cases.items():
        for data in files:
            path.write_bytes(data)
            with pytest.raises(InputError, match=words):
                read_stl(path)
    with pytest.raises(InputError, match="cannot be read"):
        read_stl(tmp_path / "none.stl")
