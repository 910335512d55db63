"""A loaded model against finite elements that carry the load, and against its own energy."""

import numpy as np
import pytest
from surrogate.synthetic import dataset

from cfem.core.errors import InputError, SpecError
from cfem.plant.fem_plant import FemPlant, pushed
from cfem.predict.load import build
from cfem.predict.loads.loaded import loaded, wrench_error, wrench_of
from cfem.surrogate.model_card import model_card
from cfem.surrogate.series.spectral import fit

DIRECTION = np.array([0.3, 1.0, -1.0])


def of_form(form):
    training = dataset(60, 1)
    return build(model_card("spectral", training, form), fit(training, form).arrays)


def test_finite_elements_agree_to_the_second_order_of_the_load(model, robot):
    """Twice the load: four times the error of the tip, eight times that of the force that holds the cable."""
    place, tips, forces = np.array([1.5]), [], []
    for size in (0.01, 0.02):
        wrench = wrench_of(model.rows, {"tip": size * DIRECTION})
        found = loaded(model, wrench).at_displacement(place)
        truth = FemPlant(pushed(robot, wrench)).at_displacement(place)
        tips.append(np.linalg.norm(found.delta_e - truth.delta_e))
        forces.append(np.abs(found.lambda_a - truth.lambda_a).max())
        moved = np.linalg.norm(truth.delta_e - model.at_displacement(place).delta_e)
        assert moved > 0.8 * size / 0.01  # mm
        assert tips[-1] < 0.02 * moved
    assert 3.8 < tips[1] / tips[0] < 4.2
    assert 7.5 < forces[1] / forces[0] < 8.5


def test_the_estimated_error_is_that_of_finite_elements(model, robot):
    wrench = wrench_of(model.rows, {"tip": 0.02 * DIRECTION})
    place = np.array([0.5])
    found, truth = loaded(model, wrench).at_displacement(place), FemPlant(pushed(robot, wrench)).at_displacement(place)
    actual = np.linalg.norm(found.delta_e - truth.delta_e)
    assert actual / 3 < wrench_error(model, wrench) < 3 * actual


@pytest.mark.parametrize("form", ["displacement", "force"])
def test_a_loaded_model_is_one_of_an_energy(form):
    """Its gradient and Hessian are those of the loaded potential, and work and displacement of the load match."""
    model, wrench = of_form(form), np.array([1e-3, 2e-2, -1e-3])
    found = loaded(model, wrench)
    s = model.domain.states[5, :2] if form == "displacement" else model.domain.states[5, 2:4]
    h, none = 1e-4 * np.abs(s).max(), np.zeros(0)
    part = found.parts(s, none)
    ahead, behind = ([found.parts(s + sign * h * e, none) for e in np.eye(2)] for sign in (1, -1))
    slope = [(a["energy"][0] - b["energy"][0]) / (2 * h) for a, b in zip(ahead, behind, strict=True)]
    assert np.allclose(part["gradient"], slope, rtol=1e-6)
    bend = [(a["gradient"] - b["gradient"]) / (2 * h) for a, b in zip(ahead, behind, strict=True)]
    assert np.allclose(part["hessian"], bend, rtol=1e-6)
    turn = [(a["effector"] - b["effector"]) / (2 * h) for a, b in zip(ahead, behind, strict=True)]
    assert np.allclose(part["effector_gradient"].T, turn, rtol=1e-6, atol=1e-9)
    more, less = (loaded(model, wrench + sign * 1e-3 * np.eye(3)[1]).parts(s, none)["energy"][0] for sign in (1, -1))
    work = (more - less) / 2e-3
    assert work == pytest.approx(part["effector"][1] * (1 if form == "force" else -1), rel=1e-9)


def test_loads_add_up():
    model, one, other = of_form("displacement"), np.array([1e-3, 0, 2e-3]), np.array([0, 2e-3, 0])
    both, again = loaded(model, one + other), loaded(loaded(model, one), other)
    assert np.allclose(both.arrays["series"], again.arrays["series"], rtol=1e-12, atol=1e-12)


def test_the_domain_moves_with_the_load(model):
    wrench = wrench_of(model.rows, {"tip": [0.0, 0.02, 0.0]})
    found = loaded(model, wrench)
    held = found.at_displacement(np.array([4.0]))
    assert found.inside(held)
    assert found.domain.lambda_a[1, 0] != model.domain.lambda_a[1, 0]
    assert np.array_equal(found.domain.delta_a, model.domain.delta_a)


def test_too_large_a_load_says_how_much_is_taken(model):
    with pytest.raises(InputError, match=r"wrong by about 1\.3 mm, and 0\.3 mm are allowed .*take at most 48% of them"):
        loaded(model, wrench_of(model.rows, {"tip": 0.1 * DIRECTION}))
    loaded(model, wrench_of(model.rows, {"tip": 0.047 * DIRECTION}))
    with pytest.raises(InputError, match="take less than 1% of them"):
        loaded(model, wrench_of(model.rows, {"tip": 100 * DIRECTION}))


def test_an_unknown_effector_is_named(model):
    with pytest.raises(SpecError, match=r"no effector 'top'.*known are tip"):
        wrench_of(model.rows, {"top": [0, 0, 1]})


@pytest.mark.parametrize("wrench", [[0.1, 0.1], [np.nan, 0, 0]])
def test_a_wrench_has_a_finite_number_for_each_row(model, wrench):
    with pytest.raises(InputError, match="3 finite numbers"):
        loaded(model, np.array(wrench))
