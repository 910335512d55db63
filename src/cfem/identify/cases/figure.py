"""Measured and computed shapes side by side."""

import numpy as np
from matplotlib.collections import PolyCollection

from cfem.identify.cases.robots import Pose
from cfem.identify.cases.table import Cases
from cfem.mechanics.mesh import Mesh
from cfem.report.style import FE, GRID, INK, LEARNED, plt, png

_LARGEST = 20  # cases that are drawn
_COLUMNS = 5
_BODY = "#c3cbd3"


def shapes_figure(
    cases: Cases,
    poses: tuple[Pose | None, ...],
    computed: np.ndarray,
    half: np.ndarray,
    confidence: float,
    mesh: Mesh,
    title: str,
    gravity: np.ndarray | None = None,
) -> bytes:
    """Picture (PNG) of two views of each case, gravity down.

    poses:    of the robot, None where there is no equilibrium
    computed: (m, k, 3) mm places or displacements
    half:     (m, k, 3) mm of the intervals of this confidence
    mesh:     of the robot at rest
    gravity:  (3,) its direction, None without"""
    count = min(len(cases), _LARGEST)
    if count < len(cases):
        title += f" (the first {count} of {len(cases)})"
    columns, views = min(count, _COLUMNS), _views(mesh.X, gravity)
    bands = -(-count // columns)
    start = 0.0 if cases.rest is None else cases.rest
    measured, computed = cases.target + start, computed + start
    width = 2.6 if views[0][1] == views[1][1] else 3.6
    figure, axes = plt.subplots(2 * bands, columns, figsize=(width * columns, 2.9 * 2 * bands), squeeze=False)
    for ax in axes.ravel():
        ax.set_visible(False)
    for i in range(count):
        for row, (across, up, sign) in enumerate(views):
            ax = axes[2 * (i // columns) + row, i % columns]
            ax.set_visible(True)
            _body(ax, mesh.X, mesh, (across, up, sign), GRID)
            if poses[i] is not None:
                _body(ax, poses[i].nodes, mesh, (across, up, sign), _BODY)
            ax.errorbar(
                computed[i, :, across], sign * computed[i, :, up], half[i, :, up], half[i, :, across], "x", color=FE,
                markersize=6, elinewidth=1, zorder=3, label=f"computed, with {100 * confidence:g} % intervals",
            )  # fmt: skip
            ax.plot(
                measured[i, :, across], sign * measured[i, :, up], "o", color=LEARNED[0], markersize=5, zorder=2,
                label="measured",
            )  # fmt: skip
            ax.set_aspect("equal", adjustable="datalim")
            ax.set_title(cases.names[i] if row == 0 else "", fontsize=10)
            ax.set_xlabel(f"{'xyz'[across]} (mm)", color=INK)
            ax.set_ylabel(f"{'' if sign > 0 else '-'}{'xyz'[up]} (mm)" if i % columns == 0 else "", color=INK)
    figure.suptitle(title, fontsize=11, x=0.01, ha="left")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    handles.append(plt.Rectangle((0, 0), 1, 1, color=GRID))
    figure.legend(handles, [*labels, "before the load"], loc="outside lower center", ncols=3)
    return png(figure)


def _views(X: np.ndarray, gravity: np.ndarray | None) -> list[tuple[int, int, float]]:
    """Axis to the right, axis up and its sign, of each of the two views."""
    along = int(np.ptp(X, axis=0).argmax())
    across = [axis for axis in (2, 1, 0) if axis != along]
    down = along if gravity is None or not np.any(gravity) else int(np.abs(gravity).argmax())
    if down == along:
        sign = -1.0 if gravity is None or not np.any(gravity) else -float(np.sign(gravity[along]))
        return [(axis, along, sign) for axis in across]
    third = next(axis for axis in across if axis != down)
    return [(along, down, -float(np.sign(gravity[down]))), (along, third, 1.0)]


def _body(ax, x: np.ndarray, mesh: Mesh, view: tuple[int, int, float], colour: str) -> None:
    across, up, sign = view
    corners = {3: 3, 6: 3, 4: 4}[mesh.facets.shape[1]]
    flat = x[mesh.facets[:, :corners]][:, :, [across, up]] * [1.0, sign]
    ax.add_collection(PolyCollection(flat, facecolors=colour, edgecolors=colour, linewidths=0.5, zorder=1))
