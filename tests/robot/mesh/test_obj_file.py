"""Wavefront files as drawing programs write them."""

import numpy as np
import pytest

from cfem.core.errors import InputError
from cfem.robot.mesh.obj_file import read_obj
from cfem.robot.mesh.surface_file import read_surface

CORNERS = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]
QUADS = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]


def cube(tmp_path, corner, more=()):
    """Its file, each corner of a face written by `corner` of its number from 1."""
    vertices = [f"v {x} {y} {z}" for x, y, z in CORNERS]
    faces = ["f " + " ".join(corner(each + 1) for each in quad) for quad in QUADS]
    path = tmp_path / "cube.obj"
    path.write_text("\n".join(["# made by a program", "o Cube", *vertices, *more, "s off", *faces, ""]))
    return path


@pytest.mark.parametrize(
    "corner, more",
    [
        (lambda n: f"{n}//1", ["vn 0 0 1"]),
        (lambda n: f"{n}/{n + 1}/1", ["vn 0 0 1", *(["vt 0.5 0.5"] * 9)]),
        (lambda n: f"{n - 9}", []),
        (lambda n: f"{n}/3", ["vt 0 0", "vt 0 1", "vt 1 1", "usemtl red"]),
    ],
    ids=["one normal for all", "more texture points than vertices", "counted from the end", "textures"],
)
def test_faces_are_read_whatever_they_carry(tmp_path, corner, more):
    X, triangles, said = read_surface(cube(tmp_path, corner, more))
    assert len(X) == 8 and len(triangles) == 12 and said == ()
    assert np.linalg.det(X[triangles]).sum() / 6 == pytest.approx(1)


@pytest.mark.parametrize(
    "text, part",
    [
        ("v 0 0 0\n", "has no faces"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 x\n", "line 4 is damaged"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 0\n", "there is no vertex 0"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", "names a vertex that it does not have"),
        ("v 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "not three finite numbers"),
    ],
)
def test_a_damaged_file_is_one_sentence(tmp_path, text, part):
    path = tmp_path / "body.obj"
    path.write_text(text)
    with pytest.raises(InputError, match=part):
        read_obj(path)
