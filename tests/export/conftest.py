"""What tests of exports share."""

from unittest.mock import patch

import pytest

from cfem.export.compiled import build

SIZES = build.sizes


@pytest.fixture(scope="module", autouse=True)
def uncounted():
    """Exports leave out the bytes of the code, for which it is compiled twice more, where a test does not ask for
    `counted`."""
    with patch.object(build, "sizes", lambda folder: {"here": None, "cortex-m7": None}):
        yield


@pytest.fixture
def counted(uncounted):
    with patch.object(build, "sizes", SIZES):
        yield
