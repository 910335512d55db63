"""Families from files."""

import pytest

from cfem.core.errors import InputError
from cfem.parametric.load import learned


def test_a_model_of_one_robot_is_named(bar):
    folder = bar / "models" / "bar" / "spectral"
    with pytest.raises(InputError, match="one robot only") as raised:
        learned(folder)
    assert raised.value.where == str(folder)
