"""The error that a model states of its natural frequencies, against finite elements that it was not calibrated with."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from cfem.core.errors import InputError, SpecError
from cfem.core.spec import load_spec
from cfem.dataset.reader import read_dataset
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import displacement, force
from cfem.fe_motion.modes import natural_modes as full_modes
from cfem.fe_motion.problem import MovingProblem
from cfem.motion.error import frequency_error, frequency_error_of
from cfem.motion.load import load_motion
from cfem.motion.modes import natural_modes
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh
from cfem.sample.spec import SampleSpec
from cfem.surrogate.motion_error import calibrated_frequencies, frequency_errors


@pytest.fixture(scope="module")
def folder(moving_bar):
    return moving_bar / "models" / "bar" / "spectral"


@pytest.fixture(scope="module")
def sampled(moving_bar):
    manifest = json.loads((moving_bar / "data" / "bar" / "samples" / "manifest.json").read_text())
    return manifest["results"]["frequencies"]


def test_samples_have_the_frequencies_of_finite_elements(moving_bar, sampled):
    test = read_dataset(moving_bar / "data" / "bar" / "samples" / "test.parquet")
    problem = MovingProblem(build_robot(*load_scene_and_mesh(moving_bar / "pipelines" / "bar" / "scene.yaml")))
    assert len(sampled["held"]) == len(sampled["free"]) == len(test) == 2
    state = solve(problem, force(test.lambda_a[1])).state  # the same state, reached by its force
    np.testing.assert_allclose(full_modes(problem, state).frequency, sampled["held"][1], rtol=1e-6)
    np.testing.assert_allclose(full_modes(problem, state, held=force([0.0])).frequency, sampled["free"][1], rtol=1e-6)


def test_the_bound_holds_at_a_state_between(moving_bar, folder):
    model = load_motion(folder)
    stated = frequency_error_of(model.static.meta["motion"])
    assert stated.states == 2 and stated.probability == 2 / 3 and len(stated.held) == len(stated.free) == 3
    problem = MovingProblem(build_robot(*load_scene_and_mesh(moving_bar / "pipelines" / "bar" / "scene.yaml")))
    at = np.array([3.3])
    full = full_modes(problem, solve(problem, displacement(at)).state).frequency
    errors = np.abs(natural_modes(model, at).frequency / full - 1)
    assert (errors < [bound.everywhere for bound in stated.held]).all()
    bounds = frequency_error(model, at)
    assert ((bounds > 0) & (bounds < 0.1)).all() and (frequency_error(model, at, held=False) > 0).all()
    assert (frequency_error(model, np.array([40.0])) == np.inf).all()
    trained = json.loads((folder / "manifest.json").read_text())["results"]["headline"]
    assert any(
        line.startswith("error of each of the first 3 frequencies at most, in 67 % of the unseen") for line in trained
    )


def test_errors_are_relative_to_finite_elements_and_unstable_states_are_left_out(moving_bar, folder, sampled):
    model, test = load_motion(folder), read_dataset(moving_bar / "data" / "bar" / "samples" / "test.parquet")
    ours = [natural_modes(model, test.delta_a[0], held).frequency for held in (True, False)]
    off = {
        "held": [(ours[0] / [1.0, 1.02, 1.01]).tolist(), sampled["held"][1]],
        "free": [(ours[1] / [0.97, 1.0, 1.0]).tolist(), None],
    }
    errors = frequency_errors(model, test.delta_a, off)
    np.testing.assert_allclose(errors[0], [[0.0, 0.02, 0.01], [0.03, 0.0, 0.0]], rtol=1e-9, atol=1e-12)
    assert np.isnan(errors[1, 1]).all()
    stated = calibrated_frequencies(model, test, off)
    assert (stated["states"], stated["left_out"], stated["probability"]) == (1, 1, 0.5)
    assert [bound["everywhere"] for bound in stated["held"]] == pytest.approx([0.0, 0.02, 0.01])
    assert [bound["everywhere"] for bound in stated["free"]] == pytest.approx([0.03, 0.0, 0.0])
    assert calibrated_frequencies(model, test, {**off, "free": [None, None]}) is None


def test_a_model_that_states_none_has_none(folder):
    model = load_motion(folder)
    static = SimpleNamespace(meta={"motion": {"viscosity": []}})
    assert frequency_error(SimpleNamespace(static=static), np.array([3.0])) is None
    assert frequency_error_of(None) is None and frequency_error_of(model.static.meta["motion"]) is not None
    with pytest.raises(InputError, match="train it again"):
        frequency_error_of({"frequency_error": {"modes": 3}})


def test_frequencies_need_what_moves(moving_bar):
    with pytest.raises(SpecError, match="frequencies needs dynamics"):
        load_spec(moving_bar / "pipelines" / "bar" / "sample.yaml", SampleSpec, ["frequencies=true"])
