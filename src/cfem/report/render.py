"""Shaded pictures of triangle meshes: orthographic camera, z-buffer, Lambert light, outlines where depth
jumps. NumPy only."""

from dataclasses import dataclass

import numpy as np

AMBIENT, SUPERSAMPLING = 0.58, 2


@dataclass(frozen=True)
class Camera:
    """Orthographic. axes: (3, 3) rows right, up, towards the viewer."""

    axes: np.ndarray

    @classmethod
    def looking(cls, azimuth: float, elevation: float) -> "Camera":
        """deg; azimuth 0 looks from +x with y to the right, elevation lifts the viewer towards +z."""
        a, e = np.radians([azimuth, elevation])
        towards = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        right = np.array([-np.sin(a), np.cos(a), 0.0])
        return cls(np.array([right, np.cross(towards, right), towards]))

    def project(self, points: np.ndarray) -> np.ndarray:
        """(..., 3) mm -> (..., 3) mm right, up, depth (larger is nearer)."""
        return points @ self.axes.T


@dataclass(frozen=True)
class Body:
    """x: (n, 3) mm; triangles: (k, 3); colour: (3,) red, green, blue in [0, 1], or (k, 3), one a triangle."""

    x: np.ndarray
    triangles: np.ndarray
    colour: np.ndarray


def flat_triangles(facets: np.ndarray) -> np.ndarray:
    """(k, 3) as they are, (k, 6) quadratic ones as four triangles each."""
    if facets.shape[1] == 3:
        return facets
    return facets[:, [[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]]].reshape(-1, 3)


@dataclass(frozen=True)
class Frame:
    """What the picture shows, mm in the camera's plane, and how many pixels a mm takes."""

    low: np.ndarray
    high: np.ndarray
    pixels: float

    @classmethod
    def around(cls, points: np.ndarray, camera: Camera, width: int = 900, margin: float = 0.04) -> "Frame":
        """points: (..., 3) mm; width: pixels."""
        flat = camera.project(points)[..., :2].reshape(-1, 2)
        low, high = flat.min(axis=0), flat.max(axis=0)
        pad = margin * (high - low).max()
        return cls(low - pad, high + pad, width / float((high - low)[0] + 2 * pad))


def draw(body: Body, camera: Camera, frame: Frame) -> tuple[np.ndarray, tuple[float, float, float, float]]:
    """(height, width, 4) RGBA in [0, 1], transparent where nothing is, row 0 at the bottom; and its extent in
    mm of the camera's plane (left, right, bottom, top), so that curves can be drawn over it."""
    scale = SUPERSAMPLING * frame.pixels
    size = SUPERSAMPLING * np.ceil((frame.high - frame.low) * frame.pixels).astype(int)
    shape = (int(size[1]), int(size[0]))
    depth, colour = np.full(shape, -np.inf), np.zeros((*shape, 3))
    corners = (camera.project(body.x)[body.triangles] - [*frame.low, 0.0]) * scale
    _paint(corners, body.colour, depth, colour)
    colour *= (1 - 0.55 * _outline(depth, 4.0 * SUPERSAMPLING))[..., None]
    image = _shrink(np.concatenate([colour, np.isfinite(depth)[..., None]], axis=2))
    image[..., :3] /= np.maximum(image[..., 3:], 1e-9)
    right, top = frame.low + size / scale
    return np.clip(image, 0, 1), (float(frame.low[0]), float(right), float(frame.low[1]), float(top))


def _paint(corners: np.ndarray, base: np.ndarray, depth: np.ndarray, colour: np.ndarray) -> None:
    """Triangles (k, 3, 3) in pixels, depth alike, into the buffers; those that face away are left out."""
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    keep = area > 1e-9
    corners, u, v, area = corners[keep], u[keep], v[keep], area[keep]
    base = np.broadcast_to(base, (len(keep), 3))[keep]
    shade = _light(u, v)
    first = np.clip(np.floor(corners[..., :2].min(axis=1)).astype(int), 0, None)
    last = np.minimum(np.ceil(corners[..., :2].max(axis=1)).astype(int) + 1, np.array(depth.shape)[::-1])
    for triangle in range(len(corners)):
        (left, bottom), (right, top) = first[triangle], last[triangle]
        px = np.arange(left, right) + 0.5 - corners[triangle, 0, 0]
        py = (np.arange(bottom, top) + 0.5 - corners[triangle, 0, 1])[:, None]
        b = (px * v[triangle, 1] - py * v[triangle, 0]) / area[triangle]
        c = (py * u[triangle, 0] - px * u[triangle, 1]) / area[triangle]
        z = corners[triangle, 0, 2] + b * u[triangle, 2] + c * v[triangle, 2]
        window = depth[bottom:top, left:right]
        nearer = (b >= 0) & (c >= 0) & (b + c <= 1) & (z > window)
        window[nearer] = z[nearer]
        colour[bottom:top, left:right][nearer] = base[triangle] * shade[triangle]


def _light(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """(k,) brightness of triangles with edges u, v (k, 3): a lamp over the viewer's left shoulder."""
    normal = np.cross(u, v)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    lamp = np.array([-0.35, 0.55, 0.76])
    return AMBIENT + (1 - AMBIENT) * np.maximum(normal @ (lamp / np.linalg.norm(lamp)), 0.0)


def _outline(depth: np.ndarray, jump: float) -> np.ndarray:
    """0..1, 1 where the depth differs by more than `jump` pixels from a neighbour that is farther away."""
    edge = np.zeros(depth.shape, dtype=bool)
    with np.errstate(invalid="ignore"):
        for axis in (0, 1):
            for shift in (1, -1):
                edge |= depth - np.roll(depth, shift, axis) > jump
    return edge.astype(float)


def _shrink(image: np.ndarray) -> np.ndarray:
    """Mean over SUPERSAMPLING x SUPERSAMPLING pixels."""
    h, w, channels = (image.shape[0] // SUPERSAMPLING, image.shape[1] // SUPERSAMPLING, image.shape[2])
    return image.reshape(h, SUPERSAMPLING, w, SUPERSAMPLING, channels).mean(axis=(1, 3))
