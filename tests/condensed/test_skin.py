"""A skin as a value: rows from displacements and back, files, and what is wrong with damaged ones."""

from dataclasses import replace

import numpy as np
import pytest
from support.skins import square

from cfem.condensed.skin import checked_skin, read_skin, skin_bytes, skin_from
from cfem.core.errors import InputError


def test_rows_of_a_combination_of_modes_are_its_coefficients_and_nothing_is_left():
    skin, s = square(), np.array([[1.0, -2.0], [0.5, 3.0]])
    moved = skin.displacements(s)
    assert moved.shape == (2, 4, 3)
    np.testing.assert_allclose(skin.rows(moved), s, atol=1e-14)
    assert max(skin.left(moved[0])) < 1e-14


def test_what_is_left_is_the_distance_that_no_mode_makes():
    skin = square()
    moved = skin.displacements(np.array([1.0, 2.0]))
    moved[2, 1] += 0.4  # along y, as no mode moves
    rms, largest = skin.left(moved)
    assert largest == pytest.approx(0.4) and rms == pytest.approx(0.4 * np.sqrt(skin.weights[2]))


def test_a_file_is_the_skin_and_a_damaged_one_says_what_is_wrong(tmp_path):
    skin, path = square(), tmp_path / "skin.npz"
    path.write_bytes(skin_bytes(skin))
    for found in (read_skin(path), skin_from(path.read_bytes())):
        assert found.names == ("skin.1", "skin.2")
        np.testing.assert_array_equal(found.modes, skin.modes)
    with pytest.raises(InputError, match=r"skin.npz: is damaged: array 'triangles' names nodes that are not among"):
        path.write_bytes(skin_bytes(replace(skin, triangles=skin.triangles + 3)))
        read_skin(path)
    with pytest.raises(InputError, match="array 'modes' is missing"):
        checked_skin({name: getattr(skin, name) for name in ("nodes", "rest", "triangles", "weights")})
    with pytest.raises(ValueError, match="pickle"):
        skin_from(b"no archive")
