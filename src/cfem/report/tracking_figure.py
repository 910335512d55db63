"""Where the effector went: goals, FE-based and learned control in two planes, errors goal by goal, errors
against time."""

from collections.abc import Mapping

import numpy as np

from cfem.report.style import GOAL, INK, colour_of, outside_legend, panels, png

MARKERS = "osv^Dp"
FLOOR = 1e-7  # mm: below it nothing is worth telling apart on a logarithmic axis


def tracking_figure(rows: Mapping[str, np.ndarray], title: str) -> bytes:
    """rows: columns of one trajectory of `trajectories.parquet`, full-effort controllers only."""
    figure, (side, front, error) = panels(3, width=10.5, height=3.7)
    names = list(dict.fromkeys(rows["controller"]))
    first = rows["controller"] == names[0]
    goal = rows["goal"][first]
    widest = widest_plane(goal)
    for axis, (i, j) in ((side, widest), (front, (0, 1) if widest != (0, 1) else (0, 2))):
        axis.plot(goal[:, i], goal[:, j], "o", ms=5, mfc="none", mec=GOAL, label="goal")
        for name in names:
            x = rows["x_e"][rows["controller"] == name]
            look = {"lw": 3.2, "alpha": 0.7} if name == "fe-based" else {"lw": 1.3, "marker": ".", "ms": 4}
            axis.plot(x[:, i], x[:, j], color=colour_of(name, names), label=name, **look)
        axis.set(xlabel=f"{'xyz'[i]} (mm)", ylabel=f"{'xyz'[j]} (mm)")
        axis.set_aspect("equal", adjustable="datalim")
    for name in names:
        mine = rows["controller"] == name
        distance = np.maximum(rows["error"][mine], FLOOR)
        error.semilogy(
            rows["goal_index"][mine], distance, color=colour_of(name, names), lw=2.6 if name == "fe-based" else 1.3
        )
        if name != "fe-based" and np.isfinite(rows["error_to_fe_based"][mine]).any():
            apart = np.maximum(rows["error_to_fe_based"][mine], FLOOR)
            error.semilogy(rows["goal_index"][mine], apart, ":", color=colour_of(name, names), lw=1.6)
    error.plot([], [], color=INK, label="to the goal")
    error.plot([], [], ":", color=INK, label="to FE-based")
    error.set(xlabel="goal", ylabel="distance (mm)")
    outside_legend(error)
    outside_legend(side)
    figure.suptitle(title, x=0.01, ha="left", fontweight="bold", fontsize=11)
    return png(figure)


def widest_plane(points: np.ndarray) -> tuple[int, int]:
    """The two axes along which points (m, 3) spread most, in order."""
    first, second = sorted(np.argsort(np.ptp(points, axis=0))[-2:])
    return int(first), int(second)


def effort_figure(summaries: Mapping[str, Mapping[str, dict]]) -> bytes:
    """Distance to FE-based control, or to reachable goals where it is alone, against the time that a goal
    takes: results of `cfem control` by trajectory, controllers cut short (`name@iterations`) included."""
    figure, axes = panels(len(summaries), height=3.9)
    for axis, (trajectory, controllers) in zip(axes, summaries.items(), strict=True):
        full = [name for name in controllers if "@" not in name]
        goals_count = all(2 * result["reachable"] > result["goals"] for result in controllers.values())
        key = "distance_to_reachable_goals" if goals_count else "distance_to_fe_based"
        for name, result in controllers.items():
            base, _, cut = name.partition("@")
            label = f"{base}, {cut} step{'s' if cut != '1' else ''}" if cut else base
            milliseconds = result["step_us"]["median"] * result["iterations_mean"] / 1000
            look = {"color": colour_of(base, full), "alpha": 0.5 if cut else 1.0, "label": label}
            if result[key] is None:
                axis.axvline(milliseconds, lw=2.0, **look)
            else:
                marker = MARKERS[int(cut) % len(MARKERS)] if cut else "o"
                axis.loglog(milliseconds, max(result[key]["mean"], FLOOR), marker, ms=9, **look)
        axis.set(xscale="log", yscale="log", xlabel="time a goal (ms)")
        axis.set_ylabel(f"mean distance to {'the goal' if goals_count else 'FE-based control'} (mm)")
        axis.margins(0.2)
        outside_legend(axis, columns=3)
        axis.set_title(trajectory.replace("-", " "), pad=40)
    return png(figure)
