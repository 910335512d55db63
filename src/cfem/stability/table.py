"""Results as a person and as a program reads them."""

from collections.abc import Sequence
from itertools import groupby
from typing import Any

from cfem.core.artefact.files import finite
from cfem.core.console.shown import duration
from cfem.core.system import peak_memory
from cfem.stability.suite import Result, misbehaving

_FIGURES = (
    "residual",
    "tolerance",
    "rounding",
    "asymmetry",
    "smallest_eigenvalue",
    "condition",
    "iterations",
    "factorizations",
)
_NAME = 42  # columns of a case's name


def as_text(results: Sequence[Result]) -> str:
    """The cases by family, one line each of at most 80 columns, below it what is wrong with it; and a summary. All
    figures are in `as_data`."""
    lines = []
    for family, cases in groupby(results, key=lambda result: result.case.name.partition("/")[0]):
        lines += ["", f"{family:<{_NAME}}{'status':<20}{'residual':>9}{'allowed':>9}"]
        for result in cases:
            name = result.case.name.partition("/")[2]
            residual, allowed = (_short(getattr(result.evidence, name, None)) for name in ("residual", "tolerance"))
            if len(name) > _NAME - 3:
                lines.append(f"  {name}")
                name = ""
            lines.append(f"  {name:<{_NAME - 2}}{result.status:<20}{residual:>9}{allowed:>9}")
            lines += [f"    wrong: {sentence}" for sentence in result.wrong]
    seconds = sum(result.seconds for result in results)
    memory = peak_memory()
    bad = len(misbehaving(results))
    return "\n".join(
        [
            *lines[1:],
            "",
            f"{len(results)} cases, {len(results) - bad} as they should be, {bad} misbehave; {duration(seconds)}"
            + ("" if memory is None else f", {memory:.2f} GiB at most"),
        ]
    )


def as_data(results: Sequence[Result]) -> dict[str, Any]:
    """Results as data for JSON: what is missing, or not finite, is None."""
    return {
        "cases": len(results),
        "misbehaving": [result.case.name for result in misbehaving(results)],
        "seconds": sum(result.seconds for result in results),
        "peak_memory_gib": peak_memory(),
        "table": [
            {
                "case": result.case.name,
                "expectation": str(result.case.expect),
                "status": result.status,
                "right": not result.wrong,
                "wrong": list(result.wrong),
                **{figure: finite(getattr(result.evidence, figure, None)) for figure in _FIGURES},
                "seconds": result.seconds,
            }
            for result in results
        ],
    }


def _short(value: float | int | None) -> str:
    if value is None:
        return "-"
    return str(value) if isinstance(value, int) else f"{value:.1e}"
