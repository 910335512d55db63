"""Where the effector went: goals, FE-based and learned control in two planes, errors goal by goal, errors
against time."""

from collections.abc import Mapping

import numpy as np

from cfem.report.style import FE, GOAL, INK, colour_of, outside_legend, panels, png

FLOOR = 1e-7  # mm: below it nothing is worth telling apart on a logarithmic axis


def tracking_figure(rows: Mapping[str, np.ndarray], title: str) -> bytes:
    """rows: columns of one trajectory of `trajectories.parquet`, full-effort controllers only."""
    figure, (side, front, error) = panels(3, width=10.5, height=3.7)
    names = list(dict.fromkeys(rows["controller"]))
    first = rows["controller"] == names[0]
    goal = rows["goal"][first]
    for axis, (i, j) in ((side, (1, 2)), (front, (0, 1))):
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
    front.set_title("from the front", pad=22)
    figure.suptitle(title, x=0.01, ha="left", fontweight="bold", fontsize=11)
    return png(figure)


def effort_figure(summaries: Mapping[str, Mapping[str, dict]]) -> bytes:
    """Distance to FE-based control, or to reachable goals where it is alone, against the time that a goal
    takes: results of `cfem control` by trajectory, controllers cut short (`name@iterations`) included."""
    figure, axes = panels(len(summaries), height=3.6)
    for axis, (trajectory, controllers) in zip(axes, summaries.items(), strict=True):
        full = [name for name in controllers if "@" not in name]
        for name, result in controllers.items():
            spread = result["distance_to_reachable_goals"] or result["distance_to_fe_based"]
            if spread is None:
                continue
            base, _, cut = name.partition("@")
            place = result["step_us"]["median"] * result["iterations_mean"] / 1000
            filled = FE if base == "fe-based" else colour_of(base, full)
            axis.loglog(place, max(spread["mean"], FLOOR), "o", ms=8, color=filled, alpha=0.55 if cut else 1.0)
            label = f"{base}, {cut} step{'s' if cut != '1' else ''}" if cut else base
            axis.annotate(
                label, (place, max(spread["mean"], FLOOR)), xytext=(7, 5), textcoords="offset points", fontsize=9
            )
        axis.margins(0.3)
        reachable = any(result["distance_to_reachable_goals"] for result in controllers.values())
        what = "mean distance to the goal" if reachable else "mean distance to FE-based control"
        axis.set(xlabel="time a goal (ms)", ylabel=f"{what} (mm)", title=trajectory)
    return png(figure)
