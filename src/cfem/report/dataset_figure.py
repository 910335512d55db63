"""What was sampled: displacements and forces of the actuators, split by split."""

from cfem.dataset.reader import Dataset
from cfem.report.style import INK, LEARNED, panels, png


def coverage_figure(splits: dict[str, Dataset]) -> bytes:
    """The first two actuators in the plane of their displacements and of their forces; one actuator: force
    over displacement."""
    one = next(iter(splits.values())).rows.n_a == 1
    figure, axes = panels(1 if one else 2, height=3.8)
    for (name, data), colour in zip(splits.items(), (LEARNED[0], "#e07a2f", LEARNED[1], LEARNED[2]), strict=False):
        look = {
            "s": 14 if name == "train" else 11,
            "color": colour,
            "marker": "o" if name == "train" else "x",
            "lw": 0.8,
        }
        label = f"{name} ({len(data.delta_a)})"
        if one:
            axes[0].scatter(data.delta_a[:, 0], data.lambda_a[:, 0], label=label, **look)
            continue
        axes[0].scatter(data.delta_a[:, 0], data.delta_a[:, 1], label=label, **look)
        axes[1].scatter(data.lambda_a[:, 0], data.lambda_a[:, 1], label=label, **look)
        slack = data.slack.any(axis=1)
        if slack.any():
            axes[0].scatter(
                *data.delta_a[slack, :2].T, s=40, facecolors="none", edgecolors=INK, lw=0.8, label=f"{name}, one slack"
            )
    names = next(iter(splits.values())).rows.actuators
    if one:
        axes[0].set(xlabel=f"{names[0]}: displacement (mm)", ylabel="force (N)", title="sampled states")
    else:
        axes[0].set(
            xlabel=f"{names[0]} (mm)", ylabel=f"{names[1]} (mm)", title="actuator displacements", aspect="equal"
        )
        axes[1].set(xlabel=f"{names[0]} (N)", ylabel=f"{names[1]} (N)", title="actuator forces", aspect="equal")
    axes[0].legend(loc="best")
    return png(figure)
