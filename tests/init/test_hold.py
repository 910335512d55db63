"""What is held, and the way from there to the free end."""

import numpy as np
import pytest
from init.bodies import box_shape, tapered

from cfem.core.errors import SpecError
from cfem.init.body.shape import Shape
from cfem.init.hold import Hold, Run, guess_hold, read_hold, run_from
from cfem.mechanics.mesh import Mesh
from cfem.robot.selection import select_nodes


def mirrored(shape):
    """Along z: the thick end up."""
    X = shape.mesh.X * [1, 1, -1]
    cells, facets = shape.mesh.cells[:, [0, 2, 1, 3]], shape.mesh.facets[:, [0, 2, 1]]
    return Shape(Mesh(X, cells, facets), shape.size)


def test_the_flat_face_at_the_thicker_end_is_held():
    shape = tapered(60.0)
    hold, why = guess_hold(shape)
    assert str(hold) == "z <= 0 mm" and "thicker" in why
    nodes = select_nodes(shape.mesh, hold.selection(), "fixed")
    np.testing.assert_array_equal(nodes, np.flatnonzero(shape.mesh.X[:, 2] == 0))
    assert run_from(hold, shape) == Run(2, 0.0, 0.0, 60.0)
    other, _ = guess_hold(mirrored(shape))
    assert str(other) == "z >= 0 mm"
    assert run_from(other, mirrored(shape)) == Run(2, 0.0, 0.0, -60.0)


def test_a_level_that_is_0_to_rounding_is_written_as_0():
    assert str(Hold(0, True, -4.4e-16)) == "x <= 0 mm"


def test_of_ends_alike_that_near_the_origin():
    shape = box_shape((60.0, 10.0, 10.0))
    assert str(guess_hold(shape)[0]) == "x <= 0 mm"
    moved = Shape(Mesh(shape.mesh.X - [61, 0, 0], shape.mesh.cells, shape.mesh.facets), 5.0)
    assert str(guess_hold(moved)[0]) == "x >= -1 mm"


def test_an_end_that_is_not_flat_is_held_by_a_slice():
    shape = tapered(60.0, divisions=(4, 4, 20))
    X = shape.mesh.X.copy()
    X[:, 2] += 0.02 * (X[:, 0] ** 2 + X[:, 1] ** 2)  # a hollow base
    hold, why = guess_hold(Shape(Mesh(X, shape.mesh.cells, shape.mesh.facets), 4.0))
    assert "slice" in why and hold.below and 2 < hold.level < 7


def test_a_set_of_the_mesh_called_so_is_held():
    x = box_shape().mesh.X[:, 0]
    shape = box_shape(node_sets={"fixed": np.flatnonzero(x > 59), "other": np.flatnonzero(x < 1)})
    hold, why = guess_hold(shape)
    assert str(hold) == "fixed" and "'fixed'" in why
    assert run_from(hold, shape) == Run(0, 60.0, 60.0, 0.0)
    assert str(read_hold("other", shape)) == "other"


@pytest.mark.parametrize("name", ["CLAMP", "clamped face", "Part-1.Fixed", "wall_held"])
def test_a_set_is_known_by_a_word_of_its_name(name):
    x = box_shape().mesh.X[:, 0]
    sets = {"database": np.flatnonzero(x < 30), "fixed-edge": np.array([0, 1]), name: np.flatnonzero(x > 59)}
    assert str(guess_hold(box_shape(node_sets=sets))[0]) == name


@pytest.mark.parametrize(
    "text, expected, run",
    [
        ("x <= 5 mm", "x <= 5 mm", Run(0, 0.0, 5.0, 60.0)),
        ("x>=5.5cm", "x >= 55 mm", Run(0, 60.0, 55.0, 0.0)),
        ("left", "x <= 0 mm", Run(0, 0.0, 0.0, 60.0)),
        ("top", "z >= 10 mm", Run(2, 10.0, 10.0, 0.0)),
        ("bottom", "z <= 0 mm", Run(2, 0.0, 0.0, 10.0)),
    ],
)
def test_as_a_person_writes_it(text, expected, run):
    text = text.replace("5.5cm", "5.5 cm")
    hold = read_hold(text, box_shape())
    assert str(hold) == expected and run_from(hold, box_shape()) == run


@pytest.mark.parametrize(
    "text, part",
    [
        ("under", "cannot make sense of 'under'.*write 'z <= 5 mm', 'face at 1, 2, 3 mm', or one of left"),
        ("x <= -3 mm", "outside the body.*x goes from 0 to 60 mm"),
        ("x <= 60 mm", "holds all of the body"),
        ("q <= 5 mm", "cannot make sense"),
        ("line", "holds 2 nodes on one line"),
    ],
)
def test_what_cannot_be_held(text, part):
    with pytest.raises(SpecError, match=part):
        read_hold(text, box_shape(node_sets={"line": np.array([0, 1])}))


def test_a_level_needs_its_unit():
    with pytest.raises(ValueError, match="length with its unit"):
        read_hold("x <= 5", box_shape())
