"""What the estimates of a recording say, in words and numbers."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from cfem.core.judgement import KEY, NOISE_RATIO, poor
from cfem.predict.estimate import Estimator
from cfem.predict.estimate_answer import Estimate, innovation_ratio
from cfem.predict.push_bound import MOST, Seen, frames_for, push_error

WANTED = 0.1  # of a push: the error that is asked for
LOST = 0.5  # share of frames without an estimate, or of a marker that fits nowhere
COVERED = 1.959964  # standard deviations of a 95 % interval


def summarise(
    found: Sequence[Estimate],
    estimator: Estimator,
    markers: Sequence[str],
    truth: Mapping[str, np.ndarray],
    seen: Seen | None,
    still: bool = True,
) -> dict[str, Any]:
    """Results with headline and judgement; truth (f,) by unknown, where it is known; seen: what bounds how well a push
    can be told, where that is asked; still: whether the robot was taken to be at rest in each frame."""
    good = [one for one in found if one.converged]
    ratio = float(np.sqrt(np.mean([one.noise**2 for one in good]))) if good else np.nan
    outliers = Counter(markers[number] for one in found for number in one.outliers)
    unseen = Counter(name for one in found for name in one.unseen)
    miss = f"; the markers miss the model by {ratio:.2f} of their noise" if good else ""
    headline = [f"{len(found)} frames, {len(good)} estimated{miss}"]
    innovation = innovation_ratio([one.innovation for one in good])
    if innovation is not None:
        headline.append(f"innovations have {innovation:.2f} of the variance that the filter states (1 is right)")
    last = found[-1]
    for place, name in enumerate(estimator.loaded, estimator.model.rows.n_a):
        value, sd = 1e3 * last.loads[place - estimator.model.rows.n_a], 1e3 * last.deviation[place]
        often = f"observed in {len(found) - unseen[name]} of {len(found)} frames"
        headline.append(f"{name}: {value:.3g} mN in the last frame, standard deviation {sd:.2g} mN; {often}")
    if len(good) < len(found):
        hint = "; of a robot that moves from frame to frame, state `dynamics`" if still else ""
        headline.append(f"{len(found) - len(good)} frames have no estimate: {_reason(found)}{hint}")
    if outliers:
        headline.append("left out: " + ", ".join(f"{name} in {count} frames" for name, count in outliers.most_common()))
    judged = []
    if len(good) < (1 - LOST) * len(found):
        judged.append(poor(f"{len(found) - len(good)} of {len(found)} frames have no estimate: {_reason(found)}"))
    if good and ratio > NOISE_RATIO:
        what = (
            f"the markers miss the model by {ratio:.1f} times their noise: look at their places, the frame, the noise"
        )
        judged.append(poor(what))
    often = [name for name, count in outliers.items() if count > LOST * len(found)]
    if len(often) > LOST * len(markers):
        what = f"{len(often)} of {len(markers)} markers were left out of most frames: look at the noise and the frame"
        judged.append(poor(what))
    else:
        for name in often:
            what = f"marker {name} was left out of {outliers[name]} of {len(found)} frames: look at its place"
            judged.append(poor(what))
    results = {
        "frames": len(found),
        "estimated": len(good),
        "noise_ratio": ratio if good else None,
        "innovation": innovation,
        "outliers": dict(outliers),
        "unseen": dict(unseen),
    }
    if seen is not None and good:
        results["push"], line = _push(good, estimator, seen)
        headline.append(line)
    if truth:
        results["truth"], line = _against(found, estimator, truth)
        headline.append(line)
    return {"headline": headline, **results, **({KEY: judged} if judged else {})}


def _push(good: Sequence[Estimate], estimator: Estimator, seen: Seen) -> tuple[dict[str, Any], str]:
    """What an estimate of a push can promise, at the middle of where the robot stood."""
    delta_a = np.median([one.delta_a for one in good], axis=0)
    error = push_error(estimator, delta_a, seen, len(good))
    enough = frames_for(estimator, delta_a, seen, WANTED)
    line = f"{len(good)} frames tell such a push to {100 * error:.2g} % of its size on average, at best"
    if error > WANTED:
        more = f"takes {enough} frames" if enough else f"is not reached with {MOST} frames"
        line += f"; {100 * WANTED:.0f} % {more}: load cells, a known direction or more markers help"
    return {"least_error": error, "frames_for_10_percent": enough}, line


def _against(
    found: Sequence[Estimate], estimator: Estimator, truth: Mapping[str, np.ndarray]
) -> tuple[dict[str, Any], str]:
    names = list(estimator.unknowns)
    values = np.array([np.concatenate([one.delta_a, one.loads]) for one in found])
    deviation, every, inside = np.array([one.deviation for one in found]), {}, []
    for name, true in truth.items():
        place = names.index(name)
        off = values[:, place] - true
        known = np.isfinite(off)
        held = np.abs(off[known]) < COVERED * deviation[known, place]
        inside.append(held)
        every[name] = {"rms": float(np.sqrt(np.mean(off[known] ** 2))), "covered": float(held.mean())}
    share = 100 * float(np.concatenate(inside).mean())
    return every, f"against the truth: 95 % intervals hold in {share:.1f} % of {sum(map(len, inside))} numbers"


def _reason(found: Sequence[Estimate]) -> str:
    return Counter(one.status.value for one in found if not one.converged).most_common(1)[0][0]
