"""Models of one robot side by side: error against samples and against time, and error against what they say of it."""

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from cfem.predict.domain import FAR
from cfem.report.spec import Published
from cfem.report.style import FAINT, FE, INK, LEARNED, grid, log_ticks, png, ticks_at
from cfem.report.surrogates import Trust

KINDS = {"spectral": LEARNED[0], "energy_net": LEARNED[1], "mlp": LEARNED[2]}
FLAGGED = LEARNED[3]
MARKS = "os^Dv"
FLOORS = {"loss": 1e-18, "tip": 1e-12, "force": 1e-12}  # smaller is nothing

ERRORS = {
    "loss": ("the paper's loss", lambda point: point["errors"]["loss"]),
    "tip": ("largest tip error (mm)", lambda point: point["errors"]["tip_mm"]["max"]),
    "force": ("largest force error (N)", lambda point: point["errors"]["force_N"]["max"]),
}
COSTS = {
    "samples": ("FE samples", lambda point: point["samples"]),
    "fit": ("training (s)", lambda point: point["seconds_fit"]),
    "total": ("sampling and training (s)", lambda point: point["seconds_sampling"] + point["seconds_fit"]),
    "query": ("one query (µs)", lambda point: point["microseconds_query"]),
}


def looks(models: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    """One look a model: a colour a kind, a dashed line for models of forces, another mark where these are shared."""
    found, seen = {}, []
    for name, results in models.items():
        form = results.get("form", "displacement")
        twins = seen.count((results["kind"], form))
        seen.append((results["kind"], form))
        found[name] = {
            "color": KINDS.get(results["kind"], INK),
            "ls": "-" if form == "displacement" else "--",
            "marker": MARKS[twins % len(MARKS)],
            "mfc": "white" if form == "force" else None,
        }
    return found


def error_figure(
    models: Mapping[str, Mapping[str, Any]], published: Published | None = None, default: str | None = None
) -> bytes:
    """models: name -> results of `cfem train`. A row a measure of error, a column a cost; a line joins a model's
    numbers of samples."""
    figure, axes = plt.subplots(len(ERRORS), len(COSTS), figsize=(11.0, 8.2), sharex="col", sharey="row", squeeze=False)
    for row, (measure, (error_label, error)) in zip(axes, ERRORS.items(), strict=True):
        row[0].set_ylabel(error_label)
        for axis, (cost, (_, value)) in zip(row, COSTS.items(), strict=True):
            for name, look in looks(models).items():
                curve = sorted(models[name]["learning_curve"], key=lambda point: point["samples"])
                x, y = [value(point) for point in curve], [max(error(point), FLOORS[measure]) for point in curve]
                axis.loglog(x, y, ms=5, lw=2.2 if name == default else 1.3, **look)
                axis.loglog(x[-1:], y[-1:], ms=8, **{**look, "ls": "none"})
            if published:
                _published(axis, measure, cost, published)
    for axis, (label, _) in zip(axes[-1], COSTS.values(), strict=True):
        axis.set_xlabel(label)
        log_ticks(axis.xaxis)
    _legend(figure, models, published, default)
    return png(figure)


def _published(axis, measure: str, cost: str, published: Published) -> None:
    """Its loss where there is one, at its own cost where that is known; else its cost alone."""
    known = {"samples": published.samples, "query": published.query_us}.get(cost)
    if measure == "loss" and published.loss and known:
        axis.loglog(known, published.loss, "*", ms=13, color=INK)
    elif measure == "loss" and published.loss:
        axis.axhline(published.loss, color=INK, ls=":", lw=1.2)
    elif known:
        axis.axvline(known, color=INK, ls=":", lw=1.2)


def _legend(figure: Figure, models: Mapping, published: Published | None, default: str | None) -> None:
    lines = [
        Line2D([], [], ms=6, lw=2.2 if name == default else 1.3, **look, label=label(name, default))
        for name, look in looks(models).items()
    ]
    if published:
        mark = {"marker": "*", "ms": 11} if published.loss else {}
        many = f", {published.samples} samples" if published.samples else ""
        lines.append(Line2D([], [], color=INK, ls=":", **mark, label=published.source + many))
    figure.legend(handles=lines, loc="outside upper left", ncols=min(len(lines), 4), fontsize=10)


def label(name: str, default: str | None) -> str:
    return f"{name} (default)" if name == default else name


def trust_figure(found: Mapping[str, Trust]) -> bytes:
    """A panel a model: tip error of states that FE solved, against the distance that the model states."""
    figure, axes = grid(len(found), sharex=True, sharey=True)
    for axis, (name, one) in zip(axes, found.items(), strict=True):
        for inside in (True, False):
            for beyond in (False, True):
                mine = (one.inside == inside) & (one.beyond == beyond) & np.isfinite(one.error)
                axis.loglog(
                    np.maximum(one.distance[mine], 1e-2),
                    np.maximum(one.error[mine], FLOORS["tip"]),
                    **_trust_look(inside, beyond),
                )
        axis.axvline(FAR, color=FAINT, lw=1.2, ls="--")
        axis.set_title(name)
        log_ticks(axis.xaxis)
    figure.supxlabel("distance from the training states, as the model states it", fontsize=10)
    figure.supylabel("true tip error (mm)", fontsize=10)
    shown = [(True, False), (False, False)]
    if any(one.beyond.any() for one in found.values()):
        shown += [(False, True), (True, True)]
    handles = [Line2D([], [], **_trust_look(*kind), label=_trust_label(*kind)) for kind in shown]
    figure.legend(handles=handles, loc="outside upper left", ncols=4, fontsize=10)
    return png(figure)


def _trust_look(inside: bool, beyond: bool) -> dict[str, Any]:
    return {
        "ls": "none",
        "marker": "^" if beyond else "o",
        "ms": 4,
        "color": LEARNED[0] if inside else FLAGGED,
        "mfc": "none" if beyond else None,
        "alpha": 0.7,
    }


def _trust_label(inside: bool, beyond: bool) -> str:
    return f"{'state out of reach' if beyond else 'test state'}, {'not flagged' if inside else 'flagged'}"


def sampling_figure(rows: Sequence[Mapping[str, Any]]) -> bytes:
    """rows: of `cfem.report.studies.sampling_rows`. Loss and largest tip error against rows: a colour a model, a line
    style a method."""
    figure, axes = plt.subplots(1, 2, figsize=(10.0, 4.2), squeeze=False)
    methods = list(dict.fromkeys(row["method"] for row in rows))
    names = list(dict.fromkeys(row["model"] for row in rows))
    for axis, measure in zip(axes[0], ("loss", "tip"), strict=True):
        title, error = ERRORS[measure]
        for name in names:
            for style, mark, method in zip(("-", "--", ":", "-."), MARKS, methods, strict=False):
                mine = [row for row in rows if (row["model"], row["method"]) == (name, method)]
                kind = mine[0]["kind"] if mine else ""
                axis.loglog(
                    [row["samples"] for row in mine],
                    [max(error(row), FLOORS[measure]) for row in mine],
                    ls=style,
                    marker=mark,
                    ms=6,
                    color=KINDS.get(kind, INK),
                    label=f"{name}, {method}",
                )
        axis.set(xlabel="training rows", title=title)
        ticks_at(axis, sorted({row["samples"] for row in rows}))
    figure.legend(*axes[0][0].get_legend_handles_labels(), loc="outside upper left", ncols=4, fontsize=10)
    return png(figure)


def meshes_figure(rows: Sequence[Mapping[str, Any]]) -> bytes:
    """rows: of `cfem.report.studies.mesh_rows`. Loss, and steps of control a second, against tetrahedra."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(10.0, 4.0))
    cells = [row["cells"] for row in rows]
    counts = sorted({point["samples"] for row in rows for point in row["curve"]})
    for count, mark, shade in zip(counts, MARKS, np.linspace(0.45, 1, len(counts)), strict=False):
        mine = [(row["cells"], p["errors"]["loss"]) for row in rows for p in row["curve"] if p["samples"] == count]
        name = f"{rows[0]['kind']}, {count} samples"
        left.loglog(*zip(*mine, strict=True), "-", marker=mark, ms=6, color=LEARNED[0], alpha=shade, label=name)
    known = [(row["cells"], row["published"]) for row in rows if row["published"] and row["published"].get("loss")]
    if known:
        one = known[0][1]
        many = f", {one['samples']} samples" if one.get("samples") else ""
        losses = [published["loss"] for _, published in known]
        left.loglog([place for place, _ in known], losses, "*", ms=12, color=INK, label=one["source"] + many)
    right.loglog(cells, [row["steps_learned"] for row in rows], "-o", ms=6, color=LEARNED[0], label="learned model")
    right.loglog(cells, [row["steps_fe"] for row in rows], "-s", ms=6, color=FE, label="FE-based")
    left.set(xlabel="tetrahedra", title="the paper's loss")
    right.set(xlabel="tetrahedra", title="steps of control a second")
    for axis in (left, right):
        ticks_at(axis, cells)
        axis.legend(loc="best")
        axis.margins(y=0.25)
    return png(figure)
