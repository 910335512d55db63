"""The one place that touches gmsh (GPL), which it runs in its own process:
`python -P -m cfem.robot.mesh.gmsh_process JOB.json OUT.npz`.

It ends when its stdin does: then nobody waits for the answer any more. A job is {'solid': a tree of cad.py, 'surface':
of a surface the .npz with X (n, 3) mm and triangles (m, 3), 'size': mm, 'refine': [{'low', 'high', 'size', 'blend'}],
'regions': [trees whose surfaces the mesh is to conform to], 'grading': rows of a tetrahedron's x, y, z and sizes at its
corners, or null, 'factor': on all sizes, 'anew': of a surface, whether its triangles are made anew, 'around': edges
round a full turn of curved faces at least, or 0, 'patience': times the usual limit of time}. The answer is an
.npz with X (n, 3) mm, cells (m, 4) and the CAD volume mm^3, and, of a file of several solids that touch, 'solid' (m,):
which of them a cell is of; where 'size' is null, nothing is meshed, and the answer is the body's volume mm^3, the area
mm^2 of its surface and the number of its solids.

One thread and fixed algorithms: the same job gives the same mesh. Where gmsh takes much more of the processor than so
many cells need, SIGXCPU ends it. Exit 10: gmsh cannot be loaded; 11: the geometry
cannot be built or meshed, cause on stderr; 12: stdin ended; 13: the geometry is not one body. A mesh of more than
'max_cells' cells is not made, nor one whose 'size' is more than the body's: the answer is then about how many cells
there would be and the body's extent (3,) mm."""

import json
import math
import os
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

_LOST = 0.5  # of the largest cells: a mesh that is so much shorter than the body has lost an end of it
_START, _PACE = 10.0, 200.0  # s, and cells a second: less than a tenth of what gmsh makes
_EMPTY = "gmsh made no tetrahedra: the surface may not enclose a volume"


def build(occ, node: dict) -> list[tuple[int, int]]:
    """OpenCASCADE entities (3, tag) of a tree of solids."""
    kind = node["kind"]
    if kind == "Box":
        size = [high - low for low, high in zip(node["low"], node["high"], strict=True)]
        return [(3, occ.addBox(*node["low"], *size))]
    if kind == "Prism":
        points = [occ.addPoint(node["x_low"], y, z) for y, z in node["polygon"]]
        lines = [occ.addLine(a, b) for a, b in zip(points, points[1:] + points[:1], strict=True)]
        face = occ.addPlaneSurface([occ.addCurveLoop(lines)])
        swept = occ.extrude([(2, face)], node["x_high"] - node["x_low"], 0, 0)
        return [entity for entity in swept if entity[0] == 3]
    if kind == "Frustum":
        if node["r0"] == node["r1"]:
            return [(3, occ.addCylinder(*node["base"], *node["axis"], node["r0"]))]
        return [(3, occ.addCone(*node["base"], *node["axis"], node["r0"], node["r1"]))]
    if kind == "Loft":
        return [(3, loft(occ, node["first"], node["second"]))]
    if kind == "Union":
        first, *others = [build(occ, part) for part in node["parts"]]
        rest = [entity for part in others for entity in part]
        return occ.fuse(first, rest)[0] if rest else first
    if kind == "Difference":
        parts = [entity for part in node["parts"] for entity in build(occ, part)]
        return occ.cut(build(occ, node["whole"]), parts)[0]
    if kind == "Placed":
        moved = build(occ, node["solid"])
        occ.rotate(moved, 0, 0, 0, *node["axis"], node["angle"])
        occ.translate(moved, *node["translate"])
        return moved
    solids = [entity for entity in occ.importShapes(node["path"]) if entity[0] == 3]
    if node["unit"] != 1.0:
        occ.dilate(solids, 0, 0, 0, *[node["unit"]] * 3)
    return joined(occ, solids)


def joined(occ, solids: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Solids that share the faces at which they touch, in the order of the file; what two of them fill is one more."""
    if len(solids) < 2:
        return solids
    _, made_of = occ.fragment(solids[:1], solids[1:])
    return list(dict.fromkeys(piece for made in made_of for piece in made if piece[0] == 3))


def loft(occ, first: list, second: list) -> int:
    """The volume between two polygons."""
    rings = [[occ.addPoint(*corner) for corner in ring] for ring in (first, second)]
    around = [[occ.addLine(a, b) for a, b in zip(ring, ring[1:] + ring[:1], strict=True)] for ring in rings]
    along = [occ.addLine(a, b) for a, b in zip(*rings, strict=True)]
    sides = [
        [low, end, -high, -start] for low, high, start, end in zip(*around, along, along[1:] + along[:1], strict=True)
    ]
    faces = [occ.addPlaneSurface([occ.addCurveLoop(loop)]) for loop in (*around, *sides)]
    return occ.addVolume([occ.addSurfaceLoop(faces)])


def split(occ, bodies: list[tuple[int, int]], regions: list[dict]) -> list[list[tuple[int, int]]]:
    """Pieces of each of the bodies, cut along the surfaces of the regions, that share their faces and so their
    nodes."""
    tools = [entity for region in regions for entity in build(occ, region)]
    everything, made_of = occ.fragment(bodies, tools)
    pieces_of = made_of[: len(bodies)]
    kept = {piece for of_body in pieces_of for piece in of_body}
    occ.remove([entity for entity in everything if entity not in kept], recursive=True)
    occ.synchronize()
    return pieces_of


def surface(gmsh, file: str) -> np.ndarray:
    """Corners (k, 3, 3) mm of the triangles of the closed surface in an .npz, which is read into gmsh."""
    with np.load(file) as data:
        X, triangles = data["X"], data["triangles"]
    tag = gmsh.model.addDiscreteEntity(2)
    gmsh.model.mesh.addNodes(2, tag, np.arange(1, len(X) + 1), X.ravel())
    gmsh.model.mesh.addElementsByType(tag, 2, [], triangles.ravel() + 1)
    return X[triangles]


def enclosed_volume(corners: np.ndarray) -> float:
    """Volume mm^3 within a closed surface of triangles (k, 3, 3), by the divergence theorem."""
    a, b, c = corners.swapaxes(0, 1)
    return abs(float(np.einsum("ij,ij->", np.cross(a, b), c))) / 6


def pieces(corners: np.ndarray) -> int:
    """Number of parts of a surface of triangles (k, 3, 3) that share no corner."""
    nodes = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)[1].reshape(-1, 3)
    label = np.arange(nodes.max() + 1)
    for _ in range(len(label)):
        least = label.copy()
        np.minimum.at(least, nodes, label[nodes].min(axis=1)[:, None])
        if (least == label).all():
            break
        label = least
    return len(np.unique(label))


def fill(gmsh, anew: bool) -> None:
    """Makes the volume that the surface in gmsh bounds. anew: the surface is meshed anew too, and not taken as it
    is."""
    if anew:
        # Faces between sharp edges first: else gmsh cuts the whole surface where it likes, and these faces once more.
        for parametrizable in (False, True):
            gmsh.model.mesh.classifySurfaces(math.radians(40), True, parametrizable, math.pi)
        gmsh.model.mesh.createGeometry()
        _keep_curves(gmsh)
    loop = gmsh.model.geo.addSurfaceLoop([tag for _, tag in gmsh.model.getEntities(2)])
    gmsh.model.geo.addVolume([loop])
    gmsh.model.geo.synchronize()


def _keep_curves(gmsh) -> None:
    """Sets sizes along the curves between the faces of a surface: a straight one may be a single edge, a circle six."""
    gmsh.option.setNumber("Mesh.MinimumCurveNodes", 1)
    gmsh.option.setNumber("Mesh.MeshSizeFromParametricPoints", 1)
    for _, curve in gmsh.model.getEntities(1):
        ends = [gmsh.model.getParametrizationBounds(1, curve)[i][0] for i in range(2)]
        points = gmsh.model.getValue(1, curve, np.linspace(*ends, 200)).reshape(-1, 3)
        length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
        size = length / segments(float(np.linalg.norm(points[-1] - points[0])) / length)
        gmsh.model.mesh.setSizeAtParametricPoints(1, curve, ends, [size, size])


def segments(share: float) -> int:
    """Number of edges that keep the shape of a curve whose ends are `share` of its length apart: one for each 60
    degrees by which an arc of that share turns, for which share = sin(turn / 2) / (turn / 2)."""
    low, high = 0.0, 2 * math.pi
    for _ in range(40):
        turn = (low + high) / 2
        low, high = (turn, high) if math.sin(turn / 2) > share * turn / 2 else (low, turn)
    return max(1, math.ceil(3 * high / math.pi - 0.01))


def is_surface(solid: dict) -> bool:
    return solid["kind"] == "SurfaceSolid"


class Separate(ValueError):
    """The geometry is not one body."""


def one_body(gmsh, solid: dict) -> list[tuple[int, int]]:
    """OpenCASCADE entities (3, tag) of a tree of solids: one, or those of a file that touch."""
    bodies = build(gmsh.model.occ, solid)
    gmsh.model.occ.synchronize()
    if not bodies:
        raise ValueError("there is no solid in it, at most surfaces or lines")
    if len(bodies) > 1 and not (solid["kind"] == "File" and hang_together(gmsh, bodies)):
        raise Separate(f"the geometry is {len(bodies)} separate bodies, not one")
    return bodies


def hang_together(gmsh, bodies: list[tuple[int, int]]) -> bool:
    """True where one comes from each body to any other through faces that bodies share."""
    left = [set(gmsh.model.getBoundary([body], oriented=False)) for body in bodies]
    reached = left.pop()
    while near := [faces for faces in left if faces & reached]:
        reached = reached.union(*near)
        left = [faces for faces in left if faces not in near]
    return not left


def measure(gmsh, job: dict) -> dict[str, np.ndarray]:
    """Volume and area, without a mesh."""
    solid = job["solid"]
    if is_surface(solid):
        corners = surface(gmsh, job["surface"])
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        return {"volume": np.array(enclosed_volume(corners)), "area": np.linalg.norm(normals, axis=1).sum() / 2}
    bodies = one_body(gmsh, solid)
    faces = gmsh.model.getBoundary(bodies, oriented=False)  # without those that two of them share
    area, volume = (sum(gmsh.model.occ.getMass(*entity) for entity in entities) for entities in (faces, bodies))
    return {"volume": np.array(volume), "area": np.array(area), "solids": np.array(len(bodies))}


def write(gmsh, solid: dict, files: list[str], deviation: float) -> dict[str, np.ndarray]:
    """Writes the solid into files by their suffix, .step exactly, .stl by triangles `deviation` mm off at most."""
    if len(one_body(gmsh, solid)) > 1:
        raise ValueError("it is of several solids, and a design is written as one: fuse them")
    for file in files:
        if file.endswith(".stl"):
            gmsh.option.setNumber("Mesh.StlLinearDeflection", deviation)
            gmsh.option.setNumber("Mesh.StlLinearDeflectionRelative", 0)
            gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 60)
            gmsh.model.mesh.generate(2)
        gmsh.write(file)
    return {}


def mesh(gmsh, job: dict, limit: Callable[[int], object] = lambda seconds: None) -> dict[str, np.ndarray]:
    """Mesh X (n, 3), cells (m, 4) and CAD volume; the number of cells and the extent where there would be too many.
    limit: told how many s of the processor the meshing may take, before it begins."""
    solid = job["solid"]
    if is_surface(solid):
        corners = surface(gmsh, job["surface"])
        volume, low, high = enclosed_volume(corners), corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    else:
        bodies = one_body(gmsh, solid)
        volume = sum(gmsh.model.occ.getMass(*body) for body in bodies)
        ends = np.array([gmsh.model.getBoundingBox(*body) for body in bodies])
        low, high = ends[:, :3].min(axis=0), ends[:, 3:].max(axis=0)
    about = cells_wanted(volume, low, high, job)
    if not about <= job["max_cells"] or job["size"] > 1.01 * (high - low).max():
        return {"about": np.array(about), "extent": high - low}
    limit(job["patience"] * processor_time(about, job))
    pieces_of = []
    if is_surface(solid):
        fill(gmsh, job["anew"])
    else:
        pieces_of = split(gmsh.model.occ, bodies, job["regions"]) if job["regions"] else [[body] for body in bodies]
    _sizes(gmsh, job)
    gmsh.model.mesh.generate(3)
    gmsh.model.mesh.optimize("Netgen")
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    numbers, cells = gmsh.model.mesh.getElementsByType(4)
    if len(cells) == 0:
        count = pieces(corners) if is_surface(solid) else 1
        raise ValueError(f"the surface is {count} separate pieces and encloses no one volume" if count > 1 else _EMPTY)
    used, cells = np.unique(cells, return_inverse=True)
    order = np.argsort(tags)
    X = coordinates.reshape(-1, 3)[order][np.searchsorted(tags[order], used)]
    lost = float((high - low - np.ptp(X, axis=0)).max())
    if is_surface(solid) and lost > _LOST * job["size"]:  # the box around a CAD solid need not be tight
        raise ValueError(f"gmsh left out an end of the body: the mesh is {lost:.3g} mm shorter")
    answer = {"X": X, "cells": cells.reshape(-1, 4), "volume": np.array(volume)}
    return answer | ({"solid": solid_of_cells(gmsh, numbers, pieces_of)} if len(pieces_of) > 1 else {})


def solid_of_cells(gmsh, numbers: np.ndarray, pieces_of: list[list[tuple[int, int]]]) -> np.ndarray:
    """Which solid, from 0 on, each tetrahedron (m,) of these numbers is of; pieces_of: the entities of each solid."""
    of_cells = np.zeros(len(numbers), dtype=np.int64)
    for solid, entities in enumerate(pieces_of):
        for _, tag in entities:
            of_cells[np.isin(numbers, gmsh.model.mesh.getElementsByType(4, tag)[0])] = solid
    return of_cells


def cells_wanted(volume: float, low: np.ndarray, high: np.ndarray, job: dict) -> float:
    """Number of cells, about, with which these sizes fill a body between two corners: regular tetrahedra of edge h hold
    h^3 / 8.485 each. A box of finer cells counts as if the body filled it."""
    about = volume / job["size"] ** 3
    for box in job["refine"]:
        sides = np.minimum(high, box["high"]) - np.maximum(low, box["low"])
        about += min(volume, np.maximum(sides, 0).prod()) / box["size"] ** 3
    return 8.485 * about


def processor_time(about: float, job: dict) -> int:
    """s of the processor, many times what gmsh needs for about so many cells, or for those of the grading."""
    if job.get("grading"):
        cells = np.array(job["grading"][:-2]).reshape(-1, 4, 4)
        volumes = np.abs(np.linalg.det(cells[:, :3, 1:] - cells[:, :3, :1])) / 6
        about = max(about, 8.485 * float((volumes / cells[:, 3].mean(axis=1) ** 3).sum()))
    return math.ceil(_START + about / _PACE)


def end_after(seconds: int) -> None:
    """SIGXCPU ends this process after so many more s of the processor, where the system knows it."""
    try:
        import resource
    except ImportError:
        return
    used = math.ceil(time.process_time())
    _, most = resource.getrlimit(resource.RLIMIT_CPU)
    if most == resource.RLIM_INFINITY or used + seconds < most:
        resource.setrlimit(resource.RLIMIT_CPU, (used + seconds, most))


def _sizes(gmsh, job: dict) -> None:
    """Sets the sizes of cells: the smallest of the general one, those of the boxes, and those of the grading."""
    values = {"MeshSizeMax": job["size"], "MeshSizeExtendFromBoundary": 0, "MeshSizeFromPoints": 0}
    for option, value in (values | {"MeshSizeFactor": job["factor"], "MeshSizeFromCurvature": job["around"]}).items():
        gmsh.option.setNumber(f"Mesh.{option}", value)
    fields = []
    for box in job["refine"]:
        field = gmsh.model.mesh.field.add("Box")
        sides = zip(("XMin", "YMin", "ZMin", "XMax", "YMax", "ZMax"), box["low"] + box["high"], strict=True)
        values = {"VIn": box["size"], "VOut": job["size"], "Thickness": box["blend"], **dict(sides)}
        for name, value in values.items():
            gmsh.model.mesh.field.setNumber(field, name, value)
        fields.append(field)
    if job.get("grading"):
        view = gmsh.view.add("sizes")
        gmsh.view.addListData(view, "SS", len(job["grading"]), [value for row in job["grading"] for value in row])
        field = gmsh.model.mesh.field.add("PostView")
        gmsh.model.mesh.field.setNumber(field, "ViewTag", view)
        fields.append(field)
    if fields:
        smallest = gmsh.model.mesh.field.add("Min")
        gmsh.model.mesh.field.setNumbers(smallest, "FieldsList", fields)
        gmsh.model.mesh.field.setAsBackgroundMesh(smallest)


def end_with_parent() -> None:
    """Waits for the end of stdin. Not through sys.stdin, whose lock would be held when the interpreter shuts down."""
    while os.read(0, 4096):
        pass
    os._exit(12)


def main() -> int:
    """Answers the job named on the command line and returns the exit code."""
    try:
        import gmsh
    except (ImportError, OSError) as error:
        print(error, file=sys.stderr)
        return 10
    threading.Thread(target=end_with_parent, daemon=True).start()
    gmsh.initialize(["gmsh", "-nt", "1"], interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("Mesh.RandomSeed", 1)
        job = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
        if job.get("write"):
            answer = write(gmsh, job["solid"], job["write"], job["deviation"])
        else:
            answer = measure(gmsh, job) if job["size"] is None else mesh(gmsh, job, end_after)
    except Separate as error:
        print(error, file=sys.stderr)
        return 13
    except Exception as error:  # gmsh raises bare Exception
        print(error, file=sys.stderr)
        return 11
    finally:
        gmsh.finalize()
    np.savez(sys.argv[2], **answer)
    return 0


if __name__ == "__main__":
    sys.exit(main())
