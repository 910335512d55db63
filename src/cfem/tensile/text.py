"""What a person reads of a fit."""

from typing import Any

import numpy as np

from cfem.core.judgement import KEY, sentences
from cfem.core.shown import folded, stress


def fit_text(found: dict[str, Any]) -> str:
    """Lines of at most the terminal's width."""
    lines = [
        f"{one['file']}: {one['points']} points of {one['mode']} {one['sense']}, to {stress(one['largest stress MPa'])}"
        for one in found["curves"]
    ]
    low, high = found["stretch"]
    lines += [f"stretch {low:.3g} to {high:.3g}", "", *_table(found["tried"]), ""]
    young, half = found["young MPa"]
    lines += [f"{found['law']}: Young's modulus at rest {stress(young)}{_half(half)}"]
    if found["slack"] is not None:
        lines += [f"slack: the specimen begins to carry load at a strain of {found['slack'][0]:.3f}"]
    lines += [part for line in _limits(found) for part in folded(line)]
    return "\n".join([*sentences({KEY: found[KEY]}), *lines, "", found["scene"]])


def _table(rows: list[dict[str, Any]]) -> list[str]:
    lines = [f"  {'law':<14} {'constants':>9} {'fitted':>10} {'unseen':>10} {'AICc':>8}  E at rest"]
    for one in rows:
        mark = "*" if one["chosen"] else " "
        aicc = "-" if one["aicc"] is None else f"{one['aicc']:.1f}"
        notes = [] if one["stable"] else ["unstable"]
        notes += ["signs held"] if one["signs held"] else []
        lines.append(
            f"{mark} {one['law']:<14} {one['constants']:>9} {stress(one['rms MPa']):>10} "
            f"{stress(one['unseen MPa']):>10} {aicc:>8}  {stress(one['young MPa'])}"
            + (f"  ({', '.join(notes)})" if notes else "")
        )
    return [
        *lines,
        "  fitted, unseen: rms error on the points of the fit, and on blocks left out.",
        "  *: fewest constants within one standard error of the least error on unseen points.",
    ]


def _limits(found: dict[str, Any]) -> list[str]:
    high = max(found["stable to"].values())
    ends = {name: end for name, end in found["stable to"].items() if name != "compression"}
    early = [f"{name} from a stretch of {end:.2f}" for name, end in ends.items() if not np.isclose(end, high)]
    squeezed = found["stable to"]["compression"]
    if not np.isclose(squeezed * high, 1.0):
        early.append(f"compression below a stretch of {squeezed:.2f}")
    stable = f"Drucker-stable to a stretch of {high:.2f} in uniaxial, biaxial and planar tension, and compressed to "
    lines = [f"NOT stable: {', '.join(early)}"] if early else [f"{stable}{1 / high:.2f}"]
    if found["not measured"]:
        lines.append(
            f"{' and '.join(found['not measured'])} tension was not measured: there the law is a guess, "
            "which matters for walls that are inflated"
        )
    return lines


def _half(half: float | None) -> str:
    return " (not determined by these curves)" if half is None else f" +- {stress(half)} (95 %)"
