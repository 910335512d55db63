"""Every kind and runtime behind one interface: values, domain, damaged files, no torch."""

import subprocess
import sys

import numpy as np
import pytest
from surrogate.stored import train_folder
from surrogate.synthetic import dataset, energy

from cfem.core.errors import InputError, NumericalError
from cfem.core.stage import Options
from cfem.export.stage import run
from cfem.predict.load import build, load_model
from cfem.predict.series.energy import FORMS
from cfem.surrogate.model_card import model_card
from cfem.surrogate.series.spectral import fit

MODELS = {"spectral": "{kind: spectral, max_degree: 12}", "mlp": "{kind: mlp, width: 8, depth: 2, epochs: 2}"}


@pytest.fixture(scope="module")
def exports(tmp_path_factory):
    folders = {}
    for kind, model in MODELS.items():
        folder = tmp_path_factory.mktemp(kind)
        train_folder(folder, model, train=60)
        (folder / "export.yaml").write_text("model: model\nout: export\nformats: [arrays, onnx]\n")
        run(folder / "export.yaml", [], None, Options())
        folders[kind] = folder / "export"
    return folders


@pytest.mark.parametrize("kind", MODELS)
def test_onnx_equals_arrays(exports, kind):
    arrays, onnx = (load_model(exports[kind], runtime) for runtime in ("arrays", "onnx"))
    tolerance = {"spectral": 1e-10, "mlp": 1e-5}[kind]
    for delta_a in dataset(10, 7).delta_a:
        one, other = arrays.at_displacement(delta_a), onnx.at_displacement(delta_a)
        assert np.allclose(one.W, other.W, rtol=0, atol=tolerance * np.abs(one.W).max())
        assert np.allclose(one.delta_free, other.delta_free, rtol=0, atol=tolerance * np.abs(one.delta_free).max())
        assert one.rows == other.rows and onnx.inside(other) == arrays.inside(one)


@pytest.mark.parametrize(
    "wrong", [[1.0], [1.0, 2.0, 3.0], [1.0, np.nan], 1.0, [[1.0], [2.0]], "ab", None, [10**400, 1]]
)
def test_a_state_is_one_finite_number_for_each_actuator(exports, wrong):
    model = load_model(exports["spectral"])
    for ask in (model.at_displacement, model.at_force):
        with pytest.raises(InputError, match=r"is one finite number for each actuator .*; got"):
            ask(wrong)


@pytest.mark.parametrize("kind", MODELS)
def test_one_query_is_a_row_of_a_batch(exports, kind):
    model, states = load_model(exports[kind]), dataset(5, 7).delta_a
    W, delta_free = model.evaluate(states)
    for i, delta_a in enumerate(states):
        condensed = model.at_displacement(delta_a)
        assert np.allclose(condensed.W, W[i], rtol=1e-6, atol=1e-9)
        assert np.allclose(condensed.delta_free, delta_free[i], rtol=1e-6, atol=1e-6)
        assert np.allclose(condensed.delta_a, delta_a, atol=1e-9)


@pytest.mark.parametrize("runtime", ["arrays", "onnx"])
@pytest.mark.parametrize("kind", MODELS)
def test_a_batch_of_states_is_its_states_one_by_one(exports, kind, runtime):
    model, states = load_model(exports[kind], runtime), dataset(6, 7)
    batch = model.at_displacement(states.delta_a.reshape(2, 3, 2))
    forces = model.at_force(batch.lambda_a)
    assert batch.W.shape == (2, 3, 5, 5) and batch.delta_e.shape == (2, 3, 3)
    assert np.allclose(forces.delta_a, batch.delta_a, atol=1e-4)
    for i, delta_a in enumerate(states.delta_a):
        place, alone = np.unravel_index(i, (2, 3)), model.at_displacement(delta_a)
        for name in ("W", "delta_free", "lam", "delta_e", "W_ea", "W_aa", "effector_jacobian"):
            single = getattr(alone, name)
            assert np.allclose(getattr(batch, name)[place], single, rtol=1e-5, atol=1e-5 * np.abs(single).max())
        assert model.inside(batch)[place] == model.inside(alone)
        assert np.isclose(model.distance(batch)[place], model.distance(alone), atol=1e-5)


def test_one_state_of_a_batch_without_answer_is_named(exports):
    model = load_model(exports["spectral"])
    with pytest.raises(NumericalError, match=r"displacements \[90.0, 1.0\] mm are far outside"):
        model.at_displacement([[5.0, 5.0], [90.0, 1.0]])


def test_the_jacobian_is_the_slope_of_the_effectors(exports):
    model, delta_a, h = load_model(exports["spectral"]), np.array([8.0, 7.0]), 1e-4
    places = model.at_displacement(delta_a + h * np.array([[1, 0], [-1, 0], [0, 1], [0, -1]])).delta_e
    slope = (places[::2] - places[1::2]).T / (2 * h)
    assert np.allclose(model.jacobian(model.at_displacement(delta_a)), slope, atol=1e-6)


def test_what_is_far_is_said_in_the_units_of_its_actuators(exports, monkeypatch):
    model = load_model(exports["spectral"])
    monkeypatch.setattr(model, "actuator_units", [("mm", "N"), ("mm^3", "MPa")])
    with pytest.raises(NumericalError, match=r"displacements \[90.0, 1.0\] mm or mm\^3 are far outside"):
        model.at_displacement([90.0, 1.0])


def test_what_is_asked_of_a_state_and_given_something_else_is_one_sentence(exports):
    model = load_model(exports["spectral"])
    for ask in (model.jacobian, model.inside, model.distance, model.error):
        with pytest.raises(InputError, match=r"expected a state of the model, got \[8.0, 7.0\]"):
            ask([8.0, 7.0])


def test_it_says_what_it_is(exports):
    text = repr(load_model(exports["spectral"]))
    assert text.startswith("<spectral model of '") and text.endswith("60 training states>")
    assert "cable0 0 to 20 mm, cable1 0 to 20 mm" in text and "tip.x, tip.y, tip.z" in text


def test_what_it_knows_of_the_robot(exports):
    model = load_model(exports["spectral"])
    assert model.rest_e.tolist() == [0.0, 10.0, -110.0] and model.length == 110.0
    assert model.reach.tolist() == [[0.0, 20.0]] * 2
    assert model.rows.names == ("tip.x", "tip.y", "tip.z", "cable0", "cable1")


def test_inside_is_the_pulling_wedge(exports):
    model = load_model(exports["spectral"])
    for delta_a, inside in (([10.0, 10.0], True), ([15.0, 2.0], False), ([22.0, 22.0], False)):
        state = model.at_displacement(np.array(delta_a))
        assert model.inside(state) is inside
        assert (model.distance(state) < 1) is inside


def test_at_force_inverts_the_energy(exports):
    model = load_model(exports["spectral"])
    for delta_a in dataset(10, 7).delta_a:
        lambda_a = energy(delta_a[None])[1][0]
        found = model.at_force(lambda_a)
        assert np.allclose(found.lambda_a, lambda_a, atol=1e-7)
        assert np.allclose(found.delta_a, delta_a, atol=1e-4)


def test_at_force_says_where_it_fails(exports):
    model = load_model(exports["spectral"])
    with pytest.raises(NumericalError, match=r"N.*are left"):
        model._with_dual(np.array([-1e9, 1e9]), None)


@pytest.mark.parametrize("kind", ["spectral", "mlp"])
def test_no_answer_is_given_far_outside_the_training_states(exports, kind):
    model = load_model(exports[kind])
    for ask, (low, high) in ((model.at_displacement, model.domain.delta_a), (model.at_force, model.domain.lambda_a)):
        with pytest.raises(NumericalError, match=r"far outside what the model was trained on \(cable0 -?[0-9.]+ to"):
            ask(high + [0.0, 1.1] * (high - low))
    assert not model.inside(
        model.at_displacement(model.domain.delta_a[1] + 0.5)
    )  # a little outside it answers, and says so


@pytest.fixture(scope="module")
def families():
    """Models of robots whose Poisson's ratio and Young's modulus vary, by form."""
    training = dataset(150, 1, parameters=True)
    return {
        form: build(model_card("spectral", training, form), fit(training, form).arrays)
        for form in ("displacement", "force")
    }


@pytest.mark.parametrize("form", FORMS)
def test_parameters_are_learned_or_exact(families, form):
    """Against the closed form at p, Young's modulus entering as W ~ 1/E, lambda ~ E."""
    test, model = dataset(20, 2, parameters=True), families[form]
    near = {"displacement": 1e-4, "force": 1e-2}[form]
    for i, (delta_a, poisson) in enumerate(zip(test.delta_a, test.p[:, 0], strict=True)):
        for young in (1.5, 3.0, 8.0):
            found = model.at_displacement(delta_a, [poisson, young])
            assert np.allclose(found.lambda_a, test.lambda_a[i] * young / 3.0, rtol=near, atol=near)
            assert np.allclose(found.W, test.W[i] * 3.0 / young, rtol=near, atol=near * np.abs(found.W).max())
            assert np.allclose(found.delta_free, test.delta_free[i], atol=20 * near)
            again = model.at_force(found.lambda_a, [poisson, young])
            assert np.allclose(again.delta_a, delta_a, atol=1e-6)
            assert model.inside(found, [poisson, young])


@pytest.mark.parametrize("form", FORMS)
def test_without_parameters_the_scenes_own_are_meant(families, form):
    s = np.array([6.0, 6.0])
    own = families[form].at_displacement(s, [0.4, 3.0])
    assert np.array_equal(families[form].at_displacement(s).W, own.W)


def test_a_parameter_far_from_those_trained_on_is_outside(families):
    model = families["displacement"]
    assert not model.inside(model.at_displacement([6.0, 6.0], [0.2, 3.0]), [0.2, 3.0])


def test_a_missing_parameter_is_an_error(families):
    with pytest.raises(InputError, match="1 parameter given, and the model has"):
        families["displacement"].at_displacement([1.0, 1.0], [0.4])


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(
    "p, error, part",
    [
        ([np.nan, 3.0], InputError, "is a finite number; got"),
        ([0.6, 3.0], NumericalError, r"= 0\.6 is a Poisson's ratio of no material, which is between -1 and 0.5"),
        ([-1.5, 3.0], NumericalError, r"= -1\.5 is a Poisson's ratio of no material"),
        ([0.4, -3.0], NumericalError, r"= -3 MPa is far outside what the model was trained on \("),
        ([[0.4, 3.0], [-5.0, 3.0]], NumericalError, "= -5 is a Poisson's ratio of no"),
    ],
)
def test_parameters_that_no_robot_of_the_model_has_are_refused(families, form, p, error, part):
    model, state = families[form], np.broadcast_to([6.0, 6.0], (*np.shape(p)[:-1], 2))
    for ask in (model.at_displacement, model.at_force):
        with pytest.raises(error, match=part):
            ask(state, p)


def test_a_model_of_one_robot_takes_no_parameters(exports):
    model = load_model(exports["spectral"])
    with pytest.raises(InputError, match="1 parameter given, and the model has none"):
        model.at_displacement([6.0, 6.0], [0.4])


@pytest.mark.parametrize(
    ("name", "runtime"), [("weights.npz", "arrays"), ("model.onnx", "onnx"), ("model.json", "arrays")]
)
def test_damaged_or_missing_files_are_one_sentence(exports, name, runtime):
    path = exports["mlp"] / name
    whole = path.read_bytes()
    try:
        path.write_bytes(whole[: len(whole) // 2])
        with pytest.raises(InputError, match="damaged"):
            load_model(exports["mlp"], runtime)
        path.unlink()
        with pytest.raises(InputError, match="no such file"):
            load_model(exports["mlp"], runtime)
    finally:
        path.write_bytes(whole)


def test_an_absent_folder_is_named(tmp_path):
    with pytest.raises(InputError, match="no such artefact"):
        load_model(tmp_path / "nowhere")


@pytest.mark.parametrize("runtime", ["arrays", "onnx"])
def test_no_torch_no_scipy_no_training_code(exports, runtime):
    code = (
        "import sys; from pathlib import Path; from cfem.predict.load import load_model; "
        f"load_model(Path({str(exports['mlp'])!r}), {runtime!r}).at_displacement([1.0, 1.0]); "
        "print([name for name in ('torch', 'scipy', 'pyarrow', 'numba', 'cfem.surrogate') if name in sys.modules])"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"


@pytest.mark.parametrize("kind", MODELS)
def test_ends_at_a_displacement_are_those_of_the_condensed_robot(exports, kind):
    model = load_model(exports[kind], "arrays")
    state = model.at_displacement(dataset(10, 7).delta_a[0])
    for given, expected in zip(model.ends_at_displacement(state.delta_a), (state.delta_e, state.lambda_a), strict=True):
        np.testing.assert_allclose(given, expected, atol=1e-12 * max(1.0, np.abs(expected).max()))
