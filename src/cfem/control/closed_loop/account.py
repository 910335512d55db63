"""Account of a run over time: the error in each tenth of it, and which bounds held the commands."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from cfem.control.closed_loop.run import Moment
from cfem.control.closed_loop.tick import Pilot

_PARTS = 10


def over_time(runs: Sequence[Sequence[Moment]], rate: float) -> list[dict[str, float | None]]:
    """Errors over time, for each tenth of the longest run: until (s), and mean and max of the error (mm) of all
    runs."""
    count = max(map(len, runs))
    ends = np.unique(np.linspace(0, count, _PARTS + 1).round().astype(int))
    tenths = []
    for first, end in pairwise(ends):
        errors = np.array([moment.error for run in runs for moment in run[first:end]])
        known = errors[np.isfinite(errors)]
        mean, largest = (float(known.mean()), float(known.max())) if len(known) else (None, None)
        tenths.append({"until": float(end / rate), "mean": mean, "max": largest})
    return tenths


def saturation(runs: Sequence[Sequence[Moment]], pilot: Pilot, actuators: Sequence[str]) -> dict[str, float]:
    """Share of ticks that each bound of the commands held, by what it is, and of those with a plan that nobody should
    trust; what never was is left out."""
    low, high = (pilot.limits.lambda_a if pilot.command == "force" else pilot.limits.delta_a).T
    shares: dict[str, float] = {}
    u = np.array([moment.belief.u for run in runs for moment in run])
    near = 1e-9 * np.maximum(np.abs(u).max(axis=0), 1e-12)
    step = np.concatenate([np.diff([moment.belief.u for moment in run], axis=0, prepend=np.nan) for run in runs])
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
    labels = {"softened": "bounds on the robot missed", "astray": "the robot does not move as the model says"}
    labels |= {"rejected": "samples rejected", "restarted": "the observer began again"}
    for name, what in labels.items():
        share = np.mean([getattr(moment.belief, name, False) for run in runs for moment in run])
        if share > 0:
            shares[what] = float(share)
    return shares
