"""A surface of triangles, as people publish it, made closed and oriented; and what was done to it, in words."""

from collections import deque

import numpy as np

from cfem.contact.facets import components, solid_angles
from cfem.core.errors import InputError
from cfem.robot.mesh.same_place import representatives

_FLAT = 1e-5  # height of a sliver relative to its longest edge
_HOLE = 0.35  # of the surface's largest extent: a wider hole is an opening, not a flaw
_ROUNDS = 20  # of flips of slivers


def mend(X: np.ndarray, triangles: np.ndarray, where: str) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """X (n, 3), triangles (m, 3) closed, each edge between two of them, normals out of the material; and a phrase for
    each flaw that was mended.

    InputError, naming `where`, for what cannot be mended: wide openings, edges of more than two triangles."""
    said: list[str] = []
    used, numbered = np.unique(triangles, return_inverse=True)
    X, same = X[used], representatives(X[used])
    triangles = same[numbered.reshape(triangles.shape)]
    merged = int((same != np.arange(len(X))).sum())
    if merged:
        said.append(f"merged {merged} duplicate nodes")
    triangles, dropped = _without_copies(triangles)
    if dropped:
        said.append(f"dropped {dropped} triangles that are copies or have two corners at one place")
    triangles, flipped = _without_slivers(X, triangles)
    if flipped:
        said.append(f"turned the edges of {flipped} slivers")
    if len(triangles) == 0:
        raise InputError("has no surface", where=where, do="export the body again")
    _demand_two(X, triangles, where)
    triangles, turned = _alike(triangles)
    X, triangles, holes = _closed(X, triangles, where)
    if holes:
        size = X[np.unique(triangles)]
        share = 100 * max(holes) / np.ptp(size, axis=0).max()
        holes_said = "a hole" if len(holes) == 1 else f"{len(holes)} holes"
        said.append(f"closed {holes_said}, {share:.2g} % of the body's extent wide at most")
    triangles, whole = _outward(X, triangles, where)
    if turned or whole:
        said.append("turned triangles whose normals pointed the wrong way")
    used, numbered = np.unique(triangles, return_inverse=True)
    return X[used], numbered.reshape(triangles.shape), said


def _without_copies(triangles: np.ndarray) -> tuple[np.ndarray, int]:
    """Without triangles that are a line, and with one of each set of copies; and how many fewer these are."""
    whole = triangles[(np.sort(triangles, axis=1)[:, 1:] != np.sort(triangles, axis=1)[:, :-1]).all(axis=1)]
    _, first = np.unique(np.sort(whole, axis=1), axis=0, return_index=True)
    return whole[np.sort(first)], len(triangles) - len(first)


def _without_slivers(X: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, int]:
    """A sliver, whose third corner lies on its longest edge, and the triangle across that edge become two others."""
    triangles, flips = triangles.copy(), 0
    for _ in range(_ROUNDS):
        corners = X[triangles]
        sides = np.linalg.norm(corners[:, [1, 2, 0]] - corners, axis=2)
        area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        flat = np.flatnonzero(area < _FLAT * sides.max(axis=1) ** 2)
        if len(flat) == 0:
            break
        ends = np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2), axis=2)
        owners: dict[tuple[int, int], list[int]] = {}
        for number, own in enumerate(ends.tolist()):
            for edge in own:
                owners.setdefault((edge[0], edge[1]), []).append(number)
        touched: set[int] = set()
        for sliver in flat.tolist():
            longest = int(sides[sliver].argmax())
            a, b, c = np.roll(triangles[sliver], -longest).tolist()
            others = [each for each in owners[(min(a, b), max(a, b))] if each != sliver]
            if len(others) != 1 or {sliver, others[0]} & touched:
                continue
            far = [corner for corner in triangles[others[0]].tolist() if corner not in (a, b)]
            if len(far) != 1 or far[0] == c:
                continue
            triangles[sliver], triangles[others[0]] = (a, far[0], c), (far[0], b, c)
            touched |= {sliver, others[0]}
            flips += 1
        if not touched:
            break
    return triangles, flips


def _edges(triangles: np.ndarray) -> np.ndarray:
    """(3 m, 2), in the direction of each triangle."""
    return np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2)


def _demand_two(X: np.ndarray, triangles: np.ndarray, where: str) -> None:
    keys, uses = np.unique(np.sort(_edges(triangles), axis=1), axis=0, return_counts=True)
    many = np.flatnonzero(uses > 2)
    if len(many):
        place = ", ".join(f"{value:.4g}" for value in X[keys[many[0]]].mean(axis=0))
        what = f"its surface branches: {len(many)} edges belong to more than two triangles, one at ({place})"
        raise InputError(what, where=where, do="join bodies that touch to one, or export STEP")


def _alike(triangles: np.ndarray) -> tuple[np.ndarray, int]:
    """Neighbours oriented alike; and how many were turned."""
    edges = _edges(triangles)
    keys, number = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True)
    order = np.argsort(number.ravel(), kind="stable")
    starts = np.searchsorted(number.ravel()[order], np.arange(len(keys)))
    forward = edges[:, 0] < edges[:, 1]
    neighbours: list[list[tuple[int, bool]]] = [[] for _ in triangles]
    for start, end in zip(starts, [*starts[1:], len(order)], strict=True):
        if end - start == 2:
            one, other = order[start], order[start + 1]
            same = bool(forward[one] == forward[other])
            neighbours[one // 3].append((other // 3, same))
            neighbours[other // 3].append((one // 3, same))
    turn = np.full(len(triangles), -1)
    for seed in range(len(triangles)):
        if turn[seed] >= 0:
            continue
        turn[seed], piece, queue = 0, [seed], deque([seed])
        while queue:
            here = queue.popleft()
            for other, same in neighbours[here]:
                if turn[other] < 0:
                    turn[other] = turn[here] ^ same
                    piece.append(other)
                    queue.append(other)
        if 2 * turn[piece].sum() > len(piece):  # the majority is right
            turn[piece] ^= 1
    wrong = turn == 1
    triangles = np.where(wrong[:, None], triangles[:, ::-1], triangles)
    return triangles, int(wrong.sum())


def _closed(X: np.ndarray, triangles: np.ndarray, where: str) -> tuple[np.ndarray, np.ndarray, list[float]]:
    """With a fan of triangles in each hole, from a new node in its middle; and the widths of the holes."""
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


def _loops(rim: np.ndarray) -> list[list[int]]:
    """Closed ways along directed edges (k, 2), none of which passes a node twice."""
    after: dict[int, list[int]] = {}
    for start, end in rim.tolist():
        after.setdefault(start, []).append(end)
    found = []
    for first in list(after):
        while after[first]:
            path, node = [first], first
            while after.get(node):
                node = after[node].pop()
                if node in path:
                    cut = path.index(node)
                    found.append(path[cut:])
                    path = path[: cut + 1]
                else:
                    path.append(node)
    return [loop for loop in found if len(loop) > 2]


def _outward(X: np.ndarray, triangles: np.ndarray, where: str) -> tuple[np.ndarray, bool]:
    """The outer shell with its normals outward, those of cavities into the cavity; and whether one was turned.
    InputError where several shells have material inside."""
    count, part = components(triangles)
    triangles, turned, bodies = triangles.copy(), False, 0
    corners = X[triangles]
    for which in range(count):
        own = part == which
        place = corners[own][0].mean(axis=0)
        around = [
            other
            for other in range(count)
            if other != which and abs(solid_angles(corners[part == other] - place).sum()) > 2 * np.pi
        ]
        middle = corners[own].mean(axis=(0, 1))
        outward = np.linalg.det(corners[own] - middle).sum() > 0
        bodies += len(around) % 2 == 0
        if outward != (len(around) % 2 == 0):
            triangles[own], turned = triangles[own][:, ::-1], True
    if bodies > 1:
        do = "give one body, or make each a file of its own and a part of a geometry of `kind: assembly`"
        raise InputError(f"the surface is {bodies} separate pieces", where=where, do=do)
    return triangles, turned
