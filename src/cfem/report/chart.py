"""Charts as SVG inside the page: panels of one size, text of one size, colours that follow the reader's theme."""

import io
import re
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from cfem.report.style import FAINT, FE, GRID, GROUND, INK, plain_powers, plt

WIDTH, HEIGHT, LEFT, TEXT = 312, 236, 52, 11  # px on every screen
# Colours of style.py by the page's CSS variables.
THEME = {colour: f"c{place}" for place, colour in enumerate(plt.rcParams["axes.prop_cycle"].by_key()["color"])}
THEME |= {INK: "ink", FAINT: "faint", GRID: "grid", GROUND: "card", FE: "fe"}
_MARKS = {
    "o": '<circle cx="14" cy="7" r="3.5"/>',
    ".": '<circle cx="14" cy="7" r="2"/>',
    "s": '<path d="M10.5 3.5h7v7h-7z"/>',
    "^": '<path d="M14 3l4 7h-8z"/>',
    "v": '<path d="M14 11l4-7h-8z"/>',
    "D": '<path d="M14 2.5l4.5 4.5-4.5 4.5-4.5-4.5z"/>',
    "*": '<path d="M14 1l2 4.5 4.5.5-3.5 3 1 4.5-4-2.5-4 2.5 1-4.5L7.500 6l4.500-.5z"/>',
    "x": '<path d="M11 4l6 6m0-6l-6 6"/>',
    "+": '<path d="M14 3v8m-4-4h8"/>',
}
_DASHES = {"-": "", "--": "5 3", ":": "1.5 2.5", "-.": "6 2 1.5 2"}


@dataclass(frozen=True)
class Chart:
    """A picture of panels side by side, in the colours of paper."""

    name: str  # of the files
    caption: str  # what to see
    panels: tuple[str, ...]  # SVG
    legend: str  # HTML

    def html(self) -> str:
        panels = "".join(_themed(panel, f"{self.name}-{place}") for place, panel in enumerate(self.panels))
        shown = f'<div class="panels">{panels}</div><figcaption>{escape(self.caption)}</figcaption>'
        return f'<figure class="chart">{self.legend}{shown}</figure>'

    def files(self) -> dict[str, bytes]:
        """Files of the chart by name."""
        alone = len(self.panels) == 1
        return {
            f"{self.name}{'' if alone else f'-{place + 1}'}.svg": panel.encode()
            for place, panel in enumerate(self.panels)
        }


def panel(title: str, x: str, log: str = "", count: bool = False) -> Axes:
    """An axis on its own.

    title, x: what is above it and below it, each with its unit
    log: 'x', 'y', 'xy'
    count: whether x counts something"""
    with plt.rc_context({"font.size": TEXT, "axes.titlesize": TEXT, "figure.constrained_layout.use": False}):
        figure = Figure(figsize=(WIDTH / 72, HEIGHT / 72))
        axis = figure.add_axes((LEFT / WIDTH, 40 / HEIGHT, 1 - (LEFT + 12) / WIDTH, 1 - 66 / HEIGHT))
        axis.set_title(title, x=(6 - LEFT) / (WIDTH - LEFT - 12), y=1.0)
        axis.set_xlabel(x)
    axis.set(xscale="log" if "x" in log else "linear", yscale="log" if "y" in log else "linear")
    if count:
        axis.xaxis.set_major_locator(MaxNLocator(6, integer=True))
    elif "x" not in log:
        axis.xaxis.set_major_locator(MaxNLocator(4))  # so that labels such as 58.525 stand apart
    return axis


def chart(name: str, caption: str, axes: Sequence[Axes]) -> Chart:
    """Chart of some axes, each a panel, with one legend for all."""
    handles: dict[str, Line2D] = {}
    for axis in axes:
        for handle, label in zip(*axis.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    items = "".join(f"<li>{_swatch(handle)}{escape(label)}</li>" for label, handle in handles.items())
    name = re.sub(r"[^\w.-]+", "-", name)
    panels = tuple(_svg(axis, f"{name}-{place}") for place, axis in enumerate(axes))
    return Chart(name, caption, panels, f'<ul class="legend">{items}</ul>' if len(handles) > 1 else "")


def _svg(axis: Axes, salt: str) -> str:
    """Text of a panel as SVG; the same panel gives the same text."""
    plain_powers(axis)
    buffer = io.StringIO()
    with plt.rc_context({"svg.hashsalt": salt}):
        axis.figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    return buffer.getvalue()


def _themed(svg: str, name: str) -> str:
    """Text of a panel for the inside of a page: without prologue and foreign style, in the page's colours and
    letters."""
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>|<style.*?</style>", "", svg, flags=re.DOTALL)
    svg = re.sub(r'<g id="[^"]*"', "<g", svg)
    svg = re.sub(r' (xmlns(:xlink)?|version)="[^"]*"', "", svg).replace("xlink:href", "href")
    svg = re.sub(r' (width|height)="(\d+)pt"', r' \1="\2"', svg)
    svg = re.sub(r"font-family:[^;\"]*;?", "", svg)
    svg = re.sub(r"#[0-9a-f]{6}", lambda match: _colour(match[0]), svg)
    return re.sub(r"\n\s*", " ", svg).replace("<svg", f'<svg role="img" aria-label="{escape(name)}"', 1)


def _colour(value: str) -> str:
    return f"var(--{THEME[value]}, {value})" if value in THEME else value


def _swatch(handle: Line2D) -> str:
    """A line, its mark, or both, as in the panels."""
    if not isinstance(handle, Line2D):
        raise TypeError("a chart's legend is made of lines: draw with plot")
    colour = _colour(to_hex(handle.get_color()))
    face = handle.get_markerfacecolor()
    fill = "none" if str(face) == "none" else _colour(to_hex(face))
    alpha = handle.get_alpha() or 1
    dash, mark = _DASHES.get(handle.get_linestyle()), _MARKS.get(handle.get_marker(), "")
    line = (
        ""
        if dash is None or not handle.get_linewidth()
        else f'<path d="M1 7h26" stroke-dasharray="{dash}" stroke-width="2"/>'
    )
    look = f"stroke: {colour}; fill: {fill}; opacity: {alpha:g}"
    return f'<svg width="28" height="14" aria-hidden="true" style="{look}">{line}{mark}</svg>'
