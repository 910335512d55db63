"""Natural frequencies and damping of models that move, along their workspace."""

from collections.abc import Mapping
from typing import Any

from cfem.motion.error import frequency_error_of
from cfem.motion.model import MotionModel
from cfem.motion.workspace import outwards, vibrations
from cfem.report.chart import Chart, chart, panel
from cfem.report.page import ReportSection
from cfem.report.style import LEARNED
from cfem.report.tables import ReportTable, number, tabulate

KINDS = {"held": False, "free": True}


def vibrations_section(models: Mapping[str, MotionModel]) -> ReportSection:
    """A chart and a table a model."""
    parts: list[Chart | ReportTable] = []
    vibrations_of: dict[str, dict[str, list[dict[str, Any]]]] = {}
    for name, model in models.items():
        states = outwards(model)
        vibrations_of[name] = {kind: vibrations(model, states, free) for kind, free in KINDS.items()}
        units = dict(zip(model.rows.actuators, (pair[0] for pair in model.static.actuator_units), strict=True))
        parts += [vibrations_chart(name, vibrations_of[name]), vibrations_table(vibrations_of[name], units)]
    stated = [frequency_error_of(model.static.meta.get("motion")) for model in models.values()]
    text = (
        "The lowest natural frequencies at five training states, from the nearest to rest to the farthest. Held "
        "actuators keep their displacements; free ones keep their forces. Damping is a share of the critical."
    ) + "".join(f" ±: {words}." for words in sorted({known.words for known in stated if known is not None}))
    return ReportSection("How it vibrates", text, tuple(parts), {"vibrations": vibrations_of})


def vibrations_chart(name: str, rows: Mapping[str, list[dict[str, Any]]]) -> Chart:
    """A panel for held actuators and one for free ones, a line a mode."""
    axes = []
    for kind, states in rows.items():
        axis = panel(f"{name}, actuators {kind}: frequency (Hz)", "state", count=True)
        for mode, colour in enumerate(LEARNED[: max(len(row["frequency"]) for row in states)]):
            known = [
                (place, row["frequency"][mode]) for place, row in enumerate(states, 1) if len(row["frequency"]) > mode
            ]
            axis.plot(*zip(*known, strict=True), "o-", ms=4, color=colour, label=f"mode {mode + 1}")
        axis.set_ylim(0, None)
        axes.append(axis)
    return chart(f"vibrations-{name}", "Natural frequencies from rest to the ends of the workspace.", axes)


def vibrations_table(rows: Mapping[str, list[dict[str, Any]]], units: Mapping[str, str]) -> ReportTable:
    """A row a state; units: of each actuator's displacement, by its name."""

    def in_words(row: Mapping[str, Any]) -> str:
        known = row.get("frequency_error") or ()
        errors = [f" ± {number(100 * share, 2)} %" for share in known] + [""] * len(row["frequency"])
        modes = zip(row["frequency"], errors, row["damping"], strict=False)
        text = ", ".join(f"{number(f)}{error} ({number(100 * d, 2)} %)" for f, error, d in modes) or "unstable"
        return text + (", OUTSIDE" if row.get("frequency_error", ()) is None else "")

    by_state = list(enumerate(zip(rows["held"], rows["free"], strict=True), 1))
    columns = {"state": lambda row: str(row[0])}
    for place, (name, unit) in enumerate(units.items()):
        columns[f"{name} ({unit})"] = lambda row, place=place: number(row[1][0]["delta_a"][place])
    columns |= {
        "held: Hz (damping)": lambda row: in_words(row[1][0]),
        "free: Hz (damping)": lambda row: in_words(row[1][1]),
    }
    return tabulate(by_state, columns)
