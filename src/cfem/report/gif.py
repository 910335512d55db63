"""A run as a GIF and as a picture for a paper: the body drawn as in the report, from one place."""

import io
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from PIL import Image

from cfem.report.style import FE, GROUND, INK
from cfem.report.viewer import COLOURS, HOT, Take, Viewer, camera_axes, painted

WIDTH, LEAST, MOST = 400, 200, 540  # pixels: the width, and bounds of the height
COLOURS_KEPT = 64
SHARP = 6  # times as many pixels along each side: a picture 10 cm wide has 600 dots per inch
_DPI = 100
_PALE = 0.35  # of a colour, the rest white


def gif(viewer: Viewer, take: Take, milliseconds: Sequence[int]) -> bytes:
    """Moving picture (GIF) of the shapes of a take; milliseconds: (f,) that each is shown. The same shapes give the
    same bytes."""
    frames = [Image.fromarray(pixels) for pixels in _drawn(viewer, take)]
    samples = np.hstack([np.asarray(frames[i]) for i in sorted({0, len(frames) // 3, 2 * len(frames) // 3})])
    palette = _with_ground(Image.fromarray(samples).quantize(COLOURS_KEPT, dither=Image.Dither.NONE))
    small = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    buffer = io.BytesIO()
    how = {"save_all": True, "append_images": small[1:], "duration": list(milliseconds), "loop": 0, "optimize": True}
    small[0].save(buffer, format="GIF", **how)
    return buffer.getvalue()


def _with_ground(palette: Image.Image) -> Image.Image:
    """Palette whose colours near to the ground are the ground's own, which a mean with others would tint."""
    colours = np.array(palette.getpalette()).reshape(-1, 3)
    ground = np.array(to_rgb(GROUND)) * 255
    away = np.abs(colours - ground).sum(axis=1)
    colours[away <= max(30, away.min())] = ground
    palette.putpalette(colours.ravel().tolist())
    return palette


def still(viewer: Viewer, take: Take, rest: np.ndarray) -> bytes:
    """A PNG of 2400 pixels' width: the shape farthest from rest (m, 3), that at rest in pale colours, the goals and the
    whole path of the effector."""
    used = np.unique(viewer.triangles)
    place = int(np.linalg.norm(take.x[:, used] - rest[used], axis=2).max(axis=1).argmax())
    axis, canvas, axes = _stage(viewer, take, rest, SHARP)
    pale = 1 - _PALE * (1 - COLOURS[viewer.kinds])
    axis.add_collection(painted(rest, viewer.triangles, pale, axes), autolim=False)
    path = (take.reached @ axes.T).T[:2]
    axis.plot(*path, color=HOT, lw=1.2, alpha=0.6, zorder=6)
    buffer = io.BytesIO()
    Image.fromarray(_frame(axis, canvas, viewer, take, axes, place)).save(buffer, format="PNG", dpi=(600, 600))
    return buffer.getvalue()


def _drawn(viewer: Viewer, take: Take) -> list[np.ndarray]:
    """Pixels (height, width, 3) of each shape."""
    axis, canvas, axes = _stage(viewer, take)
    return [_frame(axis, canvas, viewer, take, axes, place) for place in range(len(take.x))]


def _stage(
    viewer: Viewer, take: Take, rest: np.ndarray | None = None, finer: int = 1
) -> tuple[Axes, FigureCanvasAgg, np.ndarray]:
    """Axes with the goals that have room for all shapes, and for that at rest (m, 3) if given, their canvas, and the
    camera's axes (3, 3); finer: times as many pixels along each side."""
    axes, used = camera_axes(*viewer.camera), np.unique(viewer.triangles)
    everything = [take.x[:, used], take.goals, take.reached, *(line.frames for line in take.lines)]
    everything += [] if rest is None else [rest[used]]
    flat = np.concatenate([points.reshape(-1, 3) for points in everything]) @ axes.T
    low, high = np.nanmin(flat, axis=0)[:2], np.nanmax(flat, axis=0)[:2]
    width, height = np.maximum(high - low, 1e-9) + 0.1 * (high - low).max()
    pixels = np.array([WIDTH, int(np.clip(WIDTH * height / width, LEAST, MOST)) // 2 * 2])
    half = pixels * max(width / pixels[0], height / pixels[1]) / 2
    figure = Figure(figsize=pixels / _DPI, dpi=finer * _DPI, facecolor=GROUND, layout="none")
    canvas, axis = FigureCanvasAgg(figure), figure.add_axes((0, 0, 1, 1))
    axis.set(
        xlim=(low + high)[0] / 2 + half[0] * np.array([-1, 1]), ylim=(low + high)[1] / 2 + half[1] * np.array([-1, 1])
    )
    axis.axis("off")
    if len(take.goals):
        axis.plot(*(take.goals @ axes.T).T[:2], "o", ms=4.5, mfc=GROUND, mec=INK, zorder=3)
    return axis, canvas, axes


def _frame(axis: Axes, canvas: FigureCanvasAgg, viewer: Viewer, take: Take, axes: np.ndarray, place: int) -> np.ndarray:
    """Pixels of a shape of the take."""
    body: PolyCollection = painted(take.x[place], viewer.triangles, COLOURS[viewer.kinds], axes)
    drawn = [axis.add_collection(body, autolim=False)]
    for line in take.lines:
        colour = FE if line.colour == "--fe" else line.colour.replace("--c", "C")
        points = line.frames[min(place, len(line.frames) - 1)] @ axes.T
        drawn += axis.plot(*points.T[:2], color=GROUND, lw=4, zorder=4)
        drawn += axis.plot(*points.T[:2], "o-", color=colour, lw=2, ms=4, mfc=colour, mec=GROUND, mew=0.6, zorder=5)
    row = int(take.index[place])
    if len(take.reached):
        path = take.reached[: row + 1] @ axes.T
        drawn += axis.plot(*path.T[:2], color=HOT, lw=2, zorder=6)
        drawn += axis.plot(*path[-1:].T[:2], "o", color=HOT, ms=8, mec=GROUND, zorder=7)
    canvas.draw()
    pixels = np.asarray(canvas.buffer_rgba())[..., :3].copy()
    for artist in drawn:
        artist.remove()
    return pixels
