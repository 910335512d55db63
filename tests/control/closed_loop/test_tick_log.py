"""Ticks of a device reach the disk as they come, and are not synced more often than a disk bears."""

import json
import os
import re

import pytest

from cfem.control.closed_loop import tick_log as module
from cfem.control.closed_loop.tick_log import SYNC, tick_log
from cfem.core.errors import NumericalError


def test_ticks_are_synced_at_once_and_then_at_most_every_second(tmp_path, monkeypatch):
    now, synced = [100.0], []
    monkeypatch.setattr(module.time, "monotonic", lambda: now[0])
    monkeypatch.setattr(module.os, "fsync", lambda handle: synced.append(os.fstat(handle).st_size))
    (tmp_path / "specs").mkdir()
    kept = re.escape(f"the 50 ticks before are kept in {tmp_path / 'interrupted-1.jsonl'}")
    with pytest.raises(NumericalError, match=kept), tick_log(tmp_path / "specs" / "..") as append:
        for number in range(50):
            append({"t": 0.1 * number})
            now[0] += 0.1 * SYNC
        raise NumericalError("the device is gone", do="")
    lines = (tmp_path / "interrupted-1.jsonl").read_text().splitlines()
    assert len(lines) == 50 and json.loads(lines[-1])["t"] == pytest.approx(4.9)
    assert len(synced) in (5, 6) and synced[0] == len(lines[0]) + 1  # the first tick at once


def test_one_tick_is_told_of_as_one(tmp_path):
    kept = re.escape(f"the tick before is kept in {tmp_path / 'interrupted-1.jsonl'}")
    with pytest.raises(NumericalError, match=kept), tick_log(tmp_path) as append:
        append({"t": 0.0})
        raise NumericalError("the device is gone", do="")


def test_a_run_that_ends_well_leaves_no_log(tmp_path):
    with tick_log(tmp_path) as append:
        append({"t": 0.0})
    assert list(tmp_path.iterdir()) == []
