"""The curves with the laws that were tried, what is left, and what the chosen law says of tests that nobody made."""

from collections.abc import Sequence

import numpy as np

from cfem.report.style import FAINT, INK, LEARNED, grid, outside_legend, png
from cfem.tensile.choose import Candidate
from cfem.tensile.curve import Curve
from cfem.tensile.forms import MODES, nominal_stress


def fit_figure(curves: Sequence[Curve], tried: Sequence[Candidate], chosen: Candidate) -> bytes:
    """PNG of three panels."""
    figure, axes = grid(3, height=3.6)
    _curves(axes[0], curves, tried, chosen)
    _left(axes[1], curves, tried, chosen)
    _modes(axes[2], curves, chosen)
    return png(figure)


def _scale(curves: Sequence[Curve]) -> tuple[float, str]:
    return (1e3, "kPa") if max(np.abs(one.stress).max() for one in curves) < 1 else (1.0, "MPa")


def _curves(axis, curves: Sequence[Curve], tried: Sequence[Candidate], chosen: Candidate) -> None:
    factor, unit = _scale(curves)
    for index, one in enumerate(curves):
        label = "measured" if index == 0 else None
        axis.plot(one.stretch, factor * one.stress, "o", color=INK, markerfacecolor="white", markersize=4, label=label)
        for order, each in enumerate(sorted(tried, key=lambda item: item is chosen)):
            best = each is chosen
            style = {"color": LEARNED[0], "linewidth": 2} if best else {"color": FAINT, "linewidth": 0.8}
            name = each.fit.form.name if best else "others tried" if order == 0 else None
            axis.plot(one.stretch, factor * each.fit.predict(one), label=name if index == 0 else None, **style)
    axis.set(xlabel="stretch", ylabel=f"Nominal stress ({unit})")
    outside_legend(axis, 3)


def _left(axis, curves: Sequence[Curve], tried: Sequence[Candidate], chosen: Candidate) -> None:
    factor, unit = _scale(curves)
    ordered = sorted(tried, key=lambda item: item.held_out)
    names = [each.fit.form.name for each in ordered]
    y = np.arange(len(ordered))
    colours = [LEARNED[0] if each is chosen else FAINT for each in ordered]
    axis.barh(y, [factor * each.held_out for each in ordered], color=colours, height=0.6)
    axis.plot(
        [factor * each.fit.rms for each in ordered], y, "|", color=INK, markersize=12, label="on the fitted points"
    )
    axis.set(xlabel=f"rms error on unseen points ({unit})")
    axis.set_yticks(y, names)
    axis.invert_yaxis()
    outside_legend(axis, 1)


def _modes(axis, curves: Sequence[Curve], chosen: Candidate) -> None:
    factor, unit = _scale(curves)
    fit, measured = chosen.fit, {one.mode for one in curves}
    most = max(max(one.stretch.max(), 1 / one.stretch.min()) for one in curves)
    for colour, mode in zip(LEARNED, MODES, strict=False):
        stretch = np.linspace(1.0, most, 121)
        stress = factor * nominal_stress(fit.form, fit.alpha, mode, stretch) @ fit.moduli
        stable = stretch <= fit.stable[mode] * (1 + 1e-9)
        known = "" if mode in measured else ", not measured"
        axis.plot(stretch[stable], stress[stable], color=colour, label=mode + known)
        axis.plot(stretch[~stable], stress[~stable], ":", color=colour)
    axis.set(xlabel="stretch", ylabel=f"Nominal stress ({unit})")
    outside_legend(axis, 1)
