"""Products of a design: its shape for CAD and for printing, and its controller."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cfem.condensed.parameters import Parameter
from cfem.core.errors import SpecError
from cfem.export.firmware.embedding import embedding, write_embedded
from cfem.export.spec import CSpec
from cfem.mechanics.mesh import Mesh
from cfem.parametric.meshes import Meshes
from cfem.predict.load import read_model, read_vectors
from cfem.robot.catalogue.solids import CATALOGUE
from cfem.robot.mesh.faceted import write_faceted
from cfem.robot.mesh.meshing import write_cad
from cfem.robot.spec import SceneSpec
from cfem.sample.parameters import with_values


def file_name(design: str) -> str:
    return design.replace(" ", "-")


def write_shapes(
    folder: Path,
    designs: Mapping[str, np.ndarray],
    parameters: Sequence[Parameter],
    scene: SceneSpec | None,
    mesh: Mesh | None,
) -> str | None:
    """Writes `<name>.step` and `<name>.stl` of each design p (n_p,). mesh: the scene's, from which designs with a free
    form are deformed: their files hold its flat triangles, and the text that is returned says so."""
    if scene is None:
        raise SpecError("the shapes of designs need the key `scene`", where="cad", do="name it under `scene`")
    if scene.shape is not None:
        return _faceted(folder, designs, parameters, scene, mesh)
    if type(scene.geometry) not in CATALOGUE:
        raise SpecError(f"a geometry of kind {scene.geometry.kind} cannot be varied", where="cad", do="leave `cad` out")
    for name, p in designs.items():
        geometry = with_values(scene, [parameter.key for parameter in parameters], p).geometry
        files = [folder / f"{file_name(name)}{suffix}" for suffix in (".step", ".stl")]
        write_cad(CATALOGUE[type(geometry)](geometry), files)
    return None


def _faceted(
    folder: Path,
    designs: Mapping[str, np.ndarray],
    parameters: Sequence[Parameter],
    scene: SceneSpec,
    mesh: Mesh | None,
) -> str:
    """Writes the flat triangles of deformed designs, and returns a line that says so."""
    if mesh is None:
        raise SpecError("the shapes of designs with a free form need the key `mesh`", where="cad", do="name it")
    varied = [not parameter.exact for parameter in parameters]
    family = Meshes(scene, mesh, parameters)
    count = 0
    for name, p in designs.items():
        made = family.of(np.asarray(p)[varied])[1].body.mesh
        count = len(made.facets)
        for suffix in (".step", ".stl"):
            write_faceted(made, file_name(name), folder / f"{file_name(name)}{suffix}")
    return f"the STEP and STL files hold the {count} flat facets of the mesh: a free form has no exact CAD model"


def write_controllers(
    folder: Path,
    designs: Mapping[str, np.ndarray],
    parameters: Sequence[Parameter],
    model: Path,
    spec: CSpec,
    scene: SceneSpec | None,
) -> dict[str, dict[str, Any]]:
    """Writes `<name>-controller` of each design p (n_p,), the C code of `cfem export`; returns bytes and parity of
    each."""
    meta, arrays = read_model(model)
    s = read_vectors(model, meta)["s"]
    # a share of 1 may round to beyond
    low, high = np.array([(parameter.low, parameter.high) for parameter in parameters]).T
    reports = {}
    for name, p in designs.items():
        values = {
            parameter.name: f"{value!r}{parameter.suffix}" if parameter.suffix else value
            for parameter, value in zip(parameters, np.clip(p, low, high).tolist(), strict=True)
        }
        design_spec = spec.model_copy(update={"parameters": values})
        controller_folder = folder / f"{file_name(name)}-controller"
        report = write_embedded(controller_folder, design_spec, meta, arrays, s, embedding(meta, design_spec, scene))
        reports[name] = {key: report[key] for key in ("coefficient_bytes", "parity")}
    return reports
