"""The volume of designs: of catalogue robots alone."""

import pytest
from robot.scenes import scene

from cfem.core.errors import SpecError
from cfem.design.volume import Volume


@pytest.mark.parametrize("geometry", ["{kind: mesh-file, path: own.msh}", "{kind: step, path: own.step}"])
def test_a_body_that_cannot_be_varied_has_one_volume(tmp_path, geometry):
    with pytest.raises(SpecError, match=r"volume: a geometry of kind (mesh-file|step) cannot be varied"):
        Volume(scene(tmp_path, geometry=geometry), ())
