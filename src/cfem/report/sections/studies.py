"""Two questions of the paper: where to sample, and what a finer mesh asks of a model and of control."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from cfem.control.task.run_spec import FE_BASED
from cfem.core.console.shown import duration
from cfem.core.errors import InputError
from cfem.report.chart import chart, panel
from cfem.report.page import ReportSection
from cfem.report.sections.models import ERRORS, FLOORS, KINDS, MARKS
from cfem.report.spec import Published
from cfem.report.style import FE, INK, LEARNED, ticks_at
from cfem.report.tables import ReportTable, lengths, loss, number, spread, tabulate


def sampling_rows(method: str, model: str, trained: Iterable[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Rows of all learning curves in the results of `cfem train`, by the number of training rows."""
    rows = [
        {"method": method, "model": model, "kind": results["kind"], **point}
        for results in trained
        for point in results["learning_curve"]
    ]
    return sorted(rows, key=lambda row: row["samples"])


def mesh_row(
    name: str,
    mesh: Mapping[str, Any],
    model: Mapping[str, Any],
    control: Mapping[str, Any],
    published: Published | None,
) -> dict[str, Any]:
    """Row of a mesh from results of `cfem mesh`, `cfem train` and `cfem control`. steps: inverse steps per second,
    query or FE solve included, the median; missed_mm: mean distance to the goals in reach."""
    controllers = list(control["trajectories"].values())
    if not all(FE_BASED in controller_rows for controller_rows in controllers):
        raise InputError("lacks FE-based control", where=f"meshes: {name}", do="control it with fe_based: true")
    learned = next(who for who in controllers[0] if who != FE_BASED and "@" not in who)
    return {
        "name": name,
        "cells": mesh["cells"],
        "nodes": mesh["nodes"],
        "kind": model["kind"],
        "curve": model["learning_curve"],
        "steps_learned": _steps(controllers, learned),
        "steps_fe": _steps(controllers, FE_BASED),
        "missed_learned_mm": _missed(controllers, learned),
        "missed_fe_mm": _missed(controllers, FE_BASED),
        "published": published.model_dump() if published else None,
    }


def _steps(controllers: list[Mapping[str, Any]], name: str) -> float:
    return 1e6 / float(np.median([trajectory[name]["step_us"]["median"] for trajectory in controllers]))


def _missed(controllers: list[Mapping[str, Any]], name: str) -> float | None:
    spreads = [trajectory[name]["distance_to_reachable_goals"] for trajectory in controllers]
    means = [spread["mean"] for spread in spreads if spread]
    return float(np.mean(means)) if means else None


def sampling_section(rows: Sequence[Mapping[str, Any]]) -> ReportSection:
    """Section on where to sample: loss and largest tip error against rows, a colour a model, a line style a method.
    rows: of `sampling_rows`."""
    methods = list(dict.fromkeys(row["method"] for row in rows))
    names = list(dict.fromkeys(row["model"] for row in rows))
    axes = []
    for measure in ("loss", "tip"):
        title, error = ERRORS[measure]
        axis = panel(title, "training rows", log="xy")
        for name in names:
            for style, mark, method in zip(("-", "--", ":", "-."), MARKS, methods, strict=False):
                points = [row for row in rows if (row["model"], row["method"]) == (name, method)]
                if points:
                    y = [max(error(row), FLOORS[measure]) for row in points]
                    look = {"ls": style, "marker": mark, "ms": 6, "color": KINDS.get(points[0]["kind"], INK)}
                    axis.plot([row["samples"] for row in points], y, label=f"{name}, {method}", **look)
        ticks_at(axis, sorted({row["samples"] for row in rows}))
        axes.append(axis)
    picture = chart("sampling", "The same models from as many rows, sampled in different ways.", axes)
    text = "The same random states judge every model. A grid includes the ends of the domain."
    return ReportSection("Where to sample", text, (picture, sampling_table(rows)), {"sampling": list(rows)})


def sampling_table(rows: Sequence[Mapping[str, Any]]) -> ReportTable:
    """Table of errors, one model, method and number of training rows a row."""
    return tabulate(
        rows,
        {
            "model, method": lambda row: f"{row['model']}, {row['method']}",
            "rows": lambda row: str(row["samples"]),
            "the paper's loss": lambda row: loss(row["errors"]),
            "tip error, mean / max": lambda row: lengths(row["errors"]["tip_mm"]),
            "force error, mean / max (N)": lambda row: spread(row["errors"]["force_N"]),
            "training": lambda row: duration(row["seconds_fit"]),
        },
    )


def sizes_section(rows: Sequence[Mapping[str, Any]]) -> ReportSection:
    """Section on loss, and steps of control per second, against cells. rows: of `mesh_row`."""
    loss_panel, right = panel("loss", "cells", log="xy"), panel("control steps per second", "cells", log="xy")
    cells = [row["cells"] for row in rows]
    counts = sorted({point["samples"] for row in rows for point in row["curve"]})
    for count, mark, shade in zip(counts, MARKS, np.linspace(0.45, 1, len(counts)), strict=False):
        of_count = [(row["cells"], p["errors"]["loss"]) for row in rows for p in row["curve"] if p["samples"] == count]
        name = f"{rows[0]['kind']}, {count} samples"
        loss_panel.plot(*zip(*of_count, strict=True), "-", marker=mark, ms=6, color=LEARNED[0], alpha=shade, label=name)
    known = [(row["cells"], row["published"]) for row in rows if row["published"] and row["published"].get("loss")]
    if known:
        published_first = known[0][1]
        count_text = f", {published_first['samples']} samples" if published_first.get("samples") else ""
        losses = [published["loss"] for _, published in known]
        loss_panel.plot(
            [place for place, _ in known], losses, "*", ms=12, color=INK, label=published_first["source"] + count_text
        )
    right.plot(cells, [row["steps_learned"] for row in rows], "-o", ms=6, color=LEARNED[0], label="learned model")
    right.plot(cells, [row["steps_fe"] for row in rows], "-s", ms=6, color=FE, label="FE-based")
    for axis in (loss_panel, right):
        ticks_at(axis, cells)
        axis.margins(y=0.25)
    text = (
        "Test states of its own mesh judge each model. A control step is one query of the model, or one FE solve, and "
        "the quadratic program; the median is stated."
    )
    caption = "What a finer mesh asks of the model, and of control with the model or with the mesh itself."
    pictures = [chart("meshes", caption, [loss_panel, right])] if len(rows) > 2 else []  # of two the table says as much
    return ReportSection(
        "From coarse meshes to fine ones", text, (*pictures, sizes_table(rows)), {"meshes": list(rows)}
    )


def sizes_table(rows: Sequence[Mapping[str, Any]]) -> ReportTable:
    """Table of the rows of `mesh_row`, one mesh and number of samples each; control stands beside the last."""
    lines: list[tuple[str, Any, Any]] = []
    for row in rows:
        name = f"{row['name']}, {row['cells']} cells, {row['nodes']} nodes"
        lines += [(name, point, row if point is row["curve"][-1] else None) for point in row["curve"]]
        if published := row["published"]:
            known = {"samples": published["samples"] or "–", "errors": {"loss": published["loss"]}}
            lines.append((f"{row['name']}, {published['source']}", known, None))
    return tabulate(
        lines,
        {
            "mesh": lambda line: line[0],
            "samples": lambda line: str(line[1]["samples"]),
            "the paper's loss": lambda line: loss(line[1]["errors"]),
            "tip error, mean / max": lambda line: lengths(line[1]["errors"].get("tip_mm")),
            "samples per second, one core": lambda line: (
                number(line[1]["samples"] / line[1]["seconds_sampling"]) if "seconds_sampling" in line[1] else ""
            ),
            "steps per second, learned": lambda line: number(line[2]["steps_learned"]) if line[2] else "",
            "steps per second, FE-based": lambda line: number(line[2]["steps_fe"], 2) if line[2] else "",
            "mean distance to the goals, learned / FE-based": lambda line: (
                lengths(line[2], "missed_learned_mm", "missed_fe_mm") if line[2] else ""
            ),
        },
    )
