"""Section on estimates during control over time: unknown forces with their intervals, and the error of the shape."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from cfem.control.closed_loop.estimated_account import COVERED
from cfem.report.chart import Chart, chart, panel
from cfem.report.style import FAINT, INK, LEARNED
from cfem.report.tables import ReportTable, by_controller, number

COLUMNS = ["estimate_of", "estimate_status", "loads", "loads_sd", "true_loads", "shape_rms"]


def estimate_table(results: Mapping[str, Mapping[str, dict]], loaded: list[str]) -> ReportTable:
    """Table of estimates, one trajectory and controller a row. loaded: names of the rows with unknown forces."""
    estimates = {
        name: {who: result["estimate"] for who, result in controllers.items()} for name, controllers in results.items()
    }

    def force(estimate: Mapping[str, Any], name: str) -> str:
        unknown = estimate["unknowns"].get(name)
        return "" if unknown is None else f"{1e3 * unknown['rms']:.2g} / {1e3 * unknown['sd']:.2g}"

    return by_controller(
        estimates,
        {
            "samples estimated": lambda row: f"{row[2]['estimated']} of {row[2]['samples']}",
            "error of the shape, median / max (mm rms)": lambda row: _shape(row[2]),
            **{
                f"{name}, error / stated standard deviation (mN)": lambda row, name=name: force(row[2], name)
                for name in loaded
            },
            "95 % intervals that hold, of all / of what is observed": lambda row: _covered(row[2]),
            "innovations, of what is stated": lambda row: number(row[2].get("innovation")),
            "markers left out": lambda row: str(row[2]["left_out"]),
        },
    )


def _covered(estimate: Mapping[str, Any]) -> str:
    if "covered" not in estimate:
        return ""
    shares = [estimate["covered"], estimate["covered_observed"]]  # None where nothing is observed
    return " / ".join("–" if share is None else f"{100 * share:.1f} %" for share in shares)


def _shape(estimate: Mapping[str, Any]) -> str:
    return f"{number(estimate['shape']['median'])} / {number(estimate['shape']['max'])}" if "shape" in estimate else ""


def estimate_chart(name: str, rows: Mapping[str, np.ndarray], loaded: list[str], trajectory: str) -> Chart:
    """Chart of what is estimated; rows: columns of one trajectory of `loop.parquet`; of several controllers and seeds
    the last and the first."""
    who = rows["controller"][-1]
    estimated = (rows["controller"] == who) & (rows["estimate_of"] > 0) & (rows["estimate_status"] == "converged")
    estimated &= rows["seed"] == rows["seed"][rows["controller"] == who][0]
    step = float(np.min(np.diff(np.unique(rows["seconds"])))) if len(np.unique(rows["seconds"])) > 1 else 1.0
    seconds, panels = rows["estimate_of"][estimated] * step, []
    for place, row in enumerate(loaded):
        axis = panel(f"{row} (mN)", "time of the sample (s)")
        values, sd, true = (1e3 * rows[key][estimated][:, place] for key in ("loads", "loads_sd", "true_loads"))
        axis.fill_between(seconds, values - COVERED * sd, values + COVERED * sd, color=FAINT, alpha=0.4, lw=0)
        axis.plot(seconds, values, color=LEARNED[0], lw=1.0, label="estimate, 95 % interval")
        axis.plot(seconds, true, color=INK, lw=1.0, ls="--", label="truth")
        panels.append(axis)
    shape = panel("error of the shape (mm rms)", "time of the sample (s)")
    shape.plot(seconds, rows["shape_rms"][estimated], color=LEARNED[0], lw=1.0)
    panels.append(shape)
    return chart(name, f"{trajectory}, {who}: what is estimated from the markers.", panels)
