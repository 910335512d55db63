"""Results as a person and as a program reads them."""

from collections.abc import Sequence
from math import isfinite
from typing import Any

from cfem.core.system import peak_memory
from cfem.stability.suite import Result, misbehaving

_FIGURES = ("residual", "rounding", "asymmetry", "smallest_eigenvalue", "condition", "iterations", "factorizations")
_HEADS = ("residual", "rounding", "asymmetry", "W smallest", "W condition", "iter.", "factor.")


def as_text(results: Sequence[Result]) -> str:
    """One line a case, below it what is wrong with it, and a summary."""
    name, expected, status = (
        max((len(part) for part in parts), default=0) + 2
        for parts in (
            [result.case.name for result in results],
            [str(result.case.expect) for result in results],
            [result.status for result in results],
        )
    )
    heads = "".join(f"{head:>12}" for head in _HEADS)
    lines = [f"{'case':{name}}{'expectation':{expected}}{'status':{status}}{heads}{'seconds':>9}"]
    for result in results:
        shown = "".join(f"{_short(getattr(result.evidence, figure, None)):>12}" for figure in _FIGURES)
        lines.append(
            f"{result.case.name:{name}}{result.case.expect!s:{expected}}{result.status:{status}}{shown}{result.seconds:9.2f}"
        )
        lines += [f"    wrong: {sentence}" for sentence in result.wrong]
    seconds = sum(result.seconds for result in results)
    bad = len(misbehaving(results))
    lines.append(
        f"{len(results)} cases, {len(results) - bad} as they should be, {bad} misbehave; "
        f"{seconds:.0f} s, {peak_memory() or float('nan'):.2f} GiB at most"
    )
    return "\n".join(lines)


def as_data(results: Sequence[Result]) -> dict[str, Any]:
    """For JSON: what is not there, or not finite, is None."""
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
                **{figure: _known(getattr(result.evidence, figure, None)) for figure in _FIGURES},
                "seconds": result.seconds,
            }
            for result in results
        ],
    }


def _known(value: float | int | None) -> float | int | None:
    return value if value is not None and isfinite(value) else None


def _short(value: float | int | None) -> str:
    if value is None:
        return "-"
    return str(value) if isinstance(value, int) else f"{value:.1e}"
