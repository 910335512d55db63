"""Robots that the reader plays, scrubs and turns, by player.js; and a still picture of each for those without scripts.

The data is JSON inside the page, lengths in mm, arrays little-endian in base64:
  triangles  uint32, three points each, outward; kinds: uint8 per triangle, 0 body, 1 held, 2 object
  again      uint32, nodes on sharp edges: they are the points behind the last node, for a normal on each side
  origin, step   a position is origin + step * (its three numbers in `frames`)
  camera     azimuth and elevation in degrees: azimuth 0 looks from +x with y to the right; pale: body in grey
  takes      name; count, frames: int16, `count` shapes of all nodes; index: the goal of each shape; closed: the last
             shape leads back to the first; goals, reached: points; errors: mm (the last two null where the robot
             failed); lines: name, colour, frames of points; marks: point and colour"""

import base64
import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from html import escape
from typing import Any

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from cfem.constraint.surface import triangulated
from cfem.contact.surface.triangles import normals_of
from cfem.core.artefact.files import finite
from cfem.report.style import FE, GROUND, INK, png
from cfem.viewer.surface import sharpened

BODY, HELD, OBJECT = 0, 1, 2
COLOURS = np.array([[64, 134, 196], [84, 94, 108], [224, 168, 89]]) / 255  # as in player.js
PALE = np.array([176, 190, 204]) / 255
HOT = "#d1432b"
# Azimuth and elevation, deg.
CAMERAS = tuple((azimuth, 14.0) for azimuth in (48.0, 22.0, -22.0, -42.0, -65.0, 65.0, 115.0, 138.0, 228.0))
FINE = 6000  # triangles: quadratic facets are split in four up to here
_LAMP = np.array([-0.3496, 0.5494, 0.7591])


@dataclass(frozen=True)
class Polyline:
    """A line drawn with the shapes of a take."""

    name: str
    colour: str  # a CSS variable
    frames: np.ndarray  # (f, p, 3), f of the take's shapes, or 1


@dataclass(frozen=True)
class Take:
    """Shapes of one course.

    x: (f, n, 3) shapes
    index: (f,) goal of each
    goals, reached: (m, 3)
    errors: (m,) mm, NaN where the robot failed
    marks: (3,) points with a CSS variable each"""

    name: str
    x: np.ndarray
    index: Sequence[int] = ()
    goals: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    reached: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    errors: Sequence[float] = ()
    lines: tuple[Polyline, ...] = ()
    marks: tuple[tuple[np.ndarray, str], ...] = ()

    @property
    def closed(self) -> bool:
        """True if the goals come back to where they began, and every one of them has a shape."""
        if len(self.goals) < 4:
            return False
        steps = np.linalg.norm(np.diff(self.goals, axis=0), axis=1)
        return bool(np.linalg.norm(self.goals[-1] - self.goals[0]) <= 1.5 * steps.max() and np.ptp(steps) < steps.max())


@dataclass(frozen=True)
class Viewer:
    """Robot that turns and moves in the page.

    name: of the file of the still picture
    triangles: (k, 3)
    kinds: (k,)"""

    name: str
    caption: str
    triangles: np.ndarray
    kinds: np.ndarray
    takes: tuple[Take, ...]
    pale: bool = False

    @cached_property
    def camera(self) -> tuple[float, float]:
        """Camera from which the path of the effector and the length of the body are seen best; of a robot at rest, what
        is held."""
        take = self.takes[0]
        body = take.x[:, np.unique(self.triangles)].reshape(-1, 3)[::7]
        held = take.x[0][self.triangles[self.kinds == HELD]]
        normals = normals_of(held)

        def seen(camera: tuple[float, float]) -> float:
            axes = camera_axes(*camera)
            if len(take.goals):
                return visible(take.goals, axes, 2) * visible(body, axes, 1)
            return visible(body, axes, 1) * (1e-9 + np.maximum(normals @ axes[2], 0).sum())

        return max(CAMERAS, key=seen)

    def html(self) -> str:
        """Figure with its picture, its data and the keys of its lines."""
        picture = base64.b64encode(self.still).decode()
        caption = escape(self.caption)
        data = json.dumps(self.data(), separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
        keys = "".join(
            f'<li><span style="background: var({line.colour})"></span>{escape(line.name)}</li>'
            for line in self.takes[0].lines
        )
        return (
            f'<figure class="viewer"><img alt="{caption}" src="data:image/png;base64,{picture}">'
            f'<script type="application/json">{data}</script>'
            f'<ul class="legend">{keys}</ul><figcaption>{caption}</figcaption></figure>'
        )

    def files(self) -> dict[str, bytes]:
        return {f"{self.name}.png": self.still}

    def data(self) -> dict[str, Any]:
        """Data that player.js reads: nodes that no triangle uses are left out."""
        used, triangles = np.unique(self.triangles, return_inverse=True)
        shapes = [take.x[:, used] for take in self.takes]
        low = np.min([x.min(axis=(0, 1)) for x in shapes], axis=0)
        high = np.max([x.max(axis=(0, 1)) for x in shapes], axis=0)
        copies, triangles = sharpened(shapes[0][0], triangles.reshape(-1, 3), len(used))
        origin, step = (low + high) / 2, float((high - low).max()) / 65000
        return {
            "triangles": _encoded(triangles, "<u4"),
            "again": _encoded(copies, "<u4"),
            "kinds": _encoded(self.kinds, "u1"),
            "origin": origin.tolist(),
            "step": step,
            "camera": self.camera,
            "pale": self.pale,
            "takes": [_take(take, np.rint((x - origin) / step)) for take, x in zip(self.takes, shapes, strict=True)],
        }

    @cached_property
    def still(self) -> bytes:
        """Picture (PNG) of the shape that is farthest from the first one, or the only one, with its goals, lines and
        marks."""
        take, axes = self.takes[0], camera_axes(*self.camera)
        far = int(np.abs(take.x - take.x[0]).max(axis=(1, 2)).argmax())
        figure = Figure(figsize=(6, 4.5), layout="none")
        axis = figure.add_axes((0, 0, 1, 1))
        colours = np.vstack([PALE, COLOURS[1:]]) if self.pale else COLOURS
        axis.add_collection(painted(take.x[far], self.triangles, colours[self.kinds], axes))
        for line in take.lines:
            colour = FE if line.colour == "--fe" else line.colour.replace("--c", "C")
            axis.plot(*(line.frames[min(far, len(line.frames) - 1)] @ axes.T).T[:2], color=colour, lw=2)
        for point, _ in take.marks:
            axis.plot(*(point @ axes.T)[:2], "o", color=HOT, mec=GROUND)
        if len(take.goals):
            axis.plot(*(take.goals @ axes.T).T[:2], "o", ms=5, mfc=GROUND, mec=INK)
            axis.plot(*(take.reached @ axes.T).T[:2], color=HOT, lw=2)
        axis.set_aspect("equal", adjustable="datalim")
        axis.margins(0.05)
        axis.axis("off")
        return png(figure, dpi=130, transparent=True)


def camera_axes(azimuth: float, elevation: float) -> np.ndarray:
    """Axes (3, 3) of a camera: rows right, up, towards the viewer."""
    a, e = np.radians([azimuth, elevation])
    towards = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    right = np.array([-np.sin(a), np.cos(a), 0.0])
    return np.array([right, np.cross(towards, right), towards])


def visible(points: np.ndarray, axes: np.ndarray, extents: int) -> float:
    """Share, 0 to 1, of the largest extents of points (m, 3) that the camera sees without foreshortening."""
    centred = points - points.mean(axis=0)
    full, flat = (np.linalg.svd(cloud, compute_uv=False)[:extents] for cloud in (centred, centred @ axes[:2].T))
    least = 1e-3 * full[0] + 1e-12  # of a straight path nothing across it can be lost
    return float(np.prod((flat + least) / (full + least)))


def painted(x: np.ndarray, triangles: np.ndarray, colours: np.ndarray, axes: np.ndarray) -> PolyCollection:
    """Triangles (k, 3) that face the viewer, lit, from far to near; colours: (k, 3)."""
    corners = (x @ axes.T)[triangles]
    normal = normals_of(corners)
    front = np.flatnonzero(normal[:, 2] > 0)
    front = front[np.argsort(corners[front, :, 2].sum(axis=1))]
    light = np.maximum(normal[front] @ _LAMP / np.linalg.norm(normal[front], axis=1), 0)
    faces = colours[front] * (0.55 + 0.45 * light)[:, None]
    return PolyCollection(corners[front, :, :2], facecolors=faces, edgecolors=faces, linewidths=0.4)


def flat_triangles(facets: np.ndarray) -> np.ndarray:
    """Triangles (k, 3) of facets with three corners, or four, or three and mid-edge nodes: these become four triangles
    each where few enough."""
    return triangulated(facets[:, :3] if facets.shape[1] == 6 and 4 * len(facets) > FINE else facets)


def carried_along(points: np.ndarray, X: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Points (f, p, 3) of the body in the shapes x (f, n, 3), given those (p, 3) at rest X (n, 3): each moves by the
    mean of the nodes nearest to it. For pictures only."""
    from scipy.spatial import cKDTree

    near = cKDTree(X).query(points, k=min(6, len(X)))[1].reshape(len(points), -1)
    return points + (x - X)[:, near].mean(axis=2)


def _take(take: Take, frames: np.ndarray) -> dict[str, Any]:
    """Data of a take as JSON holds it."""

    def rounded(points: np.ndarray) -> list:
        return np.round(points, 4).tolist()

    reached = [point if np.isfinite(point).all() else None for point in take.reached]

    return {
        "name": take.name,
        "count": len(frames),
        "frames": _encoded(frames, "<i2"),
        "index": [int(i) for i in take.index],
        "closed": take.closed and len(frames) == len(take.goals),
        "goals": rounded(take.goals),
        "reached": [None if point is None else rounded(point) for point in reached],
        "errors": [finite(float(error)) for error in take.errors],
        "lines": [{"name": line.name, "colour": line.colour, "frames": rounded(line.frames)} for line in take.lines],
        "marks": [{"point": rounded(point), "colour": colour} for point, colour in take.marks],
    }


def _encoded(values: np.ndarray, kind: str) -> str:
    return base64.b64encode(np.ascontiguousarray(values, dtype=kind).tobytes()).decode()
