"""Controllers are built as the spec says."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from export.embedded import spectral

from cfem.control.adaptation.controller import AdaptiveController
from cfem.control.closed_loop import controllers
from cfem.control.closed_loop.controller import Controller
from cfem.control.closed_loop.estimated import EstimatingController
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


def tracking(used, adapts=True):
    kind = AdaptiveController if adapts else Controller
    controller = kind.__new__(kind)
    controller.tracker = SimpleNamespace(used_p=np.array(used))
    return controller


def test_the_table_has_the_parameters_that_a_controller_uses_and_none_where_it_tracks_none():
    behind = EstimatingController.__new__(EstimatingController)
    behind.inner = tracking([0.3])
    for controller, expected in (
        (tracking([0.4, 2.0]), [0.4, 2.0]),
        (behind, [0.3, np.nan]),
        (tracking([0.4], adapts=False), [np.nan] * 2),
    ):
        np.testing.assert_array_equal(controllers.known(controller, 2)["parameters"], expected)
    assert controllers.known(tracking([0.4]), 0) == {}


def test_the_summary_has_the_mean_of_the_runs_ends():
    model = SimpleNamespace(parameters=[SimpleNamespace(name="poisson"), SimpleNamespace(name="young")])
    ended = [{"parameters": np.array([0.3, 1.0, np.nan])}, {"parameters": np.array([0.5, 4.0, np.nan])}]
    adapts = ControllerSpec.model_validate({"mode": "open", "adapt": {"noise": "0.05 mm"}})
    found = controllers.at_the_end(ended, model, adapts)
    assert found == {"parameters": {"poisson": pytest.approx(0.4), "young": pytest.approx(2.5)}}
    assert controllers.at_the_end(ended, model, ControllerSpec.model_validate({"mode": "open"})) == {}
    assert controllers.at_the_end([], model, adapts) == controllers.at_the_end([{}], model, adapts) == {}
