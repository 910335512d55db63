"""Whichever operation of the disk fails while a dataset is made, the command says so and the next run ends it."""

import pytest
from core.test_files import CODES, Disk, quick
from faults.sampling import make

from cfem.core.errors import DiskError
from cfem.core.verify import judge

__all__ = ["quick"]


@pytest.mark.parametrize("every", [23, pytest.param(1, marks=pytest.mark.slow)])
def test_the_nth_operation_fails(quick, every):
    whole = make(quick / "whole")["content"]
    with pytest.MonkeyPatch.context() as patch:
        counter = Disk(patch)
        make(quick / "counted")
    assert counter.count > 100
    failed = 0
    for n in range(1, counter.count + 1, every):
        out = quick / f"{n}" / "out"
        with pytest.MonkeyPatch.context() as patch:
            Disk(patch, n, dead=n % 2 == 0, code=CODES[n % len(CODES)])
            try:
                make(out)
            except DiskError as error:
                failed += 1
                assert "cannot write" in str(error)
        assert not out.exists() or judge(out).damage == (), n
        assert make(out)["content"] == whole, n
        assert judge(out).damage == ()
    assert failed > 0.8 * counter.count / every
