"""Small bodies, as meshes and as files, without a mesh generator."""

import meshio
import numpy as np
from scipy.spatial.transform import Rotation
from support.blocks import block, hexahedra

from cfem.init.body.shape import Shape
from cfem.mechanics.mesh import Mesh, boundary_facets


def tapered(length=60.0, wide=12.0, thin=8.0, taper=0.5, bend=5.0, divisions=(4, 3, 12)) -> Shape:
    """A bar along z whose sides shrink by `taper` towards its end, its middle displaced along x in an arc of `bend`."""
    mesh = block((wide, thin, length), divisions)
    X = mesh.X - [wide / 2, thin / 2, 0]
    share = X[:, 2] / length
    X[:, :2] *= (1 - taper * share)[:, None]
    X[:, 0] += bend * 4 * share * (1 - share)
    return Shape(Mesh(X, mesh.cells, mesh.facets), 4.0)


def box_shape(size=(60.0, 10.0, 10.0), divisions=(12, 2, 2), **sets) -> Shape:
    mesh = block(size, divisions)
    return Shape(Mesh(mesh.X, mesh.cells, mesh.facets, **sets), 5.0)


def inclined(shape: Shape, degrees=30.0) -> Shape:
    """A shape turned about (1, 1, 1), in single precision and far from the origin, as files of surfaces have it."""
    turn = Rotation.from_rotvec(np.radians(degrees) * np.ones(3) / np.sqrt(3))
    X = (turn.apply(shape.mesh.X) + [300.0, -200.0, 100.0]).astype(np.float32).astype(float)
    return Shape(Mesh(X, shape.mesh.cells, shape.mesh.facets), shape.size)


def tube(length=60.0, side=12.0, wall=3.0) -> Shape:
    """A square tube along z, open at both ends."""
    mesh = block((side, side, length), (4, 4, 10))
    centre = mesh.X[mesh.cells].mean(axis=1)
    return _part(mesh, (np.abs(centre[:, :2] - side / 2) > side / 2 - wall).any(axis=1), 3.0)


def corner(leg=60.0, side=10.0, n=12) -> Shape:
    """An L in the plane z = 0 of two legs, along x and along y."""
    mesh = block((leg, leg, side), (n, n, 2))
    return _part(mesh, ~(mesh.X[mesh.cells].mean(axis=1)[:, :2] > side).all(axis=1), 5.0)


def frame(edge=60.0, side=10.0, n=12) -> Shape:
    """A square ring in the plane z = 0."""
    mesh = block((edge, edge, side), (n, n, 2))
    centre = mesh.X[mesh.cells].mean(axis=1)[:, :2]
    return _part(mesh, (np.abs(centre - edge / 2) > edge / 2 - side).any(axis=1), 5.0)


def tee(bar=72.0, stem=60.0, side=10.0, n=12) -> Shape:
    """A T in the plane z = 0: a bar along x, and a stem along y from its middle."""
    mesh = block((bar, stem, side), (n, n, 2))
    x, y = mesh.X[mesh.cells].mean(axis=1)[:, :2].T
    return _part(mesh, (y < side) | (np.abs(x - bar / 2) < 1.2 * side / 2), 5.0)


def discs(side=20.0, neck=8.0, thick=4.0, count=5, pitch=16.0) -> Shape:
    """Square discs on a square backbone along z."""
    height = (count - 1) * pitch + thick
    mesh = block((side, side, height), (10, 10, int(height / 2)))
    x, y, z = mesh.X[mesh.cells].mean(axis=1).T
    on_backbone = (np.abs(np.stack([x, y]) - side / 2) < neck / 2).all(axis=0)
    return _part(mesh, on_backbone | (z % pitch < thick), 4.0)


def holed(length=60.0, side=12.0, hole=2.0, gaps=()) -> Shape:
    """A bar along x with a square channel near its upper side, and gaps (start, end) down to half its height."""
    mesh = block((length, side, side), (30, 12, 12))
    x, y, z = mesh.X[mesh.cells].mean(axis=1).T
    channel = (np.abs(y - side / 2) < hole / 2) & (np.abs(z - 0.75 * side) < hole / 2)
    gap = np.any([(x > a) & (x < b) & (z > side / 2) for a, b in gaps], axis=0) if gaps else np.zeros(len(x), bool)
    return _part(mesh, ~channel & ~gap, 2.0)


def chambered(size=(40.0, 12.0, 12.0), rooms=((4.0, 16.0), (22.0, 36.0))) -> Shape:
    """A box along x with closed rooms from x to x, walls of 3."""
    mesh = block(size, (20, 4, 4))
    x, y, z = mesh.X[mesh.cells].mean(axis=1).T
    middle = (np.abs(y - size[1] / 2) < size[1] / 2 - 3) & (np.abs(z - size[2] / 2) < size[2] / 2 - 3)
    return _part(mesh, ~(middle & np.any([(x > a) & (x < b) for a, b in rooms], axis=0)), 3.0)


def twin(size=(40.0, 15.0, 8.0)) -> Shape:
    """A box along x with two closed rooms side by side, a thin wall between them."""
    mesh = block(size, (20, 15, 8))
    x, y, z = mesh.X[mesh.cells].mean(axis=1).T
    aside = np.abs(y - size[1] / 2)
    void = (x > 4) & (x < 36) & (aside > 0.5) & (aside < 5.5) & (z > 2) & (z < 6)
    return _part(mesh, ~void, 3.0)


def star(arm=60.0, width=30.0, thick=6.0) -> Shape:
    """A plate of three arms in the plane z = 0, one of them along y."""
    mesh = block((2 * arm, 1.8 * arm, thick), (30, 27, 2))
    x, y = mesh.X[mesh.cells].mean(axis=1)[:, :2].T - np.array([[arm], [0.8 * arm]])
    angles = np.radians([90, 210, 330])[:, None]
    out, aside = np.cos(angles) * x + np.sin(angles) * y, np.sin(angles) * x - np.cos(angles) * y
    return _part(mesh, ((out > -width / 3) & (out < arm) & (np.abs(aside) < width / 2)).any(axis=0), 5.0)


def cage(side=60.0, height=50.0, strut=10.0) -> Shape:
    """Two square frames that cross at top and bottom: four legs along y join the crossings."""
    mesh = block((side, height, side), (12, 10, 12))
    x, y, z = mesh.X[mesh.cells].mean(axis=1).T - np.array([side, height, side])[:, None] / 2
    rim = (np.abs(y) > height / 2 - strut) | (np.maximum(np.abs(x), np.abs(z)) > side / 2 - strut)
    return _part(mesh, rim & ((np.abs(x) < strut / 2) | (np.abs(z) < strut / 2)), 5.0)


def _part(mesh: Mesh, kept: np.ndarray, size: float) -> Shape:
    used, cells = np.unique(mesh.cells[kept], return_inverse=True)
    cells = cells.reshape(-1, 4)
    return Shape(Mesh(mesh.X[used], cells, boundary_facets(cells)), size)


def write_stl(path, size=(60.0, 10.0, 10.0), facets=slice(None)) -> None:
    mesh = block(size, (6, 1, 1))
    meshio.write(path, meshio.Mesh(mesh.X, [("triangle", mesh.facets[facets])]), binary=False)


def write_cells(path, element="tet4", size=(60.0, 10.0, 10.0)) -> None:
    """A mesh file with the node set `wall` at x = 0."""
    mesh = block(size, (12, 2, 2)) if element == "tet4" else hexahedra(size, (12, 2, 2))
    flags = {"set:wall": (mesh.X[:, 0] == 0).astype(np.int8)}
    kind = "tetra" if element == "tet4" else "hexahedron"
    meshio.write(path, meshio.Mesh(mesh.X, [(kind, mesh.cells)], point_data=flags))


def lattice(side=24.0, strut=4.0, count=5, pitch=16.0) -> Shape:
    """Square rings along z that a strut joins at each corner."""
    height = (count - 1) * pitch + strut
    mesh = block((side, side, height), (6, 6, int(height / 4)))
    x, y, z = mesh.X[mesh.cells].mean(axis=1).T
    at_side = np.abs(np.stack([x, y]) - side / 2) > side / 2 - strut
    return _part(mesh, at_side.all(axis=0) | ((z % pitch < strut) & at_side.any(axis=0)), 4.0)
