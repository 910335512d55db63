"""The curves with the laws that were tried, what is left, and what the chosen law says of tests that nobody made."""

from collections.abc import Sequence

import numpy as np

from cfem.identify.material.choose import Candidate
from cfem.identify.material.curve import Curve
from cfem.identify.material.forms import MODES, nominal_stress
from cfem.report.style import FAINT, INK, LEARNED, grid, outside_legend, png


def fit_figure(curves: Sequence[Curve], tried: Sequence[Candidate], chosen: Candidate) -> bytes:
    """Picture (PNG) of a fit, in three panels."""
    figure, axes = grid(3, height=3.6)
    _draw_curves(axes[0], curves, tried, chosen)
    _draw_errors(axes[1], curves, tried, chosen)
    _draw_modes(axes[2], curves, chosen)
    return png(figure)


def _scale(curves: Sequence[Curve]) -> tuple[float, str]:
    return (1e3, "kPa") if max(np.abs(curve.stress).max() for curve in curves) < 1 else (1.0, "MPa")


def _draw_curves(axis, curves: Sequence[Curve], tried: Sequence[Candidate], chosen: Candidate) -> None:
    """Measured points, and every law that was tried."""
    factor, unit = _scale(curves)
    for index, curve in enumerate(curves):
        measured = {"color": INK, "markerfacecolor": "white", "markersize": 4, "label": None if index else "measured"}
        axis.plot(curve.stretch, factor * curve.stress, "o", **measured)
        for order, law in enumerate(sorted(tried, key=lambda item: item is chosen)):
            best = law is chosen
            style = {"color": LEARNED[0], "linewidth": 2} if best else {"color": FAINT, "linewidth": 0.8}
            name = law.fit.form.name if best else "others tried" if order == 0 else None
            axis.plot(curve.stretch, factor * law.fit.predict(curve), label=name if index == 0 else None, **style)
    axis.set(xlabel="stretch", ylabel=f"Nominal stress ({unit})")
    outside_legend(axis, 3)


def _draw_errors(axis, curves: Sequence[Curve], tried: Sequence[Candidate], chosen: Candidate) -> None:
    """Errors on unseen and on fitted points, by law."""
    factor, unit = _scale(curves)
    ordered = sorted(tried, key=lambda item: item.held_out)
    names = [law.fit.form.name for law in ordered]
    y = np.arange(len(ordered))
    colours = [LEARNED[0] if law is chosen else FAINT for law in ordered]
    axis.barh(y, [factor * law.held_out for law in ordered], color=colours, height=0.6)
    axis.plot([factor * law.fit.rms for law in ordered], y, "|", color=INK, markersize=12, label="on the fitted points")
    axis.set(xlabel=f"rms error on unseen points ({unit})")
    axis.set_yticks(y, names)
    axis.invert_yaxis()
    outside_legend(axis, 1)


def _draw_modes(axis, curves: Sequence[Curve], chosen: Candidate) -> None:
    """Stress of the chosen law in tension of every mode, dotted where it is not stable."""
    factor, unit = _scale(curves)
    fit, measured = chosen.fit, {curve.mode for curve in curves}
    for colour, mode in zip(LEARNED, MODES, strict=False):
        stretch = np.linspace(1.0, fit.most, 121)
        stress = factor * nominal_stress(fit.form, fit.alpha, mode, stretch) @ fit.moduli
        stable = stretch <= fit.stable[mode] * (1 + 1e-9)
        known = "" if mode in measured else ", not measured"
        axis.plot(stretch[stable], stress[stable], color=colour, label=mode + known)
        axis.plot(stretch[~stable], stress[~stable], ":", color=colour)
    axis.set(xlabel="stretch", ylabel=f"Nominal stress ({unit})")
    outside_legend(axis, 1)
