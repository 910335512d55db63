"""What a page draws of a robot: its surface, and the cables or chambers inside, as points that move with the skin."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from cfem.robot.catalogue import soft_finger, stiff_flop
from cfem.robot.geometry import SoftFinger, StiffFlop

NEAR = 24  # surface nodes that carry a point of the inside
SHARP = np.deg2rad(40.0)
ALONG_A_CHAMBER = 12  # points
CABLE, CAVITY = 0.006, 0.03  # radius of what is drawn, of the robot's length


@dataclass(frozen=True)
class Line:
    """Points (p, 3) mm of actuator number `actuator`, drawn as a tube of radius mm; the first `held` do not move."""

    actuator: int
    points: np.ndarray
    radius: float
    held: int = 0


@dataclass(frozen=True)
class Body:
    """rest (n, 3) mm; modes (k, n, 3): positions x = rest + sum of modes times skin rows; triangles (t, 3);
    lines: (actuator, first point, number of points, radius mm). First the skin's points, then those of the lines, then
    again those on sharp edges."""

    rest: np.ndarray
    modes: np.ndarray
    triangles: np.ndarray
    lines: list[tuple[int, int, int, float]]


def body(rest: np.ndarray, modes: np.ndarray, triangles: np.ndarray, lines: list[Line]) -> Body:
    """Of the skin's surface, whose sharp edges stay sharp, and lines inside of it."""
    points, moving, placed = [rest], [modes], []
    for line in lines:
        placed.append((line.actuator, sum(map(len, points)), len(line.points), line.radius))
        points.append(line.points)
        carried = np.einsum("pn,knd->kpd", carriers(line.points[line.held :], rest), modes)
        moving.append(np.concatenate([np.zeros((len(modes), line.held, 3)), carried], axis=1))
    again, triangles = sharpened(rest, triangles, sum(map(len, points)))
    points, moving = [*points, rest[again]], [*moving, modes[:, again]]
    return Body(np.concatenate(points), np.concatenate(moving, axis=1), triangles, placed)


def sharpened(rest: np.ndarray, triangles: np.ndarray, first: int) -> tuple[np.ndarray, np.ndarray]:
    """Points of rest (n, 3) that lie on an edge where the surface turns by more than `SHARP`, once for each smooth part
    behind the first, numbered from `first` on; and the triangles (t, 3) with these numbers. Each part is then lit by
    its own normals."""
    sides = [rest[triangles[:, k]] - rest[triangles[:, 0]] for k in (1, 2)]
    normals = np.cross(*sides)
    normals /= np.maximum(np.linalg.norm(normals, axis=1), np.finfo(float).tiny)[:, None]
    corner = np.arange(triangles.size).reshape(triangles.shape)
    ends = np.concatenate([np.stack([corner[:, k], corner[:, (k + 1) % 3]], axis=1) for k in range(3)])
    points = triangles.ravel()[ends]
    turned = points[:, 0] > points[:, 1]
    ends[turned], points[turned] = ends[turned, ::-1], points[turned, ::-1]
    order = np.lexsort(points.T)
    here, there = order[:-1], order[1:]
    smooth = (normals[ends[here, 0] // 3] * normals[ends[there, 0] // 3]).sum(axis=1) > np.cos(SHARP)
    joined = (points[here] == points[there]).all(axis=1) & smooth
    pairs = np.concatenate([np.stack([ends[here, k], ends[there, k]], axis=1)[joined] for k in (0, 1)])
    graph = coo_matrix((np.ones(len(pairs)), pairs.T), shape=(triangles.size,) * 2)
    part = connected_components(graph, directed=False)[1]
    parts, at = np.unique(np.stack([triangles.ravel(), part]), axis=1, return_inverse=True)
    later = np.flatnonzero(np.diff(parts[0], prepend=-1) == 0)
    number = parts[0].copy()
    number[later] = first + np.arange(len(later))
    return parts[0][later], number[at.ravel()].reshape(triangles.shape)


def carriers(points: np.ndarray, surface: np.ndarray) -> np.ndarray:
    """(p, n) weights of surface points (n, 3) whose weighted mean moves as points (p, 3) between them do in any affine
    motion: least squares in a neighbourhood, weighted by closeness."""
    distance, near = cKDTree(surface).query(points, k=min(NEAR, len(surface)))
    weights = np.zeros((len(points), len(surface)))
    for place, point in enumerate(points):
        close = np.exp(-((distance[place] / (distance[place].max() or 1.0)) ** 2))
        size = distance[place].max() or 1.0
        basis = np.column_stack([np.ones(near.shape[1]), (surface[near[place]] - point) / size])
        # the smallest weights that reproduce what they can of 1, x, y, z
        scaled = basis * np.sqrt(close)[:, None]
        found = np.linalg.pinv(scaled.T, rcond=1e-3) @ np.array([1.0, 0, 0, 0])
        found *= np.sqrt(close)
        weights[place, near[place]] = found / found.sum()
    return weights


def lines(robot: dict[str, Any] | None, length: float) -> list[Line]:
    """Of the cables, chambers and cavities that the model says its robot has; none where it does not say."""
    if robot is None:
        return []
    return [line for number, item in enumerate(robot["actuators"]) for line in _of(number, item, robot, length)]


def _of(number: int, item: dict[str, Any], robot: dict[str, Any], length: float) -> Iterator[Line]:
    geometry = {key: value for key, value in robot["geometry"].items() if key != "kind"}
    if item["kind"] == "cable":
        if item.get("points") is not None:
            points = np.array(item["points"], float)
        else:
            finger = SoftFinger.model_construct(kind="soft-finger", **geometry)
            points = np.asarray(soft_finger.route(finger, item["route"]["x"], item["route"]["y"]), float)
        held = [] if item.get("pull_point") is None else [item["pull_point"]]
        yield Line(number, np.array([*held, *points], float), CABLE * length, len(held))
    elif item["kind"] == "chambers":
        trunk = StiffFlop.model_construct(kind="stiff-flop", **geometry)
        along = np.linspace(item["module"] - 1, item["module"], ALONG_A_CHAMBER) * trunk.module_length
        for centre in stiff_flop.chamber_centres(trunk, item["chambers"]):
            points = np.column_stack([along, np.broadcast_to(centre, (len(along), 2))])
            yield Line(number, points, trunk.chamber_radius)
    elif item.get("inside") is not None:
        yield Line(number, np.array([item["inside"]], float), CAVITY * length)
