"""The fit beside what was measured, and the way of every start."""

import numpy as np

from cfem.condensed.parameters import shares
from cfem.identify.robot.calibration import Calibration
from cfem.report.style import FE, INK, LEARNED, grid, outside_legend, png

_Panel = tuple[str, str, list[str]]  # title, unit, names of its residuals


def calibration_figure(calibration: Calibration) -> bytes:
    """Picture (PNG): one panel for each kind of measured number, then the residuals, then the course of every start."""
    panels = _panels(calibration)
    figure, axes = grid(len(panels) + 1 + bool(calibration.fits), columns=3, height=3.3)
    for axis, panel in zip(axes, panels, strict=False):
        _draw_fit(axis, calibration, panel)
    _draw_residuals(axes[len(panels)], calibration, panels)
    if calibration.fits:
        _draw_course(axes[-1], calibration)
    return png(figure)


def _panels(calibration: Calibration) -> list[_Panel]:
    names = calibration.problem.names
    forces = [name for name in names if name.endswith(".force")]
    lengths = [name for name in names if name not in forces]
    panels = [("Positions and displacements", "mm", lengths), ("Forces", "N", forces)]
    return [panel for panel in panels if panel[2]]


def _amount(calibration: Calibration) -> tuple[np.ndarray, str]:
    """Actuation (m,) of each state, for the x axis: the largest of its actuators; and the axis' label."""
    measured, rows = calibration.problem.measured, calibration.problem.family.rows
    unit = "mm" if measured.kind == "displacement" else "N"
    actuator = rows.actuators[0] if rows.n_a == 1 else "largest of the actuators"
    return np.abs(measured.u).max(axis=1), f"{actuator}: {measured.kind} ({unit})"


def _states(calibration: Calibration, numbers: np.ndarray) -> np.ndarray:
    """States of the residuals of these numbers."""
    return np.array([calibration.problem.labels[i][0] for i in numbers])


def _draw_fit(axis, calibration: Calibration, panel: _Panel) -> None:
    """Measured numbers as circles, computed ones as lines, over how far the state is driven."""
    (title, unit, names), (amount, label) = panel, _amount(calibration)
    for index, name in enumerate(names):
        numbers = calibration.problem.numbers_of(name)
        x = amount[_states(calibration, numbers)]
        order = np.argsort(x, kind="stable")
        x, measured = x[order], calibration.problem.target[numbers][order]
        computed = measured + calibration.residuals[numbers][order]
        colour = LEARNED[index % len(LEARNED)]
        axis.plot(x, computed, color=colour, label=name)
        axis.plot(x, measured, "o", color=colour, markerfacecolor="white", markersize=5)
    axis.plot([], [], "o", color=INK, markerfacecolor="white", markersize=5, label="measured")
    axis.set(xlabel=label, ylabel=f"{title} ({unit})")
    outside_legend(axis, 2)


def _draw_residuals(axis, calibration: Calibration, panels: list[_Panel]) -> None:
    """Draws the residuals, in units of the noise where it was stated."""
    amount, label = _amount(calibration)
    stated = calibration.problem.noise.known
    residuals = calibration.residuals / calibration.problem.sigma if stated else calibration.residuals
    for (title, _, names), mark in zip(panels, "os", strict=False):
        for index, name in enumerate(names):
            numbers = calibration.problem.numbers_of(name)
            colour = LEARNED[index % len(LEARNED)]
            axis.plot(amount[_states(calibration, numbers)], residuals[numbers], mark, color=colour, markersize=4)
        axis.plot([], [], mark, color=INK, markersize=4, label=title.split()[0].lower())
    axis.axhline(0, color=INK, linewidth=0.8)
    if stated:
        axis.axhspan(-2, 2, color=FE, alpha=0.12, linewidth=0, label="twice the noise")
    axis.set(xlabel=label, ylabel="Computed less measured " + ("(noise = 1)" if stated else "(mm, N)"))
    outside_legend(axis, 3)


def _draw_course(axis, calibration: Calibration) -> None:
    """Distance of every parameter from where it ends, by evaluation."""
    problem = calibration.problem
    end = shares(problem.parameters, calibration.p[list(problem.free)])
    styles = ("-", "--", ":", "-.")
    for number, fit in enumerate(calibration.fits):
        distance = np.maximum(np.abs(fit.history - end), 1e-16)
        for i, parameter in enumerate(problem.parameters):
            label = parameter.name if number == 0 and len(problem.parameters) > 1 else None
            colour = LEARNED[number % len(LEARNED)]
            axis.semilogy(distance[:, i], styles[i % 4], color=colour, marker=".", linewidth=1.1, label=label)
    axis.set(xlabel="Evaluation", ylabel="Distance from the answer (share of range)")
    axis.set_title(f"{len(calibration.fits)} start{'s' * (len(calibration.fits) > 1)}")
    if len(problem.parameters) > 1:
        axis.legend()
