"""The surface of a mesh in files for CAD (.step, a solid of flat triangles) and for printing (.stl), in mm.

A robot with a free form has no CAD tree: its shape is its mesh. ISO 10303-42 (geometry) and -21 (text) have what a
faceted solid in a file is made of."""

from pathlib import Path

import numpy as np

from cfem.core.artefact.files import write_whole
from cfem.core.errors import SpecError
from cfem.mechanics.mesh import Mesh

_NONE = "''"  # no name
_HEAD = """ISO-10303-21;
HEADER;
FILE_DESCRIPTION(('triangles of a finite-element mesh, mm'),'2;1');
FILE_NAME('{name}','',(''),(''),'','cfem','');
FILE_SCHEMA(('AUTOMOTIVE_DESIGN {{ 1 0 10303 214 1 1 1 1 }}'));
ENDSEC;
DATA;
#1=APPLICATION_CONTEXT('automotive design');
#2=APPLICATION_PROTOCOL_DEFINITION('international standard','automotive_design',2000,#1);
#3=PRODUCT_CONTEXT('',#1,'mechanical');
#4=PRODUCT('{name}','{name}','',(#3));
#5=PRODUCT_DEFINITION_FORMATION('','',#4);
#6=PRODUCT_DEFINITION_CONTEXT('part definition',#1,'design');
#7=PRODUCT_DEFINITION('design','',#5,#6);
#8=PRODUCT_DEFINITION_SHAPE('','',#7);
#9=(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.));
#10=(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.));
#11=(NAMED_UNIT(*)SI_UNIT($,.STERADIAN.)SOLID_ANGLE_UNIT());
#12=UNCERTAINTY_MEASURE_WITH_UNIT(LENGTH_MEASURE(1.E-6),#9,'distance_accuracy_value','');
#13=(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT((#12))\
GLOBAL_UNIT_ASSIGNED_CONTEXT((#9,#10,#11))REPRESENTATION_CONTEXT('',''));
"""


def triangles(mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    """Corners X (k, 3) mm and triangles (m, 3) of the boundary, normals outward; quadrilaterals cut in two. The middle
    nodes of edges lie on them and are left out."""
    facets = mesh.facets
    flat = np.vstack([facets[:, [0, 1, 2]], facets[:, [0, 2, 3]]]) if facets.shape[1] == 4 else facets[:, :3]
    used, numbers = np.unique(flat, return_inverse=True)
    return mesh.X[used], numbers.reshape(flat.shape)


def write_faceted(mesh: Mesh, name: str, file: Path) -> None:
    """By the suffix of the file, .stl or .step. SpecError where a STEP file would hold several bodies."""
    X, corners = triangles(mesh)
    if file.suffix == ".stl":
        write_whole(file, _stl(X, corners))
        return
    write_whole(file, _step(X, _shells(X, corners), name).encode("ascii"))


def _shells(X: np.ndarray, corners: np.ndarray) -> list[np.ndarray]:
    """The triangles of the outer surface, then of each closed cavity, whose normals point into the cavity."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    rows, columns = corners[:, [0, 1]].ravel(), corners[:, [1, 2]].ravel()
    count, of = connected_components(coo_array((np.ones(len(rows)), (rows, columns)), (len(X), len(X))), directed=False)
    shells = [corners[of[corners[:, 0]] == number] for number in range(count)]
    enclosed = [float(np.linalg.det(X[each]).sum()) for each in shells]  # six volumes, negative of a cavity
    shells = [shells[i] for i in np.argsort(enclosed)[::-1]]
    if sum(one > 0 for one in enclosed) != 1:
        what = f"the mesh is {sum(one > 0 for one in enclosed)} separate bodies, and a STEP file holds one"
        raise SpecError(what, where="cad", do="use its STL file")
    return shells


def _normals(X: np.ndarray, corners: np.ndarray) -> np.ndarray:
    a, b, c = (X[corners[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    return normal / np.linalg.norm(normal, axis=1)[:, None]


def _stl(X: np.ndarray, corners: np.ndarray) -> bytes:
    """Binary."""
    kind = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("more", "<u2")])
    found = np.zeros(len(corners), dtype=kind)
    found["normal"], found["corners"] = _normals(X, corners), X[corners]
    return b"cfem, mm".ljust(80) + np.uint32(len(corners)).astype("<u4").tobytes() + found.tobytes()


def _step(X: np.ndarray, shells: list[np.ndarray], name: str) -> str:
    lines, number = [], 13

    def add(text: str) -> int:
        nonlocal number
        number += 1
        lines.append(f"#{number}={text};")
        return number

    def triple(values: np.ndarray) -> str:
        return "(" + ",".join(_real(value) for value in values) + ")"

    points = [add(f"CARTESIAN_POINT('',{triple(x)})") for x in X]
    vertices = [add(f"VERTEX_POINT('',#{point})") for point in points]
    edges: dict[tuple[int, int], int] = {}

    def edge(a: int, b: int) -> int:
        """Oriented from a to b; the edge itself from the smaller number to the larger."""
        ends = (min(a, b), max(a, b))
        if ends not in edges:
            way = X[ends[1]] - X[ends[0]]
            size = float(np.linalg.norm(way))
            vector = add(f"VECTOR('',#{add(f'DIRECTION({_NONE},{triple(way / size)})')},{_real(size)})")
            line = add(f"LINE('',#{points[ends[0]]},#{vector})")
            edges[ends] = add(f"EDGE_CURVE('',#{vertices[ends[0]]},#{vertices[ends[1]]},#{line},.T.)")
        return add(f"ORIENTED_EDGE('',*,*,#{edges[ends]},{'.T.' if a < b else '.F.'})")

    def closed(corners: np.ndarray) -> int:
        along = X[corners[:, 1]] - X[corners[:, 0]]
        along /= np.linalg.norm(along, axis=1)[:, None]
        faces = []
        for corner, normal, first in zip(corners.tolist(), _normals(X, corners), along, strict=True):
            sides = [edge(a, b) for a, b in zip(corner, corner[1:] + corner[:1], strict=True)]
            loop = add("EDGE_LOOP('',(" + ",".join(f"#{side}" for side in sides) + "))")
            bound = add(f"FACE_OUTER_BOUND('',#{loop},.T.)")
            up, side = (add(f"DIRECTION('',{triple(one)})") for one in (normal, first))
            place = add(f"AXIS2_PLACEMENT_3D('',#{points[corner[0]]},#{up},#{side})")
            plane = add(f"PLANE('',#{place})")
            faces.append(add(f"ADVANCED_FACE('',(#{bound}),#{plane},.T.)"))
        return add("CLOSED_SHELL('',(" + ",".join(f"#{one}" for one in faces) + "))")

    outer = closed(shells[0])
    # a cavity is a shell whose normals point out of the cavity, turned round
    voids = [add(f"ORIENTED_CLOSED_SHELL('',*,#{closed(each[:, ::-1])},.F.)") for each in shells[1:]]
    if voids:
        solid = add(f"BREP_WITH_VOIDS('{name}',#{outer},(" + ",".join(f"#{one}" for one in voids) + "))")
    else:
        solid = add(f"MANIFOLD_SOLID_BREP('{name}',#{outer})")
    shape = add(f"ADVANCED_BREP_SHAPE_REPRESENTATION('{name}',(#{solid}),#13)")
    add(f"SHAPE_DEFINITION_REPRESENTATION(#8,#{shape})")
    return _HEAD.format(name=name) + "\n".join(lines) + "\nENDSEC;\nEND-ISO-10303-21;\n"


def _real(value: float) -> str:
    """A real number of the file has a decimal point."""
    text = f"{value:.12G}"
    mantissa, mark, exponent = text.partition("E")
    return (mantissa if "." in mantissa else mantissa + ".") + mark + exponent
