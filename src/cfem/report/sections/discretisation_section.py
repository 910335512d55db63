"""A discretisation study on the page."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from cfem.report.chart import Chart, chart, panel
from cfem.report.page import ReportSection
from cfem.report.sections.discretisation import kind, label
from cfem.report.style import FAINT, LEARNED, tick
from cfem.report.tables import ReportTable, number, tabulate

_MARKS = ("o", "s", "^", "D")


def discretisation_section(study: Mapping[str, Any]) -> ReportSection:
    """Section on the discretisation error. study: of `cfem.report.sections.discretisation.study`."""
    rows = study["meshes"]
    ratios = sorted({row["poisson"] for row in rows})
    parts: list[Chart | ReportTable] = front_charts(rows, ratios[len(ratios) // 2])
    if len(ratios) > 2:
        parts.append(poisson_chart(rows))
    parts.append(discretisation_table(rows))
    if study["orders"]:
        parts.append(orders_table(study["orders"]))
    if study["tolerances"]:
        parts.append(tolerance_table(study["tolerances"]))
    text = (
        "The same states are solved on several meshes. Errors are differences from the reference mesh, which has an "
        "error of its own. W converges more slowly than the tip, whose position the prescribed displacements fix in "
        "part. Graded meshes are finest where W needs it."
    )
    return ReportSection("Discretisation error", text, tuple(parts))


def _families(rows: Sequence[dict]) -> list[tuple[str, list[dict]]]:
    """Meshes of one element and grading, by name; the reference is none of them."""
    compared = [row for row in rows if not row["reference"] and row["radius"] is None]
    names = dict.fromkeys(kind(row) for row in compared)
    return [(name, [row for row in compared if kind(row) == name]) for name in names]


def front_charts(rows: Sequence[dict], poisson: float) -> list[Chart]:
    """Error of W and of the tip against CPU seconds per sample at one Poisson's ratio, where there are three meshes to
    compare."""
    families = [(name, [row for row in family if row["poisson"] == poisson]) for name, family in _families(rows)]
    if sum(len(family) for _, family in families) < 3:
        return []
    axes = []
    for key, what in (("W", "error of W (%)"), ("tip", "error of the tip (%)")):
        axis = panel(what, "CPU per sample (s)", log="xy")
        for index, (name, family) in enumerate(families):
            line = sorted(family, key=lambda row: row["sample_seconds"])
            look = {"color": LEARNED[index % len(LEARNED)], "marker": _MARKS[index % 4], "ms": 6}
            for shown, more in ((line, {"mfc": "white", "lw": 1}), ([row for row in line if row["front"]], {"lw": 0})):
                x, y = ([row["sample_seconds"] for row in shown], [100 * row[key] for row in shown])
                axis.plot(x, y, **look, **more, label=name if shown is line else None)
        axis.axhline(1.0, color=FAINT, lw=1, ls="--")
        axes.append(axis)
    caption = (
        f"Error against run time of each mesh at Poisson's ratio {poisson:g}. A sample is a solve from a near state, "
        "with its W. Filled: no other mesh is both faster and more accurate."
    )
    return [chart("discretisation", caption, axes)]


def poisson_chart(rows: Sequence[dict]) -> Chart:
    """Error of W against Poisson's ratio, a line a mesh."""
    axis = panel("error of W (%)", "Poisson's ratio", log="y")
    ratios = sorted({row["poisson"] for row in rows})
    for index, (name, family) in enumerate(_families(rows)):
        cells = sorted({row["cells"] for row in family})
        for place, count in enumerate(cells):
            line = sorted((row for row in family if row["cells"] == count), key=lambda row: row["poisson"])
            look = {"color": LEARNED[index % len(LEARNED)], "alpha": 0.35 + 0.65 * (place + 1) / len(cells)}
            x, y = [ratios.index(row["poisson"]) for row in line], [100 * row["W"] for row in line]
            axis.plot(x, y, "-" + _MARKS[index % 4], ms=5, label=name if place == len(cells) - 1 else None, **look)
    axis.set_xticks(range(len(ratios)), [f"{nu:g}" for nu in ratios])
    axis.axhline(1.0, color=FAINT, lw=1, ls="--")
    return chart("poisson", "What near incompressibility does to each mesh. Paler lines are coarser meshes.", [axis])


def discretisation_table(results: Sequence[dict]) -> ReportTable:
    """Table of errors, one mesh and Poisson's ratio a row. The reference has no error to state."""

    def percent(key: str) -> Callable[[dict], str]:
        return lambda row: "reference" if row["reference"] else number(100 * row[key])

    return tabulate(
        results,
        {
            "mesh": label,
            "Poisson's ratio": lambda row: f"{row['poisson']:g}",
            "nodes": lambda row: str(row["nodes"]),
            "W of the first actuator (mm/N)": lambda row: number(row["W_11"]),
            "error of W (%)": percent("W"),
            "error of the tip (%)": percent("tip"),
            "error of forces (%)": percent("force"),
            "factorisations, cold": lambda row: number(row["factorizations"]),
            "CPU per sample (ms)": lambda row: number(1e3 * row["sample_seconds"]),
            "on the front": lambda row: "yes" if row["front"] and not row["reference"] else "",
        },
    )


def orders_table(orders: Sequence[dict]) -> ReportTable:
    """Table of orders of convergence, one family of meshes a row."""
    return tabulate(
        orders,
        {
            "meshes": lambda row: (
                kind(row) + ("" if row["radius"] is None else f", attachments of radius {row['radius']:g} mm")
            ),
            "Poisson's ratio": lambda row: f"{row['poisson']:g}",
            "order of the error of W in the cell size": lambda row: number(row["order"], 2),
        },
    )


def tolerance_table(results: Sequence[dict]) -> ReportTable:
    """Table of what a tolerance of the solver costs and gives, one a row."""
    return tabulate(
        results,
        {
            "solver tolerance": lambda row: tick(row["tolerance"]),
            "residual": lambda row: number(row["residual"]),
            "tip error (mm)": lambda row: number(row["tip_mm"]),
            "relative error of W": lambda row: number(row["W"]),
            "iterations": lambda row: str(row["iterations"]),
            "factorisations": lambda row: str(row["factorizations"]),
            "CPU (s)": lambda row: number(row["seconds"]),
        },
    )
