"""Measured and computed shapes side by side."""

import numpy as np

from cfem.cases.robots import Posed
from cfem.cases.table import Cases
from cfem.mechanics.mesh import Mesh
from cfem.report.style import FAINT, FE, INK, LEARNED, plt, png

_LARGEST = 12  # cases that are drawn


def shapes_figure(
    cases: Cases, posed: tuple[Posed, ...], computed: np.ndarray, half: np.ndarray, mesh: Mesh, title: str
) -> bytes:
    """PNG: a column a case, seen along y and along z; computed (m, k, 3) mm places or displacements; half (m, k, 3) mm
    of the intervals."""
    count = min(len(cases), _LARGEST)
    figure, axes = plt.subplots(2, count, figsize=(2.5 * count + 1, 5.6), squeeze=False, sharex="row", sharey=True)
    start = 0.0 if cases.rest is None else cases.rest
    measured, found = cases.target + start, computed + start
    surface = np.unique(mesh.facets)
    for i in range(count):
        for row, (axis, name) in enumerate(((2, "z"), (1, "y"))):
            ax = axes[row, i]
            nodes = posed[i].nodes[surface]
            ax.plot(nodes[:, axis], -nodes[:, 0], ".", color=FAINT, markersize=1.5, zorder=1)
            ax.errorbar(
                found[i, :, axis], -found[i, :, 0], half[i, :, 0], half[i, :, axis], "x", color=FE, markersize=6,
                elinewidth=0.7, zorder=2, label="computed, with 95 % intervals",
            )  # fmt: skip
            ax.plot(measured[i, :, axis], -measured[i, :, 0], "o", color=LEARNED[0], markersize=4.5, label="measured")
            ax.set_aspect("equal", adjustable="box")
            if row == 0:
                ax.set_title(cases.names[i], fontsize=9)
            ax.set_xlabel(f"{name} (mm)", color=INK)
            if i == 0:
                ax.set_ylabel("-x (mm)", color=INK)
    figure.suptitle(title, fontsize=10.5, x=0.01, ha="left")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2)
    return png(figure)
