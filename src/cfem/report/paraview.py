"""Shapes over time as files that ParaView opens: one .vtu a shape, and a .pvd that says when each of them is.

Formats: https://docs.vtk.org/en/latest/vtk_file_formats/vtkxml_file_format.html and
https://www.paraview.org/Wiki/ParaView/Data_formats#PVD_File_Format. Paths in a .pvd are relative to it."""

import base64
import struct
import xml.etree.ElementTree as ET
import zlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from cfem.core.artefact.files import write_whole
from cfem.report.shape_history import ShapeHistory

CELLS = {3: 5, 4: 9, 6: 22}  # VTK's number of a facet by its nodes: triangle, quad, quadratic triangle
TYPES = {"f8": "Float64", "f4": "Float32", "i8": "Int64", "u1": "UInt8"}


def write_series(folder: Path, name: str, history: ShapeHistory) -> str:
    """Name of the .pvd that was written, with its shapes in the folder `name` beside it."""
    collection = ET.Element("Collection")
    (folder / name).mkdir()
    for place, (seconds, x) in enumerate(zip(history.times, history.x, strict=True)):
        file = f"{name}/{place:04d}.vtu"
        facts = {"TimeValue": seconds} | {key: values[place] for key, values in history.facts.items()}
        write_whole(folder / file, vtu(x, x - history.rest, history.facets, facts))
        ET.SubElement(collection, "DataSet", timestep=repr(float(seconds)), part="0", file=file)
    root = _file("Collection")
    root.append(collection)
    write_whole(folder / f"{name}.pvd", _bytes(root))
    return f"{name}.pvd"


def vtu(x: np.ndarray, displacement: np.ndarray, facets: np.ndarray, facts: Mapping[str, np.ndarray]) -> bytes:
    """Surface as a VTK file: x, displacement (m, 3) mm; facets (t, k) nodes of triangles, quads or quadratic triangles;
    facts: numbers of the whole, as field data."""
    root = _file("UnstructuredGrid", compressor="vtkZLibDataCompressor", header_type="UInt32")
    grid = ET.SubElement(root, "UnstructuredGrid")
    field_data = ET.SubElement(grid, "FieldData")
    for key, values in facts.items():
        row = np.atleast_2d(np.asarray(values, "f8"))
        _array(field_data, key, row, NumberOfTuples="1")
    piece = ET.SubElement(grid, "Piece", NumberOfPoints=str(len(x)), NumberOfCells=str(len(facets)))
    _array(ET.SubElement(piece, "PointData", Vectors="displacement"), "displacement", displacement.astype("f4"))
    _array(ET.SubElement(piece, "Points"), "Points", x.astype("f4"))
    cells, corners = ET.SubElement(piece, "Cells"), facets.shape[1]
    _array(cells, "connectivity", facets.ravel().astype("i8"))
    _array(cells, "offsets", corners * np.arange(1, len(facets) + 1, dtype="i8"))
    _array(cells, "types", np.full(len(facets), CELLS[corners], dtype="u1"))
    return _bytes(root)


def _file(kind: str, **how: str) -> ET.Element:
    return ET.Element("VTKFile", type=kind, version="1.0", byte_order="LittleEndian", **how)


def _array(parent: ET.Element, name: str, values: np.ndarray, **how: str) -> None:
    """Appends an array as one zlib block after a header of its sizes, both in base64."""
    kind = TYPES[values.dtype.str[1:]]
    if values.ndim == 2:
        how["NumberOfComponents"] = str(values.shape[1])
    raw = np.ascontiguousarray(values, dtype=values.dtype.newbyteorder("<")).tobytes()
    packed = zlib.compress(raw)
    header = struct.pack("<4I", 1, len(raw), 0, len(packed))
    array = ET.SubElement(parent, "DataArray", type=kind, Name=name, format="binary", **how)
    array.text = (base64.b64encode(header) + base64.b64encode(packed)).decode()


def _bytes(root: ET.Element) -> bytes:
    return ET.tostring(root, encoding="utf-8", xml_declaration=True)
