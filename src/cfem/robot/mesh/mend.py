"""A surface of triangles, as people publish it, made closed and oriented; and what was done to it, in words."""

from collections import deque
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array

from cfem.contact.surface.crossing import crossings
from cfem.contact.surface.facets import components, solid_angles
from cfem.contact.surface.triangles import normals_of
from cfem.core.console.shown import counted
from cfem.core.errors import InputError
from cfem.robot.mesh.same_place import representatives
from cfem.robot.mesh.short_edges import without_short_edges

_FLAT = 1e-5  # height of a sliver relative to its longest edge
_HOLE = 0.35  # of the surface's largest extent: a wider hole is an opening, not a flaw
_ROUNDS = 20  # of flips of slivers, and of moves of nodes where the surface passes through itself
_TANGLED = 0.02  # of the triangles: where more pass through others, no small move mends it
_NEAR = 1e-6  # of the surface's largest extent: surfaces so near to each other touch
_KEPT = 0.05  # of the volume: moves of nodes that change more of it make another body


class MendedSurface(NamedTuple):
    """A closed surface: each edge lies between two triangles, normals point out of the material."""

    X: np.ndarray  # (n, 3)
    triangles: np.ndarray  # (m, 3)
    mends: tuple[str, ...]  # a phrase for each flaw that was mended
    bodies: int  # in the file, of which this is one


def mend(X: np.ndarray, triangles: np.ndarray, where: str, body: int = 1) -> MendedSurface:
    """Surface of X (n, 3), triangles (m, 3), mended. body: the one that is taken, the largest first.

    InputError, naming `where`, for what cannot be mended: wide openings, edges of more than two triangles."""
    mends: list[str] = []
    used, numbered = np.unique(triangles, return_inverse=True)
    X, same = X[used], representatives(X[used])
    triangles = same[numbered.reshape(triangles.shape)]
    merged = int((same != np.arange(len(X))).sum())
    if merged:
        mends.append(f"merged {counted(merged, 'duplicate node')}")
    triangles, dropped = _without_copies(triangles)
    if dropped:
        mends.append(f"dropped {counted(dropped, 'triangle')}, as copies or with two corners at one place")
    triangles, flipped = _without_slivers(X, triangles)
    if flipped:
        mends.append(f"turned the edges of {counted(flipped, 'sliver')}")
    if len(triangles) == 0:
        raise InputError("has no surface", where=where, do="export the body again")
    _demand_two(X, triangles, where)
    triangles, turned = _oriented_alike(triangles)
    X, triangles, hole_widths = _closed(X, triangles, where)
    if hole_widths:
        extent = np.ptp(X[np.unique(triangles)], axis=0).max()
        holes, most = ("a hole", "") if len(hole_widths) == 1 else (f"{len(hole_widths)} holes", " at most")
        mends.append(f"closed {holes}, {100 * max(hole_widths) / extent:.2g} % of the body's extent wide{most}")
    _demand_apart(X, triangles, where)
    triangles, turned_shells, bodies = _outward(X, triangles)
    if turned or turned_shells:
        mends.append("turned triangles whose normals pointed the wrong way")
    if len(bodies) > 1 or body > 1:
        triangles, phrase = _chosen_body(X, [triangles[members] for members in bodies], body, where)
        mends.append(phrase)
    triangles, contracted = without_short_edges(X, triangles)
    if contracted:
        mends.append(f"contracted {counted(contracted, 'edge')} next to nothing beside those around")
    X, moved = _untangled(X, triangles)
    if moved:
        mends.append(f"moved {counted(moved, 'node')} where the surface passed through itself")
    used, numbered = np.unique(triangles, return_inverse=True)
    return MendedSurface(X[used], numbered.reshape(triangles.shape), tuple(mends), len(bodies))


def _without_copies(triangles: np.ndarray) -> tuple[np.ndarray, int]:
    """Triangles without those that are a line and without copies; and how many fewer these are."""
    corners = np.sort(triangles, axis=1)
    proper = triangles[(corners[:, 1:] != corners[:, :-1]).all(axis=1)]
    _, first = np.unique(np.sort(proper, axis=1), axis=0, return_index=True)
    return proper[np.sort(first)], len(triangles) - len(first)


def _without_slivers(X: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, int]:
    """Triangles after flips of the longest edges of slivers, whose third corner lies on that edge; and the number of
    flips. A sliver and the triangle across its longest edge become two others."""
    triangles, flips = triangles.copy(), 0
    for _ in range(_ROUNDS):
        corners = X[triangles]
        sides = np.linalg.norm(corners[:, [1, 2, 0]] - corners, axis=2)
        twice_area = np.linalg.norm(normals_of(corners), axis=1)
        flat = np.flatnonzero(twice_area < _FLAT * sides.max(axis=1) ** 2)
        if len(flat) == 0:
            break
        ends = np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2), axis=2)
        owners: dict[tuple[int, int], list[int]] = {}
        for number, edges in enumerate(ends.tolist()):
            for a, b in edges:
                owners.setdefault((a, b), []).append(number)
        changed: set[int] = set()
        for sliver in flat.tolist():
            longest = int(sides[sliver].argmax())
            a, b, c = np.roll(triangles[sliver], -longest).tolist()
            across = [number for number in owners[(min(a, b), max(a, b))] if number != sliver]
            if len(across) != 1 or {sliver, across[0]} & changed:
                continue
            far = [corner for corner in triangles[across[0]].tolist() if corner not in (a, b)]
            if len(far) != 1 or far[0] == c:
                continue
            triangles[sliver], triangles[across[0]] = (a, far[0], c), (far[0], b, c)
            changed |= {sliver, across[0]}
            flips += 1
        if not changed:
            break
    return triangles, flips


def _edges(triangles: np.ndarray) -> np.ndarray:
    """Directed edges (3 m, 2), in the sense of each triangle."""
    return np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2)


def _demand_two(X: np.ndarray, triangles: np.ndarray, where: str) -> None:
    """Raises InputError where an edge belongs to more than two triangles."""
    keys, uses = np.unique(np.sort(_edges(triangles), axis=1), axis=0, return_counts=True)
    branching = np.flatnonzero(uses > 2)
    if len(branching):
        place = ", ".join(f"{value:.4g}" for value in X[keys[branching[0]]].mean(axis=0))
        edges = counted(len(branching), "edge belongs", "edges belong")
        what = f"its surface branches: {edges} to more than two triangles, one at ({place})"
        raise InputError(what, where=where, do="join bodies that touch to one, or export STEP")


def _oriented_alike(triangles: np.ndarray) -> tuple[np.ndarray, int]:
    """Triangles oriented as their neighbours, most of each piece as they were; and how many were turned."""
    edges = _edges(triangles)
    keys, number = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True)
    order = np.argsort(number.ravel(), kind="stable")
    starts = np.searchsorted(number.ravel()[order], np.arange(len(keys)))
    forward = edges[:, 0] < edges[:, 1]
    neighbours: list[list[tuple[int, bool]]] = [[] for _ in triangles]  # and whether it is oriented the other way
    for start, end in zip(starts, [*starts[1:], len(order)], strict=True):
        if end - start == 2:
            first, second = order[start], order[start + 1]  # the shared edge, as each of two triangles runs along it
            opposed = bool(forward[first] == forward[second])
            neighbours[first // 3].append((second // 3, opposed))
            neighbours[second // 3].append((first // 3, opposed))
    turn = np.full(len(triangles), -1)
    for seed in range(len(triangles)):
        if turn[seed] >= 0:
            continue
        turn[seed], piece, queue = 0, [seed], deque([seed])
        while queue:
            triangle = queue.popleft()
            for neighbour, opposed in neighbours[triangle]:
                if turn[neighbour] < 0:
                    turn[neighbour] = turn[triangle] ^ opposed
                    piece.append(neighbour)
                    queue.append(neighbour)
        if 2 * turn[piece].sum() > len(piece):  # the majority is right
            turn[piece] ^= 1
    wrong = turn == 1
    triangles = np.where(wrong[:, None], triangles[:, ::-1], triangles)
    return triangles, int(wrong.sum())


def _closed(X: np.ndarray, triangles: np.ndarray, where: str) -> tuple[np.ndarray, np.ndarray, list[float]]:
    """Surface with each hole closed by a fan of triangles around a new node in its middle; and the holes' widths."""
    edges = _edges(triangles)
    _, number, uses = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True, return_counts=True)
    rim = edges[uses[number.ravel()] == 1]
    if len(rim) == 0:
        return X, triangles, []
    extent = float(np.ptp(X[triangles].reshape(-1, 3), axis=0).max())
    widths, added, middles = [], [], []
    for loop in _loops(rim):
        corners = X[loop]
        width = float(np.linalg.norm(np.ptp(corners, axis=0)))
        if width > _HOLE * extent:
            place = ", ".join(f"{value:.4g}" for value in corners.mean(axis=0))
            what = f"the surface is not closed: an opening of {width:.4g} around ({place}), in the file's unit"
            do = "give the surface a thickness, or close the body in the CAD program"
            raise InputError(what, where=where, do=do)
        widths.append(width)
        if len(loop) == 3:
            added.append(loop[::-1])
            continue
        middle = len(X) + len(middles)
        middles.append(corners.mean(axis=0))
        added += [[end, start, middle] for start, end in zip(loop, [*loop[1:], loop[0]], strict=True)]
    X = np.vstack([X, *middles]) if middles else X
    return X, np.vstack([triangles, np.array(added)]), widths


def _demand_apart(X: np.ndarray, triangles: np.ndarray, where: str) -> None:
    """Raises InputError where closed surfaces touch or pass through each other, as those of bodies that overlap. Each
    is moved by next to nothing, one way and the other: an edge along a face, or through a node, pierces nothing."""
    count, part = components(triangles)
    if count == 1:
        return
    of_node = np.zeros(len(X), dtype=np.int64)
    of_node[triangles] = part[:, None]
    aside = _NEAR * np.ptp(X[triangles].reshape(-1, 3), axis=0).max() * of_node[:, None] * np.array([0.61, 0.34, 0.72])
    for way in (aside, -aside):
        edges, pierced = crossings(X + way, triangles)
        across = pierced[of_node[edges[:, 0]] != part[pierced]]
        if len(across):
            place = ", ".join(f"{value:.4g}" for value in X[triangles[across[0]]].mean(axis=0))
            what = f"closed surfaces in it touch or pass through each other, around ({place}), in the file's unit"
            raise InputError(what, where=where, do="join these bodies to one in the CAD program, or export STEP")


def _untangled(X: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, int]:
    """Nodes X (n, 3) of a surface that no longer passes through itself, and how many have moved; none where that does
    not help, or makes another body of it. Nodes of triangles that cross come half way to the mean of their neighbours
    until none does."""
    start, neighbours, volume = X, None, _volume(X, triangles)
    for _ in range(_ROUNDS):
        edges, pierced = crossings(X, triangles)
        if abs(_volume(X, triangles) - volume) > _KEPT * abs(volume):
            break
        if len(pierced) == 0:
            return X, int((start != X).any(axis=1).sum())
        if len(np.unique(pierced)) > max(_TANGLED * len(triangles), 10):
            break
        if neighbours is None:
            rows, columns = _edges(triangles).T
            weights = csr_array((np.ones(len(rows)), (rows, columns)), shape=(len(X), len(X)))
            neighbours = weights / np.maximum(weights.sum(axis=1), 1)[:, None]
        tangled = np.unique(np.concatenate([edges.ravel(), triangles[pierced].ravel()]))
        X = X.copy()
        X[tangled] = (X[tangled] + (neighbours @ X)[tangled]) / 2
    return start, 0


def _loops(rim: np.ndarray) -> list[list[int]]:
    """Closed ways along directed edges (k, 2), none of which passes a node twice."""
    after: dict[int, list[int]] = {}
    for start, end in rim.tolist():
        after.setdefault(start, []).append(end)
    loops = []
    for first in list(after):
        while after[first]:
            path, node = [first], first
            while after.get(node):
                node = after[node].pop()
                if node in path:
                    cut = path.index(node)
                    loops.append(path[cut:])
                    path = path[: cut + 1]
                else:
                    path.append(node)
    return [loop for loop in loops if len(loop) > 2]


def _outward(X: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, bool, list[np.ndarray]]:
    """The outer shells with their normals outward, those of cavities into the cavity; whether one was turned; and the
    triangles (m,) bool of each body, an outer shell with its cavities."""
    count, part = components(triangles)
    triangles, turned = triangles.copy(), False
    corners = X[triangles]
    around = np.zeros((count, count), dtype=bool)  # [inner, outer]: whether the second shell encloses the first
    for inner in range(count):
        place = corners[part == inner][0].mean(axis=0)
        for outer in range(count):
            if outer != inner:
                around[inner, outer] = abs(solid_angles(corners[part == outer] - place).sum()) > 2 * np.pi
    depth = around.sum(axis=1)
    for shell in range(count):
        members = part == shell
        middle = corners[members].mean(axis=(0, 1))
        outward = np.linalg.det(corners[members] - middle).sum() > 0
        if outward != (depth[shell] % 2 == 0):
            triangles[members], turned = triangles[members][:, ::-1], True
    bodies = []
    for outer in np.flatnonzero(depth % 2 == 0):
        cavities = np.flatnonzero(around[:, outer] & (depth == depth[outer] + 1))
        bodies.append(np.isin(part, [outer, *cavities]))
    return triangles, turned, bodies


def _chosen_body(X: np.ndarray, bodies: list[np.ndarray], body: int, where: str) -> tuple[np.ndarray, str]:
    """Triangles (m, 3) of body number `body`, the largest being 1; and a phrase about the choice."""
    volumes = np.array([_volume(X, triangles) for triangles in bodies])
    if body > len(bodies):
        what = f"has {len(bodies)} {'bodies' if len(bodies) > 1 else 'body'}, and the scene asks for number {body}"
        raise InputError(what, where=where, do="set geometry.body (--body) to one of them, the largest first")
    order = np.argsort(-volumes, kind="stable")
    shares = ", ".join(f"{100 * volume / volumes.sum():.2g}" for volume in volumes[order][:5])
    phrase = f"took body {body} of {len(bodies)}, which hold {shares} % of the volume: geometry.body (--body) chooses"
    return bodies[order[body - 1]], phrase


def _volume(X: np.ndarray, triangles: np.ndarray) -> float:
    """Volume that a closed surface bounds, by the divergence theorem."""
    return float(np.linalg.det(X[triangles]).sum() / 6)
