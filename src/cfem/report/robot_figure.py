"""The robot in 3-D: deformed states along a trajectory, its goals and the curve that it reached."""

import matplotlib.pyplot as plt
import numpy as np

from cfem.report.render import Body, Camera, Frame, draw, flat_triangles
from cfem.report.style import FAINT, INK, png

REST = np.array([0.82, 0.84, 0.86])
OBJECT = np.array([0.88, 0.66, 0.35])  # what robots hold


def robot_figure(
    X: np.ndarray,
    facets: np.ndarray,
    states: np.ndarray,
    goals: np.ndarray,
    reached: np.ndarray,
    title: str,
    object_points: int = 0,
) -> bytes:
    """X (n, 3) rest, states (k, n, 3) deformed, goals and reached (m, 3), all mm. The rest state is grey, the
    others go from light to deep blue in the order of the trajectory, the last one solid. The last `object_points` of
    the nodes are those of what the robot holds, which is drawn at the end, in its own colour."""
    triangles = flat_triangles(facets)
    shades = plt.get_cmap("YlGnBu")(np.linspace(0.45, 0.75, max(len(states), 1)))[:, :3]
    camera = _aside(reached)
    frame = Frame.around(np.concatenate([X[None], states]), camera)
    layers = [(X, REST, 0.45)]
    # Ghosts up to the last state, which is solid: bodies that overlap in space would hide one another in pieces.
    layers += [(x, shade, 0.4) for x, shade in zip(states[:-1], shades[:-1], strict=True)]
    last = states[-1] if len(states) else X
    layers += [(last, shades[-1], 1.0)] if len(states) else []
    extent = (*frame.low[:1], *frame.high[:1], *frame.low[1:], *frame.high[1:])
    flat_goals, flat_reached = camera.project(goals)[:, :2], camera.project(reached)[:, :2]
    everything = np.vstack([flat_goals, [[extent[0], extent[2]], [extent[1], extent[3]]]])
    low, high = everything.min(axis=0) - 4, everything.max(axis=0) + 4
    figure, axis = plt.subplots(figsize=7.2 * (high - low) / (high - low).max() + [0.0, 0.5])
    for x, colour, alpha in layers:
        held = (triangles >= len(X) - object_points).all(axis=1)
        colours = np.where(held[:, None], OBJECT, colour)
        shown = ~held | (x is last)  # one object: its moves are small beside it
        image, place = draw(Body(x, triangles[shown], colours[shown]), camera, frame)
        axis.imshow(image, extent=place, origin="lower", interpolation="antialiased", zorder=1, alpha=alpha)
    axis.plot(*flat_goals.T, "o", ms=4.5, mfc="white", mec=INK, mew=1.1, zorder=3, label="goals")
    axis.plot(*flat_reached.T, color="#d1432b", lw=2.2, zorder=3, label="reached")
    axis.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal", title=title)
    _scale_bar(axis, low, high)
    axis.axis("off")
    axis.legend(loc="upper right")
    return png(figure)


def _aside(reached: np.ndarray) -> Camera:
    """From aside of the direction in which the effector (m, 3) moves most, lifted; turned more where it moves
    across."""
    x, y = np.ptp(reached[:, :2], axis=0)
    if y < x:
        return Camera.looking(-65.0, 14.0)
    return Camera.looking(22.0 if x < 0.1 * y else 48.0, 14.0)


def _scale_bar(axis, low: np.ndarray, high: np.ndarray) -> None:
    size = float(10 ** np.floor(np.log10((high - low)[0] / 3)))
    size *= max(k for k in (1, 2, 5) if k * size <= (high - low)[0] / 3)
    x, y = low[0] + 4, low[1] + 4
    axis.plot([x, x + size], [y, y], color=FAINT, lw=3, solid_capstyle="butt")
    axis.text(x + size / 2, y + 0.012 * (high - low)[1], f"{size:g} mm", ha="center", va="bottom", color=INK)
