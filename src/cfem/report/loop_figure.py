"""Control over time: how far the effector is from its goal at every tick, and where it went."""

from collections.abc import Mapping

import numpy as np

from cfem.report.style import GOAL, colour_of, outside_legend, panels, png
from cfem.report.tracking_figure import FLOOR, widest_plane


def loop_figure(rows: Mapping[str, np.ndarray], title: str) -> bytes:
    """rows: columns of one trajectory of `loop.parquet`; of several seeds the first is drawn."""
    figure, (path, error) = panels(2, width=10.5, height=3.8)
    names = list(dict.fromkeys(rows["controller"]))
    goals = rows["goal"][np.unique(rows["goal_index"], return_index=True)[1]]
    i, j = widest_plane(goals)
    path.plot(goals[:, i], goals[:, j], "o", ms=4, mfc="none", mec=GOAL, label="goal")
    for name in names:
        mine = rows["controller"] == name
        mine &= rows["seed"] == rows["seed"][mine][0]
        colour, x = colour_of(name, names), rows["x_e"][mine]
        path.plot(x[:, i], x[:, j], color=colour, lw=1.0, label=name)
        error.semilogy(rows["seconds"][mine], np.maximum(rows["error"][mine], FLOOR), color=colour, lw=1.0)
    path.set(xlabel=f"{'xyz'[i]} (mm)", ylabel=f"{'xyz'[j]} (mm)")
    path.set_aspect("equal", adjustable="datalim")
    error.set(xlabel="time (s)", ylabel="distance to the goal (mm)")
    outside_legend(path)
    figure.suptitle(title, x=0.01, ha="left", fontweight="bold", fontsize=11)
    return png(figure)
