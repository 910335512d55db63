"""A body in files for CAD and printers, read back."""

import numpy as np
import pytest

from cfem.robot.cad import Box, Difference, File, Frustum, SurfaceSolid
from cfem.robot.mesh.meshing import measure, write_cad

BLOCK = Difference(Box((0.0, 0.0, 0.0), (20.0, 10.0, 10.0)), (Frustum((10.0, 5.0, -1.0), (0.0, 0.0, 12.0), 3.0, 3.0),))
VOLUME = 2000 - 90 * np.pi


def test_a_bored_block_is_what_the_files_hold(tmp_path):
    step, stl = tmp_path / "block.step", tmp_path / "block.stl"
    write_cad(BLOCK, [step, stl])
    assert measure(File(str(step)))[0] == pytest.approx(VOLUME, rel=1e-9)
    volume, area = measure(SurfaceSolid(str(stl)))
    assert volume == pytest.approx(VOLUME, rel=3e-3)
    assert area == pytest.approx(2 * (200 + 200 + 100) - 18 * np.pi + 60 * np.pi, rel=3e-3)
