"""One picture of a robot in an environment: its surface, the effector's place and its goal. Needs matplotlib."""

from typing import Any

import numpy as np

from cfem.core.errors import InputError
from cfem.core.optional import demand
from cfem.predict.protocol import Predictor

_PIXELS, _DPI = 480, 100
_BODY, _TIP, _GOAL = "#9fb6cd", "#c1272d", "#1a7f37"


def picture(model: Predictor, delta_a: np.ndarray, x_e: np.ndarray, goal: np.ndarray) -> np.ndarray:
    """Picture (480, 480, 3) uint8 of the robot with its actuators at delta_a (n_a,), mm.

    x_e, goal: (n_e,) mm, places of the effectors (red) and their goals (green), of which the first three rows are
    drawn. The surface is drawn where it rests at delta_a, if the model has learned one; a model without a skin shows
    the dots alone. InputError where the first effector has fewer than three coordinates."""
    demand("matplotlib", where="cfem.gym")
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    if [name.rpartition(".")[2] for name in model.rows.effectors[:3]] != ["x", "y", "z"]:
        raise InputError("a picture needs an effector with x, y and z", where="cfem.gym.render")
    figure = Figure(figsize=(_PIXELS / _DPI,) * 2, dpi=_DPI, layout="none")
    canvas, axes = FigureCanvasAgg(figure), figure.add_axes((0, 0, 1, 1), projection="3d")
    points = np.stack([x_e[:3], goal[:3], model.rest_e[:3]])
    surface = _surface(model, delta_a)
    if surface is not None:
        shape, triangles = surface
        axes.add_collection3d(
            Poly3DCollection(shape[triangles], facecolors=_BODY, edgecolors=_BODY, linewidths=0.3, shade=True)
        )
        points = np.concatenate([points, shape, model.shape(np.zeros_like(delta_a))])
    for place, colour in ((x_e, _TIP), (goal, _GOAL)):
        axes.plot(*place[:3, None], "o", color=colour, markersize=7, zorder=10)
    middle, half = (points.max(axis=0) + points.min(axis=0)) / 2, 0.55 * float(np.ptp(points, axis=0).max()) + 1e-9
    axes.set(**{f"{axis}lim": (middle[i] - half, middle[i] + half) for i, axis in enumerate("xyz")})
    axes.set_box_aspect((1, 1, 1), zoom=1.6)
    axes.set_axis_off()
    axes.computed_zorder = False
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()


def _surface(model: Predictor, delta_a: np.ndarray) -> tuple[Any, Any] | None:
    """Nodes (m, 3) mm and triangles (t, 3), None where the model has learned no surface."""
    try:
        return model.shape(delta_a), model.facets
    except InputError:
        return None
