"""Bodies as strangers bring them follow a curve without an edit (minutes each; `make zoo` keeps their results)."""

import pytest
from zoo.zoo import BODIES, run_body, write_file

from cfem.init.body.shape import FILES, read_source


@pytest.mark.slow
@pytest.mark.parametrize("body", BODIES, ids=[body.name for body in BODIES])
def test_a_body_follows_its_curve(body, tmp_path):
    result = run_body(body, tmp_path)
    assert result["init"]["code"] == 0 and result["run"]["code"] == 0, result
    assert result["reached"] == result["goals"] == 24 and result["page"], result


@pytest.mark.slow
@pytest.mark.parametrize("body", BODIES, ids=[body.name for body in BODIES])
def test_its_file_is_read(body, tmp_path):
    assert read_source(write_file(body, tmp_path)).volume > 0


def test_there_is_a_body_for_every_kind_of_file():
    kinds = {body.file[body.file.rindex(".") :] for body in BODIES}
    assert set(FILES) - kinds <= {".stp", ".brp"} and len(BODIES) >= 20
