"""Tracking of goals: what was commanded and reached, as values, a table and charts."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cfem.condensed.strokes import FE_TOLERANCE, TOLERANCE
from cfem.control.task.run_spec import FE_BASED
from cfem.core.artefact.content import artefact_file
from cfem.core.console.shown import length, length_unit
from cfem.dataset.parquet import read_parquet
from cfem.report.chart import Chart, chart, panel
from cfem.report.page import ReportSection
from cfem.report.style import GOAL, INK, colour_of
from cfem.report.tables import ReportTable, by_controller, durations, lengths, number, tabulate

FLOOR = 1e-7  # mm: below it nothing is worth telling apart on a logarithmic axis
FEW = 3  # goals or controllers: of fewer the table says as much
MARKS = "osv^Dp"
SHOWN = ("goals reached", "discretisation error")  # lines of the command whose numbers the page shows elsewhere


@dataclass(frozen=True)
class Tracking:
    """A run of `cfem control`, goal by goal.

    columns: of `trajectories.parquet`, (m, ...) each
    rows: names of the effector rows, then of the actuators
    summaries: results by trajectory and controller
    spec: of the run
    plant: 'fem' or 'model'
    nodes: of the robot that judges
    fe_seconds: CPU seconds of one FE solve, None without any
    discretisation: error of the mesh itself as `cfem control` estimates it, None where it did not look
    headline: lines that it printed of objects, obstacles and contact"""

    columns: Mapping[str, np.ndarray]
    rows: Sequence[str]
    summaries: Mapping[str, Mapping[str, dict]]
    spec: Mapping[str, Any]
    plant: str
    nodes: int
    fe_seconds: float | None
    discretisation: Mapping[str, Any] | None = None
    headline: Sequence[str] = ()

    @property
    def actuators(self) -> Sequence[str]:
        return self.rows[self.columns["goal"].shape[1] :]

    def of(self, trajectory: str, controller: str | None = None) -> dict[str, np.ndarray]:
        """Rows of one trajectory; of one controller, or of all with full effort (no `name@iterations`)."""
        wanted = self.columns["trajectory"] == trajectory
        who = [controller] if controller else [name for name in self.summaries[trajectory] if "@" not in name]
        wanted &= np.isin(self.columns["controller"], who)
        return {name: values[wanted] for name, values in self.columns.items()}

    def reached(self, trajectory: str, controller: str) -> int:
        """Goals that the robot itself reached, whatever the plan said."""
        return int((self.of(trajectory, controller)["error"] <= self.spec["reached"]).sum())

    def learned(self, trajectory: str) -> str:
        """The first learned controller; FE-based control where it is alone."""
        names = list(self.summaries[trajectory])
        return next((name for name in names if name != FE_BASED), names[0])


def read_tracking(folder: Path, manifest: Mapping[str, Any]) -> Tracking:
    """Tracking of an artefact of `cfem control` without a loop."""
    table = read_parquet(artefact_file(folder, "trajectories.parquet"))
    results = manifest["results"]
    cost = results.get("fe_cost") or {}
    return Tracking(
        columns={name: np.array(table[name].to_pylist()) for name in table.column_names},
        rows=json.loads(table.schema.metadata[b"cfem"])["rows"],
        summaries=results["trajectories"],
        spec=manifest["spec"],
        plant=results["plant"],
        nodes=results["nodes"],
        fe_seconds=cost["seconds"] / cost["solves"] if cost.get("solves") else None,
        discretisation=results.get("discretisation"),
        headline=[line for line in results.get("headline", []) if not any(part in line for part in SHOWN)],
    )


def places(tracking: Tracking) -> list[int]:
    """Columns of the x coordinates of all watched points among the effector rows. Orientations are left out."""
    return [i for i, name in enumerate(tracking.rows[: tracking.columns["goal"].shape[1]]) if name.endswith(".x")]


def tracking_section(tracking: Tracking, units: Mapping[str, tuple[str, str]]) -> ReportSection:
    """Section on tracking. units: of the displacement and of the force of every actuator, by its name."""
    text = (
        "Each controller turns a goal into actuator displacements with its own model. "
        f"The finite-element robot ({tracking.nodes} nodes) then carries them out, without feedback. "
        "For a goal out of reach it ends at the nearest point that it can reach. "
    )
    if tracking.plant == "model":
        text = (
            "Each controller turns a goal into actuator displacements. The first model carries them out; no FE robot "
            "is involved. "
        )
    cut = next((who for controllers in tracking.summaries.values() for who in controllers if "@" in who), None)
    if cut:
        text += f"{cut} is {cut.partition('@')[0]} with no more steps per goal than the number behind the @. "
    text += "".join(f"{line[0].upper()}{line[1:]}. " for line in tracking.headline)
    table = [mesh_error_table(tracking.discretisation)] if "tip_mm" in (tracking.discretisation or {}) else []
    shown = [name for name in tracking.summaries if len(set(tracking.of(name)["goal_index"])) >= FEW]
    charts = [each_chart for name in shown for each_chart in trajectory_charts(tracking, name, units)]
    return ReportSection(
        "Tracking",
        text + looser(tracking, next(iter(units.values()))[0]),
        (tracking_table(tracking), *table, *charts, *effort_charts(tracking)),
        facts={"tracking": tracking.summaries},
    )


def looser(tracking: Tracking, unit: str) -> str:
    """Sentence on why FE-based control misses by more than the learned one, where it does; unit: of an actuator's
    displacement."""
    pairs = [
        (
            controllers[FE_BASED]["distance_to_reachable_goals"],
            controllers[tracking.learned(name)]["distance_to_reachable_goals"],
        )
        for name, controllers in tracking.summaries.items()
        if FE_BASED in controllers
    ]
    if not any(fe and learned and fe["mean"] > learned["mean"] for fe, learned in pairs):
        return ""
    fe, learned = (
        f"{100 * share:g} % of their stroke" if stated is None else f"{stated:g} {unit}"
        for stated, share in (
            (tracking.spec["fe_tolerance"], FE_TOLERANCE),
            (tracking.spec["search"]["tolerance"], TOLERANCE),
        )
    )
    return (
        f"FE-based control stops where its actuators would move by less than {fe}, a learned controller at {learned}, "
        "because a step of FE-based control costs far more. Its larger tracking error comes from this looser "
        "tolerance, not from its model."
    )


def tracking_table(tracking: Tracking) -> ReportTable:
    """Table of tracking errors, one trajectory and controller a row."""
    return by_controller(
        tracking.summaries,
        {
            "goals reached": lambda row: f"{tracking.reached(row[0], row[1])} of {row[2]['goals']}",
            "goals not out of reach": lambda row: str(row[2]["reachable"]),
            "searches that did not converge": lambda row: str(row[2]["not_converged"]),
            "tracking error, goals in reach, mean / max": lambda row: lengths(row[2]["distance_to_reachable_goals"]),
            "distance to FE-based, mean / max": lambda row: lengths(row[2]["distance_to_fe_based"]),
            "steps per goal": lambda row: number(row[2]["iterations_mean"], 2),
            "time per step, median / p99": lambda row: durations(row[2]["step_us"]),
            "residual of the QP (mm)": lambda row: number(row[2]["kkt_max"], 2),
        },
    )


def mesh_error_table(error: Mapping[str, Any]) -> ReportTable:
    """Table of the distance of the robot of a finer mesh from this one, the commands being the same."""
    return tabulate(
        [error],
        {
            "discretisation error, estimated, at most": lambda row: (
                f"{row['cells']} cells against {row['finer_cells']}"
            ),
            "states": lambda row: str(row["states"]),
            "tip": lambda row: length(row["tip_mm"], digits=2),
            "tip (% of the length)": lambda row: number(row["tip_percent"], 2),
            "actuator forces (%)": lambda row: number(row["force_percent"], 2),
            "reach (%)": lambda row: number(row["reach_percent"], 2),
        },
    )


def trajectory_charts(tracking: Tracking, name: str, units: Mapping[str, tuple[str, str]]) -> list[Chart]:
    """Charts of where the effector went and how far from its goals it was, and of what the actuators carry."""
    rows, title = tracking.of(name), name.replace("-", " ")
    names = list(dict.fromkeys(rows["controller"]))
    first = rows["controller"] == names[0]
    first_row = (places(tracking) or [0])[0]
    free = free_coordinates(tracking, first_row)
    goal = rows["goal"][first][:, first_row : first_row + 3].copy()
    goal[:, free] = rows["x_e"][first][:, first_row : first_row + 3][:, free]
    axes = []
    for i, j in planes(goal):
        axis = panel(f"{'xyz'[j]} (mm)", f"{'xyz'[i]} (mm)")
        axis.plot(goal[:, i], goal[:, j], "o", ms=5, mfc="none", color=GOAL, label="goal")
        for who in names:
            x = rows["x_e"][rows["controller"] == who][:, first_row : first_row + 3]
            look = {"lw": 5, "alpha": 0.45} if who == FE_BASED else {"lw": 1.3, "marker": ".", "ms": 4}
            axis.plot(x[:, i], x[:, j], color=colour_of(who, names), label=who, **look)
        axis.set_aspect("equal", adjustable="datalim")
        axes.append(axis)
    unit, mm = length_unit(np.nanmax(rows["error"], initial=FLOOR))
    error = panel(f"distance to the goal ({unit})", "goal", log="y", count=True)
    for who in names:
        of_controller = rows["controller"] == who
        distance = np.maximum(rows["error"][of_controller], FLOOR) / mm
        look = {"lw": 5, "alpha": 0.45} if who == FE_BASED else {"lw": 1.3}
        error.plot(rows["goal_index"][of_controller], distance, color=colour_of(who, names), label=who, **look)
    caption = f"{title}: goals, the positions that the robot reached, and its distance from each goal."
    if free:
        caption += f" No goal states {' or '.join('xyz'[i] for i in free)}: it is drawn where the robot is."
    return [chart(f"tracking-{name}", caption, [*axes, error]), *carried(tracking, name, rows, names, units)]


def free_coordinates(tracking: Tracking, first_row: int) -> list[int]:
    """Numbers of the coordinates x, y, z of the point whose rows begin at `first_row` that the search leaves free:
    those without weight."""
    weights = tracking.spec["search"].get("weights")
    return [i for i in range(3) if weights and weights[first_row + i] == 0]


def carried(tracking: Tracking, name: str, rows: Mapping, names: Sequence[str], units: Mapping) -> list[Chart]:
    """Charts of the forces of the actuators, pressures of chambers, and the push on what is held."""
    kinds: dict[str, list[int]] = {}
    for place, actuator in enumerate(tracking.actuators):
        kinds.setdefault(unit_of(actuator, units)[1], []).append(place)
    axes = []
    for unit, numbers in kinds.items():
        scale, shown = {"N": (1e3, "mN"), "MPa": (1e3, "kPa")}.get(unit, (1.0, unit))
        if unit == "N" and np.abs(rows["lambda_a"][:, numbers]).max(initial=0) >= 1:
            scale, shown = 1.0, "N"
        axis = panel(f"{'pressure' if unit == 'MPa' else 'force'} ({shown})", "goal", count=True)
        _lines(
            axis, rows, names, scale * rows["lambda_a"][:, numbers], [tracking.actuators[place] for place in numbers]
        )
        axes.append(axis)
    text = "what each actuator carries, as each controller plans it"
    charts = [chart(f"forces-{name}", f"{name.replace('-', ' ')}: {text}.", axes)]
    contact = rows.get("contact")
    if contact is not None:
        robots = (
            dict.fromkeys(actuator.split(".")[0] for actuator in tracking.actuators) if contact.shape[1] > 3 else [""]
        )
        parts = [f"{robot} {axis}".strip() for robot in robots for axis in "xyz"]
        axis = panel("force on the object (mN)", "goal", count=True)
        _lines(axis, rows, names, 1e3 * contact, parts, 3)
        text = (
            f"{name.replace('-', ' ')}: the force by which each robot pushes the object, as each controller plans it."
        )
        charts.append(chart(f"contact-{name}", text, [axis]))
    return charts


def unit_of(actuator: str, units: Mapping[str, tuple[str, str]]) -> tuple[str, str]:
    """Units (displacement, force) of an actuator; strips a leading robot name."""
    name = actuator if actuator in units else actuator.partition(".")[2]
    return units.get(name, ("mm", "N"))


def _lines(
    axis, rows: Mapping, names: Sequence[str], values: np.ndarray, labels: Sequence[str], grouped: int = 1
) -> None:
    """A colour a component, or so many of them, which differ in their dashes then; a line for the first controller,
    marks for the others."""
    looks = [{"lw": 1.8}] + [{"lw": 0, "marker": "o+x"[i % 3], "ms": 4, "mfc": "none"} for i in range(len(names) - 1)]
    for index, label in enumerate(labels):
        style = {"color": f"C{index // grouped % 8}", "ls": ("-", "--", ":")[index % grouped]}
        axis.plot([], [], lw=1.8, label=label, **style)
        for name, look in zip(names, looks, strict=True):
            of_controller = rows["controller"] == name
            axis.plot(rows["goal_index"][of_controller], values[of_controller, index], **style, **look)
    for name, look in zip(names, looks, strict=True):
        if len(names) > 1:
            axis.plot([], [], color=INK, label=name, **look)


def planes(points: np.ndarray) -> list[tuple[int, int]]:
    """Axes of the plane along which points (m, 3) spread most, and of a second one where they leave the first."""
    size = np.ptp(points, axis=0)
    low, first, second = np.argsort(size)
    pairs = [tuple(sorted((int(first), int(second))))]
    if size[low] > 0.02 * size[second]:
        pairs.append((0, 1) if pairs[0] != (0, 1) else (0, 2))
    return pairs


def effort_charts(tracking: Tracking) -> list[Chart]:
    """Charts of error against the time that a goal takes, where three controllers or more, cut short
    (`name@iterations`) or not, leave something to compare."""
    axes = []
    for trajectory, controllers in tracking.summaries.items():
        goals_count = all(2 * result["reachable"] > result["goals"] for result in controllers.values())
        key = "distance_to_reachable_goals" if goals_count else "distance_to_fe_based"
        shown = {name: result for name, result in controllers.items() if result[key]}
        if len(shown) < FEW:
            continue
        to = "to the goal" if goals_count else "to FE-based control"
        axis = panel(f"{trajectory.replace('-', ' ')}: mean distance {to} (mm)", "time per goal (ms)", log="xy")
        full = [name for name in controllers if "@" not in name]
        for name, result in shown.items():
            base, _, cut = name.partition("@")
            label = f"{base}, {cut} step{'s' if cut != '1' else ''} per goal" if cut else base
            time = result["step_us"]["median"] * result["iterations_mean"] / 1000
            look = {"ms": 8, "lw": 0, "alpha": 0.5 if cut else 1.0, "color": colour_of(base, full), "label": label}
            axis.plot([time], [max(result[key]["mean"], FLOOR)], MARKS[int(cut or 0) % len(MARKS)], **look)
        axis.margins(0.2)
        axes.append(axis)
    text = "What accuracy costs: mean distance against the time that one goal takes; lower left is better."
    return [chart("effort", text, axes)] if axes else []
