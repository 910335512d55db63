"""Directions that are not measured: those of finite elements whose moduli scale alike, and of models that are wrong by
as much as they say."""

import numpy as np
import pytest
from robot.scenes import scene

from cfem.condensed.parameters import Parameter
from cfem.identify.fit.uncertainty import uncertainty
from cfem.identify.fit.unmeasured import known_combinations, unmeasured, unmeasured_sentences
from cfem.identify.robot.measurements import Measurements
from cfem.identify.robot.residuals import Noise, RobotResiduals
from cfem.parametric.family import FiniteElementFamily
from cfem.robot.mesh.meshing import make_mesh

A = Parameter("A", "material.young", "MPa", 0.5, 2.0, 1.0, "log")
B = Parameter("B", "materials.0.material.young", "MPa", 1.0, 6.0, 3.0, "log")
L = Parameter("L", "geometry.length", "mm", 30.0, 50.0, 40.0)
SPANS = np.log([4.0, 6.0])  # of A and B, in the logarithm
Z = np.array([0.4, 0.6])
U = np.linspace(1.0, 8.0, 5)


def found(slopes, z=Z, parameters=(A, B)):
    return unmeasured(slopes(z), slopes, z, parameters)


def ratios(error=0.0, waves=3.0, weight=0.0):
    """Slopes of five displacements U log(A/B), and those that an error of `error` mm adds along A B."""

    def slopes(z):
        a, b = z * SPANS
        along = error * waves * np.cos(waves * (a + b)) * np.ones(len(U)) + weight * U**2**2
        return U[:, None] * np.array([SPANS[0], -SPANS[1]]) + along[:, None] * SPANS, np.full(len(U), 2 * error)

    return slopes


@pytest.mark.parametrize("error", [0.0, 1e-6, 1e-3, 1e-1])
@pytest.mark.parametrize("waves", [0.5, 3.0, 6.0])
def test_a_ratio_is_all_that_is_known_however_the_model_is_wrong(error, waves):
    for z in np.random.default_rng(0).random((20, 2)):
        (direction,) = found(ratios(error, waves), z).directions
        np.testing.assert_allclose(direction * SPANS, direction[0] * SPANS[0], rtol=1e-6)


@pytest.mark.parametrize("error", [0.0, 1e-6, 1e-3])
def test_what_changes_more_than_the_model_is_wrong_is_measured(error):
    assert not len(found(ratios(error, 3.0, weight=0.05)))


def test_powers_that_are_not_whole_are_kept():
    direction = np.array([1.0, 0.37]) / SPANS
    across = np.array([direction[1], -direction[0]])
    blind = found(lambda z: (np.outer(U, across), None))
    np.testing.assert_allclose(blind.directions[0] / blind.directions[0][0], direction / direction[0], rtol=1e-6)
    (sentence,) = unmeasured_sentences(blind, [A, B], "")
    assert "c A and c^0.37 B" in sentence


def test_what_is_known_of_moduli_is_their_ratio_with_its_interval():
    p, jacobian = np.array([0.8, 4.0]), ratios()(Z)[0]
    blind = found(ratios())
    known = uncertainty(np.array([0.1, -0.1, 0.0, 0.1, -0.1]), jacobian, True, 0.95, unmeasured=blind.directions)
    assert known.information.rank == 1 and np.isinf(known.deviations).all()
    (ratio,) = known_combinations(blind, [A, B], p, known)
    value, name = {"A/B": (0.2, "A/B"), "B/A": (5.0, "B/A")}[ratio.name]
    assert ratio.value == pytest.approx(value) and ratio.name == name
    half = 1.959964 / np.sqrt((U**2).sum())  # of the slope of a line through the origin
    np.testing.assert_allclose(np.log(np.array(ratio.interval) / value), [-half, half], rtol=1e-6)


def test_the_interval_of_a_ratio_ends_with_the_ranges():
    jacobian = ratios()(Z)[0]
    blind = found(ratios())
    known = uncertainty(np.zeros(5), 1e-3 * jacobian, True, 0.95, unmeasured=blind.directions)
    (ratio,) = known_combinations(blind, [A, B], np.array([0.8, 4.0]), known)
    ends = (0.5 / 6.0, 2.0 / 1.0) if ratio.name == "A/B" else (1.0 / 2.0, 6.0 / 0.5)
    np.testing.assert_allclose(ratio.interval, ends)


def test_lengths_that_act_with_a_modulus_have_no_product():
    jacobian = np.outer(U, [1.0, 2.0])
    blind = found(lambda z: (jacobian, None), parameters=(A, L))
    known = uncertainty(np.zeros(5), jacobian, True, 0.95, unmeasured=blind.directions)
    assert known_combinations(blind, [A, L], np.array([1.0, 40.0]), known) == []
    (sentence,) = unmeasured_sentences(blind, [A, L], "measure a force")
    assert sentence.startswith("only together: a change along") and "-0.5" in sentence.replace("+0.5", "-0.5")


def test_one_that_changes_less_than_the_model_is_wrong_is_named_alone():
    jacobian = np.column_stack([U, 1e-4 * U])
    (sentence,) = unmeasured_sentences(found(lambda z: (jacobian, np.full(5, 1e-2))), [A, B], "")
    assert sentence.startswith("B cannot be found")


def test_one_that_small_changes_of_others_hide_leaves_these_known_to_what_they_hide():
    """B changes what A does, a tenth as much: A is known to a tenth of its range, as B may be anywhere in its own."""
    blind = found(lambda z: (np.outer(U, [1.0, 0.1]), None))
    assert blind.leaders.tolist() == [1] and blind.directions.tolist() == [[0.0, 1.0]]
    np.testing.assert_allclose(blind.carried(np.eye(2)), [0.1, 0.0])
    assert unmeasured_sentences(blind, [A, B], "") == ["B cannot be found: small changes of A hide it"]
    known = uncertainty(np.zeros(5), np.outer(U, [1.0, 0.1]), True, 0.95, unmeasured=blind.directions)
    assert np.isfinite(known.deviations).tolist() == [True, False]


SOFT = "[{region: {kind: box, corners: {mm: [[15, -5, -5], [30, 5, 5]]}}, material: {young: 3 MPa, poisson: 0.3%s}}]"
HEAVY = {
    "gravity": "{acceleration: {m/s^2: [0, 0, -9.81]}}",
    "material": "{young: 1 MPa, poisson: 0.3, density: 1070 kg/m^3}",
    "materials": SOFT % ", density: 1070 kg/m^3",
}
CABLE = "[{kind: cable, name: c, points: {mm: [[5, 0, 3], [25, 0, 3]]}, reach: {mm: [0, 3]}}]"
PRESSED = "[{kind: push, name: c, points: {mm: [[28, 0, 5]]}, direction: [0, 0, -1], reach: {mm: [0, 3]}}]"


@pytest.mark.parametrize(
    ("changes", "kind", "sources", "count"),
    [
        ({}, "displacement", ["effectors"], 1),
        ({}, "displacement", ["effectors", "actuators"], 0),
        (HEAVY, "displacement", ["effectors"], 0),
        ({"actuators": PRESSED}, "force", ["effectors"], 0),
    ],
)
def test_two_moduli_of_finite_elements_are_told_apart_where_something_has_a_force(
    tmp_path, changes, kind, sources, count
):
    spec = scene(tmp_path, **{"materials": SOFT % "", "actuators": CABLE} | changes)
    family = FiniteElementFamily(spec, make_mesh(spec, tmp_path)[0], (A, B))
    u, p = np.array([[0.2], [0.5]]), np.array([[0.9, 3.5]])
    states = family.at(kind, u, np.repeat(p, 2, axis=0))
    dual = states.lam if kind == "displacement" else states.delta_a
    measured = Measurements(kind, u, states.x_e, np.full_like(states.x_e, np.nan), dual).of(sources)
    problem = RobotResiduals(family, measured, Noise(1.0, 1.0, False), p[0], [0, 1])
    directions = found(lambda z: problem.with_error(z)[1:], problem.z(p)[0]).directions
    assert len(directions) == count
    if count:
        np.testing.assert_allclose(directions[0] * SPANS, directions[0][0] * SPANS[0], rtol=1e-6)
