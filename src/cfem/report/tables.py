"""Values as a person reads them: numbers with few digits, spreads, tables by columns."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

from cfem.core.console.shown import duration, length
from cfem.report.style import power_of_ten


@dataclass(frozen=True)
class ReportTable:
    """A table of text, the first column left-aligned."""

    head: tuple[str, ...]
    rows: list[tuple[str, ...]]
    words: bool = False  # whether all cells are words, in lines that break

    def html(self) -> str:
        """Table in a box that scrolls where the screen is narrow."""
        head = "".join(f'<th scope="col">{escape(cell)}</th>' for cell in self.head)
        rows = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in self.rows)
        look = ' class="words"' if self.words else ""
        table = f"<table{look}><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>"
        return f'<div class="scroll" tabindex="0">{table}</div>'


def tabulate(rows: Iterable[Any], columns: Mapping[str, Callable[[Any], str]]) -> ReportTable:
    """Table with one row for each value of `rows`. columns: head -> text of its cell. A column without a text in any
    row is left out."""
    cells = [[text(row) for text in columns.values()] for row in rows]
    kept = [i for i in range(len(columns)) if i == 0 or any(row[i] not in ("", "–") for row in cells)]
    heads = list(columns)
    return ReportTable(tuple(heads[i] for i in kept), [tuple(row[i] for i in kept) for row in cells])


def by_controller(results: Mapping[str, Mapping[str, Any]], columns: Mapping[str, Callable[[Any], str]]) -> ReportTable:
    """Table with a row a trajectory and controller. columns: as of `tabulate`, of (trajectory, controller, result)."""
    rows = [(name, who, result) for name, controllers in results.items() for who, result in controllers.items()]
    return tabulate(rows, {"trajectory": lambda row: row[0], "controller": lambda row: row[1]} | dict(columns))


def loss(errors: Mapping[str, Any]) -> str:
    """The paper's loss of a model, a dash where its test states do not differ and the loss has no unit."""
    return number(None if errors.get("entries") == 0 else errors["loss"])


def number(value: float | None, digits: int = 3) -> str:
    """Three digits, powers of ten only where they help; a dash where there is none."""
    if value is None or value != value:
        return "–"
    if value != 0 and not 1e-3 <= abs(value) < 1e5:
        return power_of_ten(value, digits)
    return f"{value:.{digits}g}" if abs(value) < 10**digits else f"{value:.0f}"


def spread(values: Mapping[str, float] | None, *keys: str) -> str:
    """The numbers of these names, mean and largest unless said otherwise, with a slash between them."""
    chosen = [values[key] for key in keys or ("mean", "max")] if values else [None]
    known = [value for value in chosen if value is not None]
    return " / ".join("–" if value is None else number(value) for value in chosen) if known else "–"


def lengths(values: Mapping[str, float] | None, *keys: str) -> str:
    """Lengths in mm, as `spread`, with the unit that suits the largest: '1.2 / 7.5 nm'."""
    return _with_unit(length, values, keys or ("mean", "max"))


def durations(microseconds: Mapping[str, float] | None, *keys: str) -> str:
    """Median and 99th percentile unless said otherwise: '87 / 130 µs'."""
    return _with_unit(duration, microseconds, keys or ("median", "p99"), 1e-6)


def _with_unit(show: Callable[..., str], values: Mapping[str, float] | None, keys: Sequence[str], scale=1.0) -> str:
    chosen = [values.get(key) for key in keys] if values else []
    known = [scale * value for value in chosen if value is not None and value == value]
    if len(known) == len(chosen) and known:
        return show(*known)
    return " / ".join("–" if value is None or value != value else show(scale * value) for value in chosen) or "–"
