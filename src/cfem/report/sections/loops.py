"""Control over time: how far the effector is from its goal at every tick, and where it went."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from cfem.core.artefact.content import artefact_file
from cfem.core.errors import InputError
from cfem.dataset.parquet import read_parquet
from cfem.dataset.schema import metadata
from cfem.report.chart import Chart, chart, panel
from cfem.report.page import ReportSection
from cfem.report.sections import estimates
from cfem.report.sections.estimates import estimate_chart, estimate_table
from cfem.report.sections.tracking import FLOOR, planes
from cfem.report.style import GOAL, colour_of
from cfem.report.tables import ReportTable, by_controller, durations, lengths, number, spread

COLUMNS = ["trajectory", "controller", "seed", "seconds", "goal_index", "goal", "x_e", "error"]


def loop_section(name: str, folder: Path, manifest: Mapping[str, Any]) -> ReportSection:
    """Section on a run over time. manifest: of `cfem control` with a loop. InputError where it has none."""
    results = manifest["results"].get("loop")
    if results is None:
        raise InputError("holds no run over time", where=str(folder), do="name it under `control`")
    estimated = any("estimate" in result for controllers in results.values() for result in controllers.values())
    wanted = [*COLUMNS, *(estimates.COLUMNS if estimated else [])]
    table = read_parquet(artefact_file(folder, "loop.parquet"), wanted)
    columns = {key: np.array(table[key].to_pylist()) for key in wanted}
    loaded = metadata(table).get("loaded", []) if estimated else []
    charts = []
    for trajectory in results:
        of_trajectory = columns["trajectory"] == trajectory
        rows = {key: values[of_trajectory] for key, values in columns.items()}
        title = trajectory.replace("-", " ")
        charts.append(loop_chart(f"loop-{name}-{trajectory}", rows, title))
        if estimated:
            charts.append(estimate_chart(f"estimate-{name}-{trajectory}", rows, loaded, title))
    text = (
        "At each tick a controller takes the last measurement and sends one command: of an inverse step from the "
        "estimated state, or of a trained policy. Errors are distances of the true position from the goal."
    )
    section = f"Over time: {name}"
    tables = [loop_table(results), *([estimate_table(results, loaded)] if estimated else [])]
    return ReportSection(section, text, (*tables, *charts), facts={f"loop {name}": results})


def loop_table(results: Mapping[str, Mapping[str, dict]]) -> ReportTable:
    """Table of runs over time, one trajectory and controller a row."""
    return by_controller(
        results,
        {
            "goals reached": lambda row: f"{row[2]['reached']['mean']:g} of {row[2]['goals']}",
            "time (s)": lambda row: number(row[2]["seconds"]),
            "ticks until it stays, median / max": lambda row: spread(row[2]["ticks_to_converge"], "median", "max"),
            "error when the next goal was due, mean / max": lambda row: lengths(row[2]["error_at_goals"]),
            "error at every tick, mean / max": lambda row: lengths(row[2]["error"]),
            "CPU per tick, median / p99": lambda row: durations(row[2]["step_us"]),
        },
    )


def loop_chart(name: str, rows: Mapping[str, np.ndarray], title: str) -> Chart:
    """Chart of a run over time. rows: columns of one trajectory of `loop.parquet`; of several seeds the first is
    drawn."""
    names = list(dict.fromkeys(rows["controller"]))
    goals = rows["goal"][np.unique(rows["goal_index"], return_index=True)[1]]
    i, j = planes(goals[:, :3])[0]
    path = panel(f"{'xyz'[j]} (mm)", f"{'xyz'[i]} (mm)")
    error = panel("distance to the goal (mm)", "time (s)", log="y")
    path.plot(goals[:, i], goals[:, j], "o", ms=4, mfc="none", color=GOAL, label="goal")
    for who in names:
        of_controller = rows["controller"] == who
        of_controller &= rows["seed"] == rows["seed"][of_controller][0]
        colour, x = colour_of(who, names), rows["x_e"][of_controller]
        path.plot(x[:, i], x[:, j], color=colour, lw=1.0, label=who)
        error.plot(
            rows["seconds"][of_controller],
            np.maximum(rows["error"][of_controller], FLOOR),
            color=colour,
            lw=1.0,
            label=who,
        )
    path.set_aspect("equal", adjustable="datalim")
    return chart(name, f"{title}: the way of the effector, and its distance from the goal at each tick.", [path, error])
