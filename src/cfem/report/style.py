"""One look for all figures: colours, lines, ticks, and the way of a PNG from a matplotlib figure to bytes."""

import io

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

INK, FAINT, GRID, GROUND = "#22303c", "#9aa5b1", "#e6eaee", "#ffffff"
GOAL, FE = FAINT, "#e07a2f"
LEARNED = ("#1769aa", "#2a9d63", "#8e4ec6", "#c2334d")

plt.rcParams.update(
    {
        "font.family": "sans-serif",
        "font.sans-serif": ["DejaVu Sans"],  # comes with matplotlib; some systems' fonts lack superscripts
        "font.size": 10,
        "text.parse_math": False,  # names of files and actuators may hold a $
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.edgecolor": FAINT,
        "axes.labelcolor": INK,
        "axes.titlesize": 10.5,
        "axes.titleweight": "bold",
        "axes.titlelocation": "left",
        "axes.grid": True,
        "axes.axisbelow": True,
        "axes.prop_cycle": plt.cycler(color=[*LEARNED, FE, "#3a7d8c", "#a67c00", "#6b7280"]),
        "grid.color": GRID,
        "grid.linewidth": 0.7,
        "text.color": INK,
        "xtick.color": INK,
        "ytick.color": INK,
        "legend.frameon": False,
        "legend.fontsize": 9,
        "figure.facecolor": "white",
        "figure.constrained_layout.use": True,
        "svg.fonttype": "none",
    }
)


def grid(count: int, columns: int = 3, height: float = 3.1, **shared: bool) -> tuple[Figure, list]:
    """`count` axes in rows of at most `columns`, four of them in a square; shared: sharex, sharey."""
    columns = 2 if count == 4 else min(count, columns)
    rows = -(-count // columns)
    width = 10.5 if columns > 1 else 6.51
    figure, axes = plt.subplots(rows, columns, figsize=(width, height * rows), squeeze=False, **shared)
    for axis in axes.flat[count:]:
        axis.remove()
    for axis in axes.flat[count - columns : count]:  # the lowest of each column
        axis.tick_params(labelbottom=True)
    return figure, list(axes.flat[:count])


def png(figure: Figure, dpi: int = 160, **look) -> bytes:
    """Picture (PNG) of a figure."""
    for axis in figure.axes:
        plain_powers(axis)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=dpi, metadata={"Software": None}, **look)
    plt.close(figure)
    return buffer.getvalue()


def outside_legend(axis, columns: int = 4) -> None:
    """A legend above the plot, where it hides no data."""
    place = {"loc": "lower left", "bbox_to_anchor": (0, 1.0), "borderaxespad": 0.2}
    axis.legend(ncols=columns, handlelength=1.4, columnspacing=1.1, **place)


def plain_powers(axis) -> None:
    """Ticks as text. Logarithmic axes: numbers such as 20, 50, 100 along a short axis, powers of ten along a long one.
    Matplotlib's mathematical text is off."""
    from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

    for line in (axis.xaxis, axis.yaxis):
        low, high = line.get_view_interval()
        if line.get_scale() != "log":
            if 0 < max(abs(low), abs(high)) < 1e-3:  # matplotlib would put 1e-5 where the title stands
                line.set_major_formatter(FuncFormatter(lambda value, _: tick(value)))
            continue
        decades = np.log10(max(high, 1e-300) / max(low, 1e-300))
        if isinstance(line.get_major_locator(), LogLocator):
            if decades < 1:
                line.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))
            else:
                line.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if decades < 1.6 else (1.0,), numticks=7))
        plain = decades < 5 and low >= 1e-3 and high < 1e5
        line.set_major_formatter(FuncFormatter(lambda value, _, plain=plain: tick(value, plain)))
        line.set_minor_formatter(NullFormatter())


def tick(value: float, plain: bool | None = None) -> str:
    """Text of a number, as 0.05 or 10⁻⁵. plain: the former where both would do."""
    plain = abs(value) >= 1e-3 if plain is None else plain
    if plain or value == 0:
        return f"{value:g}".replace("-", "−")
    return ("−" if value < 0 else "") + power_of_ten(abs(value), 2).replace(".0·", "·").removeprefix("1·")


def power_of_ten(value: float, digits: int) -> str:
    """Text of a number as 2.50·10⁻⁷."""
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    return f"{mantissa}·10{str(int(exponent)).translate(str.maketrans('-0123456789', '⁻⁰¹²³⁴⁵⁶⁷⁸⁹'))}"


def ticks_at(axis, values) -> None:
    """Ticks along a logarithmic x axis at these values alone."""
    axis.set_xticks(values, [f"{value:g}" for value in values])
    axis.set_xticks([], minor=True)


def colour_of(controller: str, names: list[str]) -> str:
    """FE-based is orange everywhere, learned models blue, green, ... in their order."""
    if controller == "fe-based":
        return FE
    learned = [name for name in names if name != "fe-based"]
    return LEARNED[learned.index(controller) % len(LEARNED)]
