"""One look for all figures, and the way from a matplotlib figure to bytes."""

import io
from collections.abc import Sequence

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

INK, FAINT = "#22303c", "#9aa5b1"
GOAL, FE = "#9aa5b1", "#e07a2f"
LEARNED = ("#1769aa", "#2a9d63", "#8e4ec6", "#c2334d")

plt.rcParams.update(
    {
        "font.family": "sans-serif",
        "font.sans-serif": ["Liberation Sans", "DejaVu Sans"],
        "font.size": 10,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.edgecolor": FAINT,
        "axes.labelcolor": INK,
        "axes.titlesize": 10.5,
        "axes.titleweight": "bold",
        "axes.titlelocation": "left",
        "axes.grid": True,
        "grid.color": "#e6eaee",
        "grid.linewidth": 0.7,
        "text.color": INK,
        "xtick.color": INK,
        "ytick.color": INK,
        "legend.frameon": False,
        "legend.fontsize": 9,
        "figure.facecolor": "white",
        "figure.constrained_layout.use": True,
        "svg.hashsalt": "cfem",
    }
)


def panels(columns: int, width: float = 9.0, height: float = 3.4) -> tuple[Figure, list]:
    """A row of axes."""
    figure, axes = plt.subplots(1, columns, figsize=(width, height), squeeze=False)
    return figure, list(axes[0])


def grid(count: int, columns: int = 3, width: float = 10.5, height: float = 3.1, **shared: bool) -> tuple[Figure, list]:
    """`count` axes in rows of at most `columns`, four of them in a square; shared: sharex, sharey."""
    columns = 2 if count == 4 else min(count, columns)
    rows = -(-count // columns)
    width = width if columns > 1 else 0.62 * width
    figure, axes = plt.subplots(rows, columns, figsize=(width, height * rows), squeeze=False, **shared)
    for axis in axes.flat[count:]:
        axis.remove()
    for axis in axes.flat[count - columns : count]:  # the lowest of each column
        axis.tick_params(labelbottom=True)
    return figure, list(axes.flat[:count])


def png(figure: Figure, dpi: int = 160) -> bytes:
    """The same figure, the same bytes: no date inside."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=dpi, metadata={"Software": None})
    plt.close(figure)
    return buffer.getvalue()


def outside_legend(axis, columns: int = 4) -> None:
    """A legend above the plot, where it hides no data."""
    place = {"loc": "lower left", "bbox_to_anchor": (0, 1.0), "borderaxespad": 0.2}
    axis.legend(ncols=columns, handlelength=1.4, columnspacing=1.1, **place)


def log_ticks(axis) -> None:
    """Numbers such as 20, 50, 100 along a logarithmic x axis that is short, few powers of ten along a long one."""
    from matplotlib.ticker import LogFormatterMathtext, LogLocator, MaxNLocator, NullFormatter

    low, high = axis.get_view_interval()
    decades = np.log10(max(high, 1e-300) / max(low, 1e-300))
    if decades < 1:
        axis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))
    else:
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if decades < 2.2 else (1.0,), numticks=8))
    plain = decades < 2.2 or (decades < 4 and low >= 1e-3)
    axis.set_major_formatter("{x:g}" if plain else LogFormatterMathtext())
    axis.set_minor_formatter(NullFormatter())


def ticks_at(axis, values: Sequence[float]) -> None:
    """Ticks along a logarithmic x axis at these values alone."""
    axis.set_xticks(values, [f"{value:g}" for value in values])
    axis.set_xticks([], minor=True)


def colour_of(controller: str, names: list[str]) -> str:
    """FE-based is orange everywhere, learned models blue, green, ... in their order."""
    if controller == "fe-based":
        return FE
    learned = [name for name in names if name != "fe-based"]
    return LEARNED[learned.index(controller) % len(LEARNED)]
