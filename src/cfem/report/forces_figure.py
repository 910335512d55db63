"""What the actuators carry along a trajectory, and what robots that hold an object push it with."""

from collections.abc import Mapping, Sequence

import numpy as np

from cfem.report.style import INK, outside_legend, panels, png


def forces_figure(rows: Mapping[str, np.ndarray], actuators: Sequence[str], title: str) -> bytes:
    """rows: columns of one trajectory of `trajectories.parquet`, full-effort controllers only; actuators: their
    names, with the robot's before a dot where there are several robots."""
    names = list(dict.fromkeys(rows["controller"]))
    contact = rows.get("contact")
    figure, axes = panels(1 if contact is None else 2, width=6.4 if contact is None else 10.5, height=3.7)
    _lines(axes[0], rows, names, "lambda_a", 1e3, list(actuators), "force of the actuators (mN)")
    if contact is not None:
        robots = list(dict.fromkeys(name.split(".")[0] for name in actuators)) if contact.shape[1] > 3 else [""]
        parts = [f"{robot} {axis}".strip() for robot in robots for axis in "xyz"]
        _lines(axes[1], rows, names, "contact", 1e3, parts, "force on the object (mN)")
    figure.suptitle(title, x=0.01, ha="left", fontweight="bold", fontsize=11)
    return png(figure)


def _lines(axis, rows, names, key: str, scale: float, labels: Sequence[str], ylabel: str) -> None:
    """A colour a component; the first controller a line, the others marks upon it."""
    looks = {
        name: {"lw": 0, "marker": "o+x"[place % 3], "ms": 4, "mfc": "none"} for place, name in enumerate(names[1:])
    }
    looks[names[0]] = {"lw": 1.8}
    for index, label in enumerate(labels):
        axis.plot([], [], color=f"C{index}", lw=1.8, label=label)
        for name in names:
            mine = rows["controller"] == name
            values = scale * rows[key][mine][:, index]
            axis.plot(rows["goal_index"][mine], values, color=f"C{index}", **looks[name])
    for name in names:
        axis.plot([], [], color=INK, label=name, **looks[name])
    axis.set(xlabel="goal", ylabel=ylabel)
    outside_legend(axis, columns=4)
