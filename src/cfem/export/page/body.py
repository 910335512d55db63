"""What a page draws of a robot: its surface, the walls of its chambers, and the cables inside, as points that move with
the skin."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from cfem.export.page.chambers import ChamberWall
from cfem.robot.catalogue import routes, stiff_flop
from cfem.robot.catalogue.stiff_flop import StiffFlop
from cfem.robot.constraints import Route
from cfem.viewer.surface import sharpened

NEAR = 24  # surface nodes that carry a point of the inside
ALONG_A_CHAMBER = 12  # points
CABLE = 0.006  # radius of what is drawn, of the robot's length


@dataclass(frozen=True)
class ActuatorTube:
    """Points (p, 3) mm of actuator number `actuator`, drawn as a tube of radius mm; the first `held` do not move."""

    actuator: int
    points: np.ndarray
    radius: float
    held: int = 0


@dataclass(frozen=True)
class DrawnBody:
    """rest (n, 3) mm; modes (k, n, 3): positions x = rest + sum of modes times skin rows; triangles (t, 3);
    lines: (actuator, first point, number of points, radius mm). First the skin's points, then those of the lines, then
    again those on sharp edges. The first `outer` triangles are no wall of a chamber; chambers: (actuator, first
    triangle, number of triangles), normals into the chamber."""

    rest: np.ndarray
    modes: np.ndarray
    triangles: np.ndarray
    lines: list[tuple[int, int, int, float]]
    outer: int
    chambers: list[tuple[int, int, int]]


def body(skin: dict[str, np.ndarray], lines: Sequence[ActuatorTube], walls: Sequence[ChamberWall]) -> DrawnBody:
    """The skin's surface, whose sharp edges stay sharp, and lines and walls of chambers inside of it."""
    rest, modes = skin["rest"], skin["modes"]
    points, moving, placed, inner, chambers = [rest], [modes], [], [], []
    for line in lines:
        placed.append((line.actuator, sum(map(len, points)), len(line.points), line.radius))
        points.append(line.points)
        moved = carried(line.points[line.held :], skin)
        moving.append(np.concatenate([np.zeros((len(modes), line.held, 3)), moved], axis=1))
    for wall in walls:
        chambers.append((wall.actuator, len(skin["triangles"]) + sum(map(len, inner)), len(wall.triangles)))
        inner.append(sum(map(len, points)) + wall.triangles)
        points.append(wall.rest)
        moving.append(within(wall, skin))
    again, outer = sharpened(rest, skin["triangles"], sum(map(len, points)))
    places, moved = np.concatenate(points), np.concatenate(moving, axis=1)
    return DrawnBody(
        rest=np.concatenate([places, places[again]]),
        modes=np.concatenate([moved, moved[:, again]], axis=1),
        triangles=np.concatenate([outer, *inner]),
        lines=placed,
        outer=len(outer),
        chambers=chambers,
    )


def within(wall: ChamberWall, skin: dict[str, np.ndarray]) -> np.ndarray:
    """Modes (k, p, 3) of a wall's points: the skin's own where it has nodes inside the body, else carried."""
    inner = skin.get("inner_nodes", np.zeros(0, int))
    if not np.isin(wall.nodes, inner).all():
        return carried(wall.rest, skin)
    order = np.argsort(inner)
    return skin["inner_modes"][:, order[np.searchsorted(inner, wall.nodes, sorter=order)]]


def carried(points: np.ndarray, skin: dict[str, np.ndarray]) -> np.ndarray:
    """Modes (k, p, 3) of points (p, 3) mm that the surface near them carries along."""
    return np.einsum("pn,knd->kpd", carriers(points, skin["rest"]), skin["modes"])


def carriers(points: np.ndarray, surface: np.ndarray) -> np.ndarray:
    """Weights (p, n) of surface points (n, 3) whose weighted mean moves as points (p, 3) between them do in any affine
    motion: least squares in a neighbourhood, weighted by closeness."""
    distance, near = cKDTree(surface).query(points, k=min(NEAR, len(surface)))
    weights = np.zeros((len(points), len(surface)))
    for place, point in enumerate(points):
        close = np.exp(-((distance[place] / (distance[place].max() or 1.0)) ** 2))
        size = distance[place].max() or 1.0
        basis = np.column_stack([np.ones(near.shape[1]), (surface[near[place]] - point) / size])
        # the smallest weights that reproduce what they can of 1, x, y, z
        scaled = basis * np.sqrt(close)[:, None]
        shares = np.linalg.pinv(scaled.T, rcond=1e-3) @ np.array([1.0, 0, 0, 0])
        shares *= np.sqrt(close)
        weights[place, near[place]] = shares / shares.sum()
    return weights


def lines(robot: dict[str, Any] | None, length: float) -> list[ActuatorTube]:
    """The cables, and the chambers of rods, that the model says its robot has; none where it does not say."""
    if robot is None:
        return []
    return [line for number, item in enumerate(robot["actuators"]) for line in _of(number, item, robot, length)]


def _of(number: int, item: dict[str, Any], robot: dict[str, Any], length: float) -> Iterator[ActuatorTube]:
    """Lines of one actuator, as the model describes it."""
    geometry = {key: value for key, value in robot["geometry"].items() if key != "kind"}
    if item["kind"] == "cable":
        points, pull = item.get("points"), item.get("pull_point")
        if points is None:
            body = routes.BODIES[robot["geometry"]["kind"]].model_construct(**robot["geometry"])
            route = Route.model_construct(**item["route"])
            points = routes.points(body, route)
            pull = routes.pull_point(body, route) if pull is None else pull
        held = [] if pull is None else [pull]
        yield ActuatorTube(number, np.array([*held, *points], float), CABLE * length, len(held))
    elif item["kind"] == "chambers":
        trunk = StiffFlop.model_construct(kind="stiff-flop", **geometry)
        along = np.linspace(item["module"] - 1, item["module"], ALONG_A_CHAMBER) * trunk.module_length
        for centre in stiff_flop.chamber_centres(trunk, item["chambers"]):
            points = np.column_stack([along, np.broadcast_to(centre, (len(along), 2))])
            yield ActuatorTube(number, points, trunk.chamber_radius)
