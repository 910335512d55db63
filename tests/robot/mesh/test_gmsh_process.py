"""What the process around gmsh makes of gmsh's answers."""

from unittest.mock import MagicMock

import numpy as np
import pytest
from support.blocks import block

from cfem.robot.mesh.gmsh_process import mesh


@pytest.mark.parametrize(("length", "kept"), [(30.0, True), (28.0, True), (24.0, False)])
def test_a_mesh_that_lacks_an_end_of_the_body_is_refused(tmp_path, length, kept):
    """A bar of 30 mm in cells of 10 mm; gmsh answers with one of `length`."""
    body, answer = block((30.0, 5.0, 5.0), (6, 1, 1)), block((length, 5.0, 5.0), (6, 1, 1))
    np.savez(tmp_path / "surface.npz", X=body.X, triangles=body.facets)
    gmsh = MagicMock()
    gmsh.model.mesh.getNodes.return_value = (np.arange(len(answer.X)) + 1, answer.X.ravel(), None)
    gmsh.model.mesh.getElementsByType.return_value = (None, answer.cells.ravel() + 1)
    job = {
        "solid": {"kind": "SurfaceSolid"},
        "surface": str(tmp_path / "surface.npz"),
        "size": 10.0,
        "factor": 1.0,
        "anew": True,
        "refine": [],
        "max_cells": 1e6,
    }
    if kept:
        assert len(mesh(gmsh, job)["cells"]) == len(answer.cells)
        return
    with pytest.raises(ValueError, match="left out an end of the body: the mesh is 6 mm shorter"):
        mesh(gmsh, job)
