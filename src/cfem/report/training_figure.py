"""How models learned: held-out error against terms or epochs."""

from collections.abc import Mapping
from typing import Any

from matplotlib.lines import Line2D

from cfem.report.style import INK, LEARNED, grid, log_ticks, png

CURVES = ("training", "validation")


def training_figure(models: Mapping[str, Mapping[str, Any]]) -> bytes:
    """models: name -> results of `cfem train`. One panel a model."""
    figure, axes = grid(len(models))
    for (name, results), axis in zip(models.items(), axes, strict=False):
        history = results["history"]
        if history and "terms" in history[0]:
            _terms(axis, results)
        else:
            _epochs(axis, history)
        axis.set_title(f"{name}, {results['samples']} samples")
        axis.legend(loc="best", fontsize=8)
    return png(figure)


def _terms(axis, results: Mapping[str, Any]) -> None:
    """A colour a quantity; solid where all coordinates count alike, dashed and dotted where their weights were searched
    for or are of a first fit; a ring marks what was chosen."""
    for colour, quantity in zip(LEARNED, dict.fromkeys(row["quantity"] for row in results["history"]), strict=False):
        for weights, style in (("equal", "o-"), ("searched", "s--"), ("decay", "d:")):
            rows = [row for row in results["history"] if (row["quantity"], row["weights"]) == (quantity, weights)]
            terms, errors = [row["terms"] for row in rows], [row["error"] for row in rows]
            axis.loglog(terms, errors, style, ms=2.5, lw=1.1, color=colour)
        found = [row for row in results["history"] if row["quantity"] == quantity]
        best = min(found, key=lambda row: row["error"])
        axis.loglog(best["terms"], best["error"], "o", ms=9, mfc="none", color=colour)
        axis.plot([], [], color=colour, label=quantity.replace("_", " "))
    if any(row["weights"] == "searched" for row in results["history"]):
        axis.add_line(Line2D([], [], ls="--", color=INK, label="weights searched"))
        axis.add_line(Line2D([], [], ls=":", color=INK, label="weights by decay"))
    axis.set(xlabel="terms", ylabel="held-out error, relative")
    log_ticks(axis.xaxis)


def _epochs(axis, history: list[dict[str, float]]) -> None:
    """A line a quantity and curve: kinds that learn quantities one by one say which a record is of."""
    quantities = dict.fromkeys(row.get("quantity", "") for row in history)
    for colour, quantity in zip(LEARNED, quantities, strict=False):
        rows = [row for row in history if row.get("quantity", "") == quantity]
        for curve, style, pale in zip(CURVES, ("-", "--"), (0.55, 1.0), strict=True):
            label = f"{quantity} {curve}".strip().replace("_", " ")
            epochs = [row.get("epoch", row.get("iteration")) for row in rows]
            axis.semilogy(epochs, [row[curve] for row in rows], style, lw=1.3, color=colour, alpha=pale, label=label)
    axis.set(xlabel="epoch" if "epoch" in history[0] else "iteration", ylabel="loss, standardised")
