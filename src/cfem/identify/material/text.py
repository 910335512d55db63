"""Text about a fit, for a person."""

from typing import Any

import numpy as np

from cfem.core.artefact.judgement import KEY, sentences
from cfem.core.console.shown import folded, stress


def fit_text(results: dict[str, Any]) -> str:
    """The results of `fit_material` in lines of at most the terminal's width."""
    lines = [
        f"{curve['file']}: {curve['points']} points of {curve['mode']} {curve['sense']}, "
        f"to {stress(curve['largest stress MPa'])}"
        for curve in results["curves"]
    ]
    low, high = results["stretch"]
    lines += [f"stretch {low:.3g} to {high:.3g}", "", *_table(results["tried"]), ""]
    young, half = results["young MPa"]
    lines += [f"{results['law']}: Young's modulus at rest {stress(young)}{_half(half)}"]
    if results["slack"] is not None:
        lines += [f"slack: the specimen begins to carry load at a strain of {results['slack'][0]:.3f}"]
    lines += [part for line in _limits(results) for part in folded(line)]
    return "\n".join([*sentences({KEY: results[KEY]}), *lines, "", results["scene"]])


def _table(rows: list[dict[str, Any]]) -> list[str]:
    """A line for each law that was tried."""
    lines = [f"  {'law':<14} {'constants':>9} {'fitted':>10} {'unseen':>10} {'AICc':>8}  E at rest"]
    for row in rows:
        mark = "*" if row["chosen"] else " "
        aicc = "-" if row["aicc"] is None else f"{row['aicc']:.1f}"
        notes = [] if row["stable"] else ["unstable"]
        notes += ["signs held"] if row["signs held"] else []
        lines.append(
            f"{mark} {row['law']:<14} {row['constants']:>9} {stress(row['rms MPa']):>10} "
            f"{stress(row['unseen MPa']):>10} {aicc:>8}  {stress(row['young MPa'])}"
            + (f"  ({', '.join(notes)})" if notes else "")
        )
    return [
        *lines,
        "  fitted, unseen: rms error on the points of the fit, and on blocks left out.",
        "  *: fewest constants within one standard error of the least error on unseen points.",
    ]


def _limits(results: dict[str, Any]) -> list[str]:
    """Lines on the stretch up to which the law is stable, and on modes that were not measured."""
    limits = results["stable to"]
    high = max(limits.values())
    ends = {name: end for name, end in limits.items() if name != "compression"}
    early = [f"{name} from a stretch of {end:.2f}" for name, end in ends.items() if not np.isclose(end, high)]
    squeezed = limits["compression"]
    if not np.isclose(squeezed * high, 1.0):
        early.append(f"compression below a stretch of {squeezed:.2f}")
    stable = f"Drucker-stable to a stretch of {high:.2f} in uniaxial, biaxial and planar tension, and compressed to "
    lines = [f"NOT stable: {', '.join(early)}"] if early else [f"{stable}{1 / high:.2f}"]
    if results["not measured"]:
        lines.append(
            f"{' and '.join(results['not measured'])} tension was not measured: there the law is a guess, "
            "which matters for walls that are inflated"
        )
    return lines


def _half(half: float | None) -> str:
    return " (not determined by these curves)" if half is None else f" +- {stress(half)} (95 %)"
