"""The fit beside what was measured, and the way of every start."""

import numpy as np

from cfem.calibrate.calibration import Calibration
from cfem.condensed.parameters import shares
from cfem.report.style import FE, INK, LEARNED, grid, outside_legend, png


def calibration_figure(found: Calibration) -> bytes:
    """PNG: one panel for each kind of measured number, then what is left, then the course of every start."""
    kinds = _kinds(found)
    figure, axes = grid(len(kinds) + 1 + bool(found.fits), columns=3, height=3.3)
    for axis, (title, unit, names) in zip(axes, kinds, strict=False):
        _fit(axis, found, title, unit, names)
    _left(axes[len(kinds)], found, kinds)
    if found.fits:
        _course(axes[-1], found)
    return png(figure)


def _kinds(found: Calibration) -> list[tuple[str, str, list[str]]]:
    """(title, unit, names) of the panels."""
    names = list(dict.fromkeys(name for _, name in found.problem.labels))
    forces = [name for name in names if name.endswith(".force")]
    others = [name for name in names if name not in forces]
    panels = [("Positions and displacements", "mm", others), ("Forces", "N", forces)]
    return [panel for panel in panels if panel[2]]


def _amount(found: Calibration) -> tuple[np.ndarray, str]:
    """(m,) how far each state is driven, for the x axis: the largest of its actuators."""
    measured, rows = found.problem.measured, found.problem.family.rows
    unit = "mm" if measured.kind == "displacement" else "N"
    who = rows.actuators[0] if rows.n_a == 1 else "largest of the actuators"
    return np.abs(measured.u).max(axis=1), f"{who}: {measured.kind} ({unit})"


def _numbers(found: Calibration, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of the residuals of one name, and of their states."""
    picked = np.array([i for i, (_, label) in enumerate(found.problem.labels) if label == name])
    return picked, np.array([found.problem.labels[i][0] for i in picked])


def _fit(axis, found: Calibration, title: str, unit: str, names: list[str]) -> None:
    amount, label = _amount(found)
    for index, name in enumerate(names):
        picked, states = _numbers(found, name)
        order = np.argsort(amount[states], kind="stable")
        x, measured = amount[states][order], found.problem.target[picked][order]
        computed = measured + found.residuals[picked][order]
        colour = LEARNED[index % len(LEARNED)]
        axis.plot(x, computed, color=colour, label=name)
        axis.plot(x, measured, "o", color=colour, markerfacecolor="white", markersize=5)
    axis.plot([], [], "o", color=INK, markerfacecolor="white", markersize=5, label="measured")
    axis.set(xlabel=label, ylabel=f"{title} ({unit})")
    outside_legend(axis, 2)


def _left(axis, found: Calibration, kinds: list) -> None:
    amount, label = _amount(found)
    in_noise = found.residuals / found.problem.sigma
    stated = found.problem.noise.known
    values = in_noise if stated else found.residuals
    for (title, _, names), mark in zip(kinds, "os", strict=False):
        for index, name in enumerate(names):
            picked, states = _numbers(found, name)
            colour = LEARNED[index % len(LEARNED)]
            axis.plot(amount[states], values[picked], mark, color=colour, markersize=4, label=None)
        axis.plot([], [], mark, color=INK, markersize=4, label=title.split()[0].lower())
    axis.axhline(0, color=INK, linewidth=0.8)
    if stated:
        axis.axhspan(-2, 2, color=FE, alpha=0.12, linewidth=0, label="twice the noise")
    axis.set(xlabel=label, ylabel="Computed less measured " + ("(noise = 1)" if stated else "(mm, N)"))
    outside_legend(axis, 3)


def _course(axis, found: Calibration) -> None:
    """Distance of every parameter from where it ends, by evaluation."""
    problem = found.problem
    end = shares(problem.parameters, found.p[list(problem.free)])
    styles = ("-", "--", ":", "-.")
    for number, one in enumerate(found.fits):
        away = np.maximum(np.abs(one.history - end), 1e-16)
        for i, parameter in enumerate(problem.parameters):
            label = parameter.name if number == 0 and len(problem.parameters) > 1 else None
            colour = LEARNED[number % len(LEARNED)]
            axis.semilogy(away[:, i], styles[i % 4], color=colour, marker=".", linewidth=1.1, label=label)
    axis.set(xlabel="Evaluation", ylabel="Distance from the answer (share of range)")
    axis.set_title(f"{len(found.fits)} start{'s' * (len(found.fits) > 1)}")
    if len(problem.parameters) > 1:
        axis.legend()
