"""What became of a run over time: the error in each tenth of it, and which bounds held the commands."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from cfem.control.closed_loop.run import Moment
from cfem.control.closed_loop.tick import Pilot

_PARTS = 10


def over_time(runs: Sequence[Sequence[Moment]], rate: float) -> list[dict[str, float | None]]:
    """Of each tenth of the longest run: until (s), and mean and max of the error (mm) of all runs; None where the plant
    gave no position."""
    count = max(map(len, runs))
    ends = np.unique(np.linspace(0, count, _PARTS + 1).round().astype(int))
    found = []
    for first, end in pairwise(ends):
        errors = np.array([one.error for run in runs for one in run[first:end]])
        known = errors[np.isfinite(errors)]
        mean, largest = (float(known.mean()), float(known.max())) if len(known) else (None, None)
        found.append({"until": float(end / rate), "mean": mean, "max": largest})
    return found


def saturation(runs: Sequence[Sequence[Moment]], pilot: Pilot, actuators: Sequence[str]) -> dict[str, float]:
    """The share of ticks that each bound of the commands held, by what it is, and of those with a plan that nobody
    should trust; what never was is left out."""
    low, high = (pilot.limits.lambda_a if pilot.command == "force" else pilot.limits.delta_a).T
    shares: dict[str, float] = {}
    u = np.array([one.belief.u for run in runs for one in run])
    near = 1e-9 * np.maximum(np.abs(u).max(axis=0), 1e-12)
    step = np.concatenate([np.diff([one.belief.u for one in run], axis=0, prepend=np.nan) for run in runs])
    with np.errstate(invalid="ignore"):
        held = {
            "smallest": u <= low + near,
            "largest": u >= high - near,
            "rate": np.abs(step) >= pilot.rate - near,
        }
    for what, where in held.items():
        for name, share in zip(actuators, where.mean(axis=0), strict=True):
            if share > 0:
                shares[f"{name}: {what}"] = float(share)
    said = {"softened": "bounds on the robot missed", "astray": "the robot does not move as the model says"}
    said |= {"rejected": "samples rejected", "restarted": "the observer began again"}
    for name, what in said.items():
        share = np.mean([getattr(one.belief, name, False) for run in runs for one in run])
        if share > 0:
            shares[what] = float(share)
    return shares
