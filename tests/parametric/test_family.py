"""Learned robots and finite elements answer alike; finite elements against robots that are built on their own."""

import numpy as np
import pytest
from parametric.synthetic import LENGTH, POISSON, YOUNG, Arc
from robot.scenes import scene
from surrogate.synthetic import dataset

from cfem.condensed import Condensed
from cfem.condensed.parameters import Parameter, from_shares, shares
from cfem.core.errors import InputError, NumericalError
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import displacement, force
from cfem.equilibrium.system.problem import Problem
from cfem.parametric.family import FiniteElementFamily, LearnedFamily
from cfem.predict.load import build
from cfem.predict.series.energy import FORMS
from cfem.robot.build import build_robot
from cfem.robot.mesh.meshing import make_mesh
from cfem.surrogate.model_card import model_card
from cfem.surrogate.series.spectral import fit

NU = Parameter("poisson", "material.poisson", "1", 0.2, 0.45, 0.3, "log(1-2p)")
E = Parameter("young", "material.young", "MPa", 0.5, 4.0, 1.0, "log", exact=True)


@pytest.fixture(scope="module", params=FORMS)
def learned(request):
    training = dataset(40, 1, parameters=True)
    card = model_card("spectral", training, request.param)
    return LearnedFamily(build(card, fit(training, request.param, max_degree=4).arrays))


@pytest.mark.parametrize("kind", FORMS)
def test_learned_robots_are_the_models_own_answers(learned, kind):
    u, p = np.array([[4.0, 5.0]]), np.array([[0.42, 2.0], [0.35, 7.0]])
    states = learned.at(kind, u, p)
    for i, one in enumerate(p):
        model = learned.predictor
        alone = model.at_displacement(u[0], one) if kind == "displacement" else model.at_force(u[0], one)
        assert states.W[i] == pytest.approx(alone.W) and states.lam[i] == pytest.approx(alone.lam)
        assert states.delta[i] == pytest.approx(alone.delta, abs=1e-9)
        assert states.x_e[i] == pytest.approx(model.rest_e + alone.delta_e, abs=1e-9)
    assert learned.outside(learned.at("displacement", u, np.array([[0.42, 2.0], [0.1, 2.0]]))) == [1]


def with_error(size, command="displacement"):
    """The learned family of a model that states an error of this size, relative, of everything."""
    training, bound = dataset(40, 1, parameters=True), {"everywhere": size, "factor": size, "power": 0.0}
    card = model_card("spectral", training, "displacement")
    card["model_error"] = {"probability": 0.95, "left_out": 0, "states": 20, "command": command}
    card["model_error"] |= {"tip": bound, "actuators": bound, "W": bound}
    return LearnedFamily(build(card, fit(training, "displacement", max_degree=4).arrays))


def test_the_stiffness_of_the_tip_is_known_where_the_error_is_less_than_its_least_compliance():
    p, u, rows = np.array([[0.42, 2.0]]), np.array([[4.0, 5.0]]), np.arange(2)
    states = with_error(0.0).at("displacement", u, p)
    size = np.sqrt(np.diag(states.W[0])[:2])
    least = np.linalg.eigvalsh(states.locked_compliance[0, :2, :2] / np.outer(size, size))[0]
    for share, known in ((0.5, True), (2.0, False)):
        assert with_error(share * least).knows_stiffness(states, rows).tolist() == [known]


def test_far_from_all_samples_there_is_no_state(learned):
    with pytest.raises(NumericalError, match="far outside what the model was trained on"):
        learned.at("displacement", np.array([[4e3, 5.0]]), np.array([[0.42, 2.0]]))


@pytest.mark.parametrize("command", FORMS)
@pytest.mark.parametrize("kind", FORMS)
def test_the_stated_error_bounds_what_errors_of_the_other_command_do(command, kind):
    """A model that is wrong by what it states of forces at displacements, or of displacements at forces, is the model
    asked for a command that is beside by as much."""
    family = with_error(1e-6, command)
    p, u = np.array([[0.42, 2.0]]), np.array([[4.0, 5.0]])
    states = family.at(kind, u, p)
    effectors, dual = family.false_change(kind, states)
    stated = family.predictor.error(states, p)
    if kind == command:
        np.testing.assert_allclose(effectors, np.full((1, family.rows.n_e), 2 * stated.tip[0]))
        np.testing.assert_allclose(dual, 2 * stated.actuators)
        return
    for signs in ([1, 1], [1, -1]):
        commanded = states.lam if kind == "force" else states.delta_a  # beside, as the other command's answer is
        moved = family.at(kind, commanded + stated.actuators * signs, p)
        other = (moved.delta_a - states.delta_a) if kind == "force" else (moved.lam - states.lam)
        assert (np.abs(other) <= 0.5 * dual * (1 + 1e-3)).all()
        assert (np.abs(moved.delta_e - states.delta_e) <= 0.5 * effectors).all()


def test_finite_elements_are_wrong_by_their_tolerance_over_the_step(fe):
    states = fe[2].at("displacement", np.array([[1.0]]), np.array([[0.3, 1.0]]))
    effectors, dual = fe[2].false_change("displacement", states)
    assert (effectors <= 1e-5 * np.abs(states.delta_e).max()).all() and (dual <= 1e-5 * np.abs(states.lam)).all()


def test_shares_span_the_ranges_whatever_the_coordinate():
    parameters = (LENGTH, POISSON, YOUNG)
    p = np.array([[30.0, 0.40, 1.0], [50.0, 0.499, 10.0]])
    assert shares(parameters, p) == pytest.approx(np.array([[0.0] * 3, [1.0] * 3]))
    z = np.random.default_rng(0).random((5, 3))
    assert shares(parameters, from_shares(parameters, z)) == pytest.approx(z, abs=1e-12)


@pytest.fixture(scope="module")
def fe(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fe")
    spec = scene(folder)
    mesh = make_mesh(spec, folder)[0]
    return spec, mesh, FiniteElementFamily(spec, mesh, (NU, E))


def robot_of(spec, mesh, nu, young):
    material = spec.material.model_copy(update={"young": young, "poisson": nu})
    return Problem(build_robot(spec.model_copy(update={"material": material}), mesh))


@pytest.mark.parametrize("kind", ["displacement", "force"])
def test_finite_elements_are_the_robots_built_one_by_one(fe, kind):
    spec, mesh, family = fe
    p = np.array([[0.25, 2.0], [0.42, 0.6]])
    u = np.array([[1.5]]) if kind == "displacement" else np.array([[0.8]])
    states = family.at(kind, u, p)
    for i, (nu, young) in enumerate(p):
        alone = solve(robot_of(spec, mesh, nu, young), {"displacement": displacement, "force": force}[kind](u[0]))
        assert states.W[i] == pytest.approx(alone.condensed.W, rel=1e-6, abs=1e-9)
        assert states.delta_e[i] == pytest.approx(alone.delta_e, abs=1e-7)
        assert states.lam[i] == pytest.approx(alone.lambda_a, rel=1e-7)
        assert states.x_e[i] == pytest.approx(states.rest_e[i] + alone.delta_e, abs=1e-7)


def test_finite_elements_out_of_reach_say_where(fe):
    with pytest.raises(NumericalError, match=r"poisson.*displacement"):
        fe[2].at("displacement", np.array([[400.0]]), np.array([[0.3, 1.0]]))


def test_a_model_without_parameters_is_refused(tmp_path):
    class Plain:
        parameters = ()

    with pytest.raises(InputError, match="no parameters"):
        LearnedFamily(Plain())


def test_batched_condensed_states_agree_with_single_ones():
    states = Arc().at("force", np.array([[4.0]]), np.array([[40.0, 0.45, 3.0], [35.0, 0.42, 2.0]]))
    for i in range(2):
        one = Condensed(states.rows, states.W[i], states.delta_free[i], states.lam[i])
        assert states.delta[i] == pytest.approx(one.delta)
        K = np.linalg.inv(one.W_aa)
        locked = one.W[:3, :3] - one.W_ea @ K @ one.W_ea.T
        assert states.locked_compliance[i] == pytest.approx(locked)


def test_a_model_of_several_shapes_needs_the_scene():
    class Shapes:
        parameters = (Parameter("L", "geometry.length", "mm", 38.0, 42.0, 40.0),)

    with pytest.raises(InputError, match=r"several shapes.*give the scene"):
        LearnedFamily(Shapes())
