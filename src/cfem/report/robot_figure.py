"""The robot in 3-D: deformed states along a trajectory, its goals and the curve that it reached."""

import matplotlib.pyplot as plt
import numpy as np

from cfem.report.render import Body, Camera, draw, flat_triangles
from cfem.report.style import FAINT, INK, png

REST = np.array([0.82, 0.84, 0.86])


def robot_figure(
    X: np.ndarray, facets: np.ndarray, states: np.ndarray, goals: np.ndarray, reached: np.ndarray, title: str
) -> bytes:
    """X (n, 3) rest, states (k, n, 3) deformed, goals and reached (m, 3), all mm. The rest state is grey, the
    others go from light to deep blue in the order of the trajectory."""
    triangles = flat_triangles(facets)
    shades = plt.get_cmap("YlGnBu")(np.linspace(0.35, 0.85, max(len(states), 1)))[:, :3]
    bodies = [Body(X, triangles, REST)]
    bodies += [Body(x, triangles, shade) for x, shade in zip(states, shades, strict=True)]
    camera = _side_on(X, states)
    image, extent = draw(bodies, camera)
    figure, axis = plt.subplots(figsize=(7.2, 7.2))
    axis.imshow(image, extent=extent, origin="lower", interpolation="antialiased", zorder=1)
    for points, look in (
        (goals, {"marker": "o", "ms": 4.5, "mfc": "white", "mec": INK, "mew": 1.1, "ls": "", "label": "goals"}),
        (reached, {"color": "#d1432b", "lw": 2.2, "label": "reached"}),
    ):
        flat = camera.project(points)
        axis.plot(flat[:, 0], flat[:, 1], zorder=3, **look)
    everything = np.vstack([camera.project(goals)[:, :2], [[extent[0], extent[2]], [extent[1], extent[3]]]])
    low, high = everything.min(axis=0) - 4, everything.max(axis=0) + 4
    axis.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal", title=title)
    _scale_bar(axis, low, high)
    axis.axis("off")
    axis.title.set_visible(True)
    axis.legend(loc="upper right")
    return png(figure)


def _side_on(X: np.ndarray, states: np.ndarray) -> Camera:
    """From aside of the plane in which the robot moves most, a little turned and lifted, so that it has
    depth."""
    moved = np.ptp(np.concatenate([X[None], states]), axis=0).max(axis=0)
    return Camera.looking(25.0, 14.0) if moved[1] >= moved[0] else Camera.looking(-65.0, 14.0)


def _scale_bar(axis, low: np.ndarray, high: np.ndarray) -> None:
    size = float(10 ** np.floor(np.log10((high - low)[0] / 3)))
    size *= max(k for k in (1, 2, 5) if k * size <= (high - low)[0] / 3)
    x, y = low[0] + 4, low[1] + 4
    axis.plot([x, x + size], [y, y], color=FAINT, lw=3, solid_capstyle="butt")
    axis.text(x + size / 2, y + 0.012 * (high - low)[1], f"{size:g} mm", ha="center", va="bottom", color=INK)
