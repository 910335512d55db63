"""The surface of a mesh in files for CAD (.step, a solid of flat triangles) and for printing (.stl), in mm.

A robot with a free form has no CAD tree: its shape is its mesh. ISO 10303-42 (geometry) and -21 (text) have what a
faceted solid in a file is made of."""

from pathlib import Path

import numpy as np

from cfem.constraint.surface import triangulated
from cfem.contact.surface.facets import components
from cfem.contact.surface.triangles import normals_of, volumes_within
from cfem.core.artefact.files import write_whole
from cfem.core.errors import SpecError
from cfem.mechanics.mesh import Mesh

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
    used, numbers = np.unique(triangulated(facets[:, :3] if facets.shape[1] == 6 else facets), return_inverse=True)
    return mesh.X[used], numbers.reshape(-1, 3)


def write_faceted(mesh: Mesh, name: str, file: Path) -> None:
    """Writes the boundary as .stl or .step, by the file's suffix. SpecError where a STEP file would hold several
    bodies."""
    X, corners = triangles(mesh)
    if file.suffix == ".stl":
        write_whole(file, _stl(X, corners))
        return
    write_whole(file, _step(X, _shells(X, corners), name).encode("ascii"))


def _shells(X: np.ndarray, corners: np.ndarray) -> list[np.ndarray]:
    """The triangles of the outer surface, then of each closed cavity, whose normals point into the cavity."""
    _, shell = components(corners)
    volumes = volumes_within(X, corners, shell)  # negative of a cavity
    bodies = int((volumes > 0).sum())
    if bodies != 1:
        what = f"the mesh is {bodies} separate bodies, and a STEP file holds one"
        raise SpecError(what, where="cad", do="use its STL file")
    return [corners[shell == number] for number in np.argsort(volumes)[::-1]]


def _normals(X: np.ndarray, corners: np.ndarray) -> np.ndarray:
    normal = normals_of(X[corners])
    return normal / np.linalg.norm(normal, axis=1)[:, None]


def _stl(X: np.ndarray, corners: np.ndarray) -> bytes:
    """Content of a binary STL file: a header of 80 bytes, the number of triangles, 50 bytes for each."""
    record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")])
    records = np.zeros(len(corners), dtype=record)
    records["normal"], records["corners"] = _normals(X, corners), X[corners]
    return b"cfem, mm".ljust(80) + np.uint32(len(corners)).astype("<u4").tobytes() + records.tobytes()


def _step(X: np.ndarray, shells: list[np.ndarray], name: str) -> str:
    """Text of a STEP file of a solid between flat triangles: the outer shell, then those of its cavities."""
    step = _StepText(X)
    outer = step.shell(shells[0])
    # a cavity is a shell whose normals point out of the cavity, turned round
    voids = [step.add(f"ORIENTED_CLOSED_SHELL('',*,#{step.shell(cavity[:, ::-1])},.F.)") for cavity in shells[1:]]
    if voids:
        solid = step.add(f"BREP_WITH_VOIDS('{name}',#{outer},{_references(voids)})")
    else:
        solid = step.add(f"MANIFOLD_SOLID_BREP('{name}',#{outer})")
    shape = step.add(f"ADVANCED_BREP_SHAPE_REPRESENTATION('{name}',(#{solid}),#13)")
    step.add(f"SHAPE_DEFINITION_REPRESENTATION(#8,#{shape})")
    return _HEAD.format(name=name) + "\n".join(step.lines) + "\nENDSEC;\nEND-ISO-10303-21;\n"


class _StepText:
    """Numbered lines of a STEP file after its head, which ends at #13."""

    def __init__(self, X: np.ndarray):
        """Begins with the vertices X (n, 3) mm."""
        self.lines: list[str] = []
        self._X = X
        self._points = [self.add(f"CARTESIAN_POINT('',{_triple(x)})") for x in X]
        self._vertices = [self.add(f"VERTEX_POINT('',#{point})") for point in self._points]
        self._edges: dict[tuple[int, int], int] = {}

    def add(self, text: str) -> int:
        """Appends an entity and returns its number."""
        number = 14 + len(self.lines)
        self.lines.append(f"#{number}={text};")
        return number

    def shell(self, corners: np.ndarray) -> int:
        """Number of the closed shell of triangles (m, 3), each a plane face within a loop of three edges."""
        along = self._X[corners[:, 1]] - self._X[corners[:, 0]]
        along /= np.linalg.norm(along, axis=1)[:, None]
        faces = []
        for nodes, normal, first_side in zip(corners.tolist(), _normals(self._X, corners), along, strict=True):
            sides = [self._oriented_edge(a, b) for a, b in zip(nodes, nodes[1:] + nodes[:1], strict=True)]
            loop = self.add(f"EDGE_LOOP('',{_references(sides)})")
            bound = self.add(f"FACE_OUTER_BOUND('',#{loop},.T.)")
            axis, reference = (self.add(f"DIRECTION('',{_triple(unit)})") for unit in (normal, first_side))
            place = self.add(f"AXIS2_PLACEMENT_3D('',#{self._points[nodes[0]]},#{axis},#{reference})")
            plane = self.add(f"PLANE('',#{place})")
            faces.append(self.add(f"ADVANCED_FACE('',(#{bound}),#{plane},.T.)"))
        return self.add(f"CLOSED_SHELL('',{_references(faces)})")

    def _oriented_edge(self, a: int, b: int) -> int:
        """Number of the edge from vertex a to b; the edge itself runs from the smaller vertex to the larger."""
        ends = low, high = min(a, b), max(a, b)
        if ends not in self._edges:
            span = self._X[high] - self._X[low]
            length = float(np.linalg.norm(span))
            direction = self.add(f"DIRECTION('',{_triple(span / length)})")
            vector = self.add(f"VECTOR('',#{direction},{_real(length)})")
            line = self.add(f"LINE('',#{self._points[low]},#{vector})")
            self._edges[ends] = self.add(f"EDGE_CURVE('',#{self._vertices[low]},#{self._vertices[high]},#{line},.T.)")
        return self.add(f"ORIENTED_EDGE('',*,*,#{self._edges[ends]},{'.T.' if a < b else '.F.'})")


def _references(numbers: list[int]) -> str:
    """Text '(#1,#2,...)' of entities by number."""
    return "(" + ",".join(f"#{number}" for number in numbers) + ")"


def _triple(values: np.ndarray) -> str:
    """Text '(x,y,z)' of three real numbers."""
    return "(" + ",".join(_real(value) for value in values) + ")"


def _real(value: float) -> str:
    """Text of a real number, which has a decimal point in a STEP file."""
    text = f"{value:.12G}"
    mantissa, mark, exponent = text.partition("E")
    return (mantissa if "." in mantissa else mantissa + ".") + mark + exponent
