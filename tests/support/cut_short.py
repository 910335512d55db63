"""Runs of `cfem control` that are cut short."""

import numpy as np
import pytest
from pyarrow.parquet import read_table

import cfem
from cfem.control.open_loop import resume

TIMES = {"seconds", "step_us"}


def cut_short(spec, after, **how):
    """Interrupts `cfem control` when so many goals are finished; all of them are on the disk."""
    finished, count = resume.KeptRun.finished, []

    def interrupted(self, name, judge):
        finished(self, name, judge)
        count.append(name)
        if len(count) == after:
            raise KeyboardInterrupt

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(resume, "EVERY", 0.0)
        patch.setattr(resume, "DEARER", 0.0)
        patch.setattr(resume.KeptRun, "finished", interrupted)
        with pytest.raises(KeyboardInterrupt):
            cfem.run_stage("control", spec, **how)


def demand_equal(one, other):
    """Of two output folders all but the times, to the last bit."""
    tables = [read_table(folder / "trajectories.parquet").to_pylist() for folder in (one, other)]
    for row, again in zip(*tables, strict=True):
        np.testing.assert_equal(
            {key: row[key] for key in row.keys() - TIMES}, {key: again[key] for key in row.keys() - TIMES}
        )
    with np.load(one / "states.npz") as shapes, np.load(other / "states.npz") as again:
        np.testing.assert_equal(dict(shapes), dict(again))
