"""A file that is asked for and is not there."""

import pytest

from cfem.core.errors import InputError
from cfem.core.reading import demand_file


@pytest.mark.parametrize(("name", "what"), [("missing.stl", "no such file"), ("folder.stl", "is a folder, not a file")])
def test_what_is_no_file_is_refused_with_what_would_help(tmp_path, name, what):
    (tmp_path / "folder.stl").mkdir()
    with pytest.raises(InputError) as raised:
        demand_file(tmp_path / name, "check geometry.path")
    assert (raised.value.what, raised.value.where) == (what, str(tmp_path / name))
    assert raised.value.do == "check geometry.path"


def test_a_file_is_accepted(tmp_path):
    (tmp_path / "bar.stl").touch()
    assert demand_file(tmp_path / "bar.stl") is None
