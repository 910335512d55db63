"""Pictures of a search: what the objectives look like around the best designs, and the front."""

from itertools import combinations

import numpy as np
from matplotlib.figure import Figure

from cfem.condensed.parameters import from_shares
from cfem.design.optimisers.front import Front, jumps
from cfem.design.optimisers.search import Design, Grid
from cfem.design.problem import DesignProblem
from cfem.report.style import FAINT, FE, GOAL, INK, LEARNED, outside_legend, plt, png

_FINE, _SHOWN = 41, 3  # points along a parameter; parameters in one picture


def landscape(problem: DesignProblem, index: int, best: Design, verified: float | None, title: str) -> bytes:
    """Picture (PNG) of objective `index` on planes through its best design, of the parameters that it varies most with;
    what breaks a constraint is hatched. With one parameter, a curve."""
    pairs = list(combinations(_matter(problem, index, best), 2))
    if not pairs:
        return _curve(problem, index, best, title)
    figure, axes = plt.subplots(1, len(pairs), figsize=(3.9 * len(pairs) + 0.8, 3.7), squeeze=False)
    shares, maps = np.linspace(0, 1, _FINE), []
    for i, j in pairs:
        z = np.tile(best.z, (_FINE * _FINE, 1))
        z[:, i], z[:, j] = (share.ravel() for share in np.meshgrid(shares, shares))
        maps.append(problem(z))
    values = np.concatenate([scores_of_plane.objectives[:, index] for scores_of_plane in maps])
    levels = np.linspace(values.min(), values.max() + 1e-12, 13)
    for axis, (i, j), scores in zip(axes[0], pairs, maps, strict=True):
        x, y = (_values(problem, k, shares) for k in (i, j))
        filled = axis.contourf(x, y, scores.objectives[:, index].reshape(_FINE, _FINE), levels, cmap="viridis_r")
        if not scores.feasible.all():
            size = np.abs(scores.constraints).max(axis=0)
            tightest = (scores.constraints / np.where(size > 0, size, 1.0)).min(axis=1).reshape(_FINE, _FINE)
            axis.contourf(x, y, tightest, [-2.0, -1e-9], colors="none", hatches=["////"])
        axis.plot(
            *(_values(problem, k, best.z[k : k + 1]) for k in (i, j)),
            "o",
            color=FE,
            markeredgecolor="white",
            markersize=9,
            clip_on=False,
            zorder=5,
        )
        axis.set(xlabel=_label(problem, i), ylabel=_label(problem, j))
        axis.grid(False)
    figure.colorbar(filled, ax=axes[0].tolist(), format="%.4g", shrink=0.9)
    by_fe = "" if verified is None else f", {verified:.5g} by finite elements"
    figure.suptitle(
        f"{title}: best {best.objectives[index]:.5g}{by_fe}", x=0.01, ha="left", weight="bold", fontsize=10.5
    )
    return png(figure)


def _matter(problem: DesignProblem, index: int, best: Design) -> list[int]:
    """Numbers of the parameters along which the objective varies most from the best design on."""
    n = len(problem.free)
    if n <= _SHOWN:
        return list(range(n))
    z = np.tile(best.z, (n, 9, 1))
    z[np.arange(n), :, np.arange(n)] = np.linspace(0, 1, 9)
    spread = np.ptp(problem(z.reshape(-1, n)).objectives[:, index].reshape(n, 9), axis=1)
    return sorted(np.argsort(-spread, kind="stable")[:_SHOWN].tolist())


def _curve(problem: DesignProblem, index: int, best: Design, title: str) -> bytes:
    figure, axis = plt.subplots(figsize=(5, 3.4))
    shares = np.linspace(0, 1, 201)
    scores = problem(shares[:, None])
    axis.plot(_values(problem, 0, shares), scores.objectives[:, index], color=LEARNED[0])
    axis.plot(_values(problem, 0, best.z), best.objectives[index], "o", color=FE)
    axis.set(xlabel=_label(problem, 0), ylabel=title)
    return png(figure)


def front_figure(problem: DesignProblem, grid: Grid, front: Front, verified: dict[int, np.ndarray]) -> bytes:
    """Picture (PNG) of the front among the grid's designs, beside the parameters along it. verified: place in the front
    -> objectives (n_f,) by finite elements."""
    figure, axes = plt.subplots(1, 2, figsize=(10.5, 4.2))
    _trade_off(figure, axes[0], grid, front, verified)
    objectives, z = _along(front)
    for i, parameter in enumerate(problem.parameters):
        axes[1].plot(
            objectives[:, front.indices[0]], z[:, i], ".-", color=LEARNED[i % len(LEARNED)], label=parameter.name
        )
    axes[1].set(xlabel=front.names[0], ylabel="Share of the parameter's range", ylim=(-0.04, 1.04))
    outside_legend(axes[1])
    return png(figure)


def _trade_off(figure: Figure, axis, grid: Grid, front: Front, verified: dict) -> None:
    """Draws the front, the grid behind it and what finite elements say of it."""
    first, second = front.indices[:2]
    objectives = np.array([design.objectives for design in front.designs])
    line = _along(front)[0]
    good = grid.scores.feasible
    cloud = grid.scores.objectives
    axis.plot(cloud[good, first], cloud[good, second], ".", color=GOAL, markersize=3, label=f"grid, {good.sum()}")
    if not good.all():
        axis.plot(cloud[~good, first], cloud[~good, second], "x", color=FAINT, markersize=3, label="breaks constraints")
    style = ".-" if len(front.indices) == 2 else "."
    axis.plot(line[:, first], line[:, second], style, color=LEARNED[0], label="front")
    if verified:
        exact = np.array(list(verified.values()))
        axis.plot(exact[:, first], exact[:, second], "o", color=FE, markerfacecolor="none", label="finite elements")
    for name, place in front.corners.items():
        offset = (-4, -15) if name in ("knee", "before gap") else (6, 6)
        axis.annotate(name, objectives[place, [first, second]], offset, textcoords="offset points", color=INK)
    axis.set(xlabel=front.names[0], ylabel=front.names[1])
    outside_legend(axis)


def _along(front: Front) -> tuple[np.ndarray, np.ndarray]:
    """Objectives (k, n_f) and shares (k, n) in order, a row of nan where the front jumps to other designs."""
    objectives = np.array([design.objectives for design in front.designs])
    z = np.array([design.z for design in front.designs])
    places = jumps(z)
    return np.insert(objectives, places, np.nan, axis=0), np.insert(z, places, np.nan, axis=0)


def _values(problem: DesignProblem, k: int, shares: np.ndarray) -> np.ndarray:
    return from_shares([problem.parameters[k]], shares[:, None])[:, 0]


def _label(problem: DesignProblem, k: int) -> str:
    parameter = problem.parameters[k]
    return f"{parameter.name} ({parameter.unit})" if parameter.suffix else parameter.name
