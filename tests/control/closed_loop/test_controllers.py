"""Controllers are built as the spec says."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from export.embedded import spectral

from cfem.control.closed_loop import controllers
from cfem.control.closed_loop.spec import ControllerSpec
from cfem.predict.load import build


class Asked(Exception):
    """In place of a tracker."""


@pytest.mark.parametrize("find, expected", [(["young"], ("young",)), (None, None)])
def test_adaptation_finds_the_parameters_that_it_names_and_all_where_it_names_none(monkeypatch, find, expected):
    def tracker(model, kind, noise, names, *more):
        assert (kind, noise) == ("displacement", 0.05)
        raise Asked(names)

    monkeypatch.setattr(controllers, "Tracker", tracker)
    adapt = {"noise": "0.05 mm"} | ({} if find is None else {"find": find})
    spec = ControllerSpec.model_validate({"mode": "open", "adapt": adapt})
    pilot = SimpleNamespace(model=build(*spectral(parameters=True)), weights=np.ones(3))
    loop = SimpleNamespace(command=SimpleNamespace(kind="displacement"), rate=10.0, ticks_a_sample=1, estimate=None)
    situation = SimpleNamespace(start=None, loop=loop, rest_e=np.zeros(3))
    with pytest.raises(Asked) as asked:
        controllers.controller_of(spec, pilot, None, None, situation, Path(), {})
    assert asked.value.args == (expected,)
