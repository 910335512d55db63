"""A crawler on the page: the way that it went, plan beside finite elements, and how far it goes at other frictions."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from cfem.core.console.shown import duration, length, length_unit
from cfem.report.chart import Chart, chart, panel
from cfem.report.page import Number, ReportSection, Summary
from cfem.report.sections.tracking import FLOOR, Tracking, carried
from cfem.report.style import INK
from cfem.report.tables import ReportTable, number, tabulate

NAME = "gait"  # of the one trajectory
FRICTION = "friction"


def gait_section(tracking: Tracking, results: Mapping[str, Any], units: Mapping[str, tuple[str, str]]) -> ReportSection:
    """Section on the gait. results: of `cfem control`; units: of the displacement and of the force of every actuator,
    by its name."""
    text = (
        "A search on the learned model of one leg found the gait. The model plans the commands, and the finite-element "
        f"robot ({tracking.nodes} nodes a leg) carries them out, without feedback. "
    )
    text += "".join(f"{line[0].upper()}{line[1:]}. " for line in tracking.headline)
    rows = tracking.of(NAME)
    charts = [path_chart(tracking, results), *carried(tracking, NAME, rows, [tracking.learned(NAME)], units)]
    return ReportSection(
        "The gait", text, (*friction_tables(tracking, results), *charts), facts={"tracking": tracking.summaries}
    )


def path_chart(tracking: Tracking, results: Mapping[str, Any]) -> Chart:
    """Chart of the base's way along the direction and its distance from the plan, over the commands; distances over
    friction."""
    rows = tracking.of(NAME)
    direction = np.asarray(tracking.spec["gait"]["direction"], float)
    direction /= np.linalg.norm(direction)
    begin = rows["goal"][0] - rows["predicted_e"][0]
    commands = np.arange(1, len(rows["goal"]) + 1)
    gone = panel("way of the base (mm)", "command", count=True)
    for key, look in _looks().items():
        places = rows["goal" if key == "plan" else "x_e"]
        gone.plot([0, *commands], [0.0, *((places - begin) @ direction)], **look)
    unit, mm = length_unit(np.nanmax(rows["error"], initial=FLOOR))
    apart = panel(f"from the plan ({unit})", "command", count=True)
    apart.plot(commands, rows["error"] / mm, color="C0")
    apart.set_ylim(bottom=0)
    caption = "Way of the base since rest, and how far from its plan finite elements take it."
    axes = [gone, apart]
    if results["frictions"] or results["planned_frictions"]:
        axes.append(_over_friction(tracking, results))
        caption += " Right: the same gait at other coefficients of friction."
    return chart("gait", caption, axes)


def _looks() -> dict[str, dict]:
    return {
        "plan": {"marker": "o", "ms": 5, "mfc": "none", "lw": 0, "color": INK, "label": "plan"},
        "fe": {"marker": ".", "ms": 4, "lw": 1.3, "color": "C0", "label": "finite elements"},
    }


def distances(tracking: Tracking, results: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Distances in mm a cycle by friction: planned, and by finite elements (fe) where they walked; None where a walk
    ended."""
    at_its_friction = {FRICTION: tracking.spec["gait"]["ground"][FRICTION], **results["per_cycle"]}
    return sorted(
        [at_its_friction, *results["frictions"], *results["planned_frictions"]], key=lambda row: row[FRICTION]
    )


def _over_friction(tracking: Tracking, results: Mapping[str, Any]) -> Any:
    """Panel of the distance a cycle over the coefficient of friction."""
    axis = panel("mm a cycle", "coefficient of friction")
    looks = dict(zip(("planned", "fe"), _looks().values(), strict=True))
    looks["half_steps"] = {"marker": "x", "ms": 5, "lw": 0, "color": "C3", "label": "plan in half steps"}
    for key, look in looks.items():
        known = [(row[FRICTION], row[key]) for row in distances(tracking, results) if row.get(key) is not None]
        if known:
            axis.plot(*zip(*known, strict=True), **look)
    axis.margins(y=0.1)
    axis.set_ylim(bottom=0)
    return axis


def friction_tables(tracking: Tracking, results: Mapping[str, Any]) -> list[ReportTable]:
    """Table of friction, where finite elements walked at several."""
    walked = [row for row in distances(tracking, results) if "fe" in row]
    if len(walked) < 2:
        return []
    labels = {"planned": "planned (mm a cycle)", "fe": "finite elements (mm a cycle)"}
    columns = {label: lambda row, key=key: _far(row[key]) for key, label in labels.items()}
    return [tabulate(walked, {FRICTION: lambda row: number(row[FRICTION], 2)} | columns)]


def _far(mm: float | None) -> str:
    return "no whole cycle" if mm is None else number(mm, 3)


def gait_summary(tracking: Tracking, results: Mapping[str, Any]) -> Summary:
    """Summary of how far it goes, how near to the plan, and what a command of the plan takes."""
    cyclic, rows = tracking.spec["gait"].get("distance") is None, tracking.of(NAME)
    far, per = (results["per_cycle"], " a cycle") if cyclic else (results["distance"], "")
    planned, fe = (None if far[key] is None else length(far[key]) + per for key in ("planned", "fe"))
    numbers = [Number(duration(float(np.median(1e-6 * rows["step_us"]))), "per command of the plan (median)")]
    error = rows["error"][np.isfinite(rows["error"])]
    if len(error):
        note = f"largest {length(error.max())}, on the mesh of the model"
        numbers.insert(0, Number(length(error.mean()), "mean distance of the base from the plan", (note,)))
    if fe is None:
        return Summary(f"The plan goes {planned or 'nowhere'}; finite elements do not finish it.", (), tuple(numbers))
    half_steps = "the plan does not come to its end in half steps"
    if far["half_steps"] is not None:
        half_steps = f"{length(far['half_steps'])}{per} planned in half steps"
    numbers.insert(0, Number(fe, "by finite elements", (f"{planned} planned", half_steps)))
    return Summary(f"The crawler goes {fe} by finite elements, {planned} by the plan.", (), tuple(numbers))
