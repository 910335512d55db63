"""Text about the estimates of a recording, for a person."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from cfem.core.artefact.judgement import NOISE_RATIO, poor
from cfem.identify.states.results import WANTED
from cfem.predict.estimation.answer import Estimate
from cfem.predict.estimation.estimate import Estimator
from cfem.predict.estimation.push_bound import MOST

_LOST = 0.5  # share of frames without an estimate, or in which a marker fits nowhere


def headline(
    results: Mapping[str, Any], estimates: Sequence[Estimate], estimator: Estimator, at_rest: bool
) -> list[str]:
    """Frames, innovations, forces in the last frame, what was left out, and how well a push is known.

    results: `estimate_results`
    at_rest: whether the robot was taken to be at rest in each frame"""
    frames, estimated = results["frames"], results["estimated"]
    miss = f"; the markers miss the model by {results['noise_ratio']:.2f} of their noise" if estimated else ""
    lines = [f"{frames} frames, {estimated} estimated{miss}"]
    if results["innovation"] is not None:
        lines.append(
            f"innovations have {results['innovation']:.2f} of the variance that the filter states (1 is right)"
        )
    lines += _loads(results, estimates, estimator)
    if estimated < frames:
        hint = "; of a robot that moves from frame to frame, state `dynamics`" if at_rest else ""
        lines.append(f"{frames - estimated} frames have no estimate: {_reason(estimates)}{hint}")
    if results["outliers"]:
        outliers = Counter(results["outliers"]).most_common()
        lines.append("left out: " + ", ".join(f"{name} in {count} frames" for name, count in outliers))
    if "push" in results:
        lines.append(_push(results["push"], estimated))
    return lines


def _loads(results: Mapping[str, Any], estimates: Sequence[Estimate], estimator: Estimator) -> list[str]:
    """Lines on the forces in the last frame that has an estimate, none where no frame has one."""
    known = [number for number, estimate in enumerate(estimates) if estimate.converged]
    if not known:
        return []
    frames, last, n_a = len(estimates), estimates[known[-1]], estimator.model.rows.n_a
    when = (
        "in the last frame" if known[-1] == frames - 1 else f"in frame {known[-1] + 1}, the last that has an estimate"
    )
    return [
        f"{name}: {1e3 * load:.3g} mN {when}, standard deviation {1e3 * deviation:.2g} mN; "
        f"observed in {frames - results['unseen'].get(name, 0)} of {frames} frames"
        for name, load, deviation in zip(estimator.loaded, last.loads, last.deviation[n_a:], strict=False)
    ]


def truth_line(covered: Sequence[np.ndarray]) -> str:
    """The line on how often intervals hold the truth; covered: (f',) of each unknown."""
    share = 100 * float(np.concatenate(covered).mean())
    return f"against the truth: 95 % intervals hold in {share:.1f} % of {sum(map(len, covered))} numbers"


def judgement(results: Mapping[str, Any], estimates: Sequence[Estimate], markers: int) -> list[dict[str, Any]]:
    """Poor where most frames have no estimate, the noise is another than stated, or markers fit nowhere; markers: their
    number."""
    frames, estimated, ratio = results["frames"], results["estimated"], results["noise_ratio"]
    judged = []
    if estimated < (1 - _LOST) * frames:
        judged.append(f"{frames - estimated} of {frames} frames have no estimate: {_reason(estimates)}")
    if ratio is not None and ratio > NOISE_RATIO:
        judged.append(
            f"the markers miss the model by {ratio:.1f} times their noise: look at their places, the frame, the noise"
        )
    lost = {name: count for name, count in results["outliers"].items() if count > _LOST * frames}
    if len(lost) > _LOST * markers:
        judged.append(f"{len(lost)} of {markers} markers were left out of most frames: look at the noise and the frame")
    else:
        for name, count in lost.items():
            judged.append(f"marker {name} was left out of {count} of {frames} frames: look at its place")
    return [poor(sentence) for sentence in judged]


def _push(push: Mapping[str, Any], frames: int) -> str:
    """The line on how well a push can be estimated from so many frames."""
    error, enough = push["least_error"], push["frames_for_10_percent"]
    line = f"{frames} frames tell such a push to {100 * error:.2g} % of its size on average, at best"
    if error > WANTED:
        more = f"takes {enough} frames" if enough else f"is not reached with {MOST} frames"
        line += f"; {100 * WANTED:.0f} % {more}: load cells, a known direction or more markers help"
    return line


def _reason(estimates: Sequence[Estimate]) -> str:
    """The most common reason why a frame has no estimate."""
    return Counter(estimate.status.value for estimate in estimates if not estimate.converged).most_common(1)[0][0]
