import numpy as np
import pytest

from cfem.contact.law.check import check
from cfem.contact.law.problem import ContactProblem

GOOD = np.array([1.5, -0.36, -0.48])  # slides along (0.6, 0.8) at 2.8 mm, by hand


def slider() -> ContactProblem:
    return ContactProblem(2 * np.eye(3), np.array([-3.0, 2.4, 3.2]), mu=0.4)


@pytest.mark.parametrize(
    ("lam", "blamed"),
    [
        (np.array([1.4, -0.336, -0.448]), "gap"),
        (np.array([1.6, -0.384, -0.512]), "complementarity"),
        (np.array([-0.1, 0.0, 0.0]), "force"),
        (GOOD * [1, 1.1, 1.1], "cone"),
        (GOOD * [1, 0.9, 0.9], "dissipation"),
        (np.array([1.5, -0.48, -0.36]), "dissipation"),
        (GOOD * [1, -1, -1], "dissipation"),
    ],
)
def test_each_kind_of_violation_is_named(lam, blamed):
    assert check(slider(), "coulomb", GOOD).largest < 1e-14
    found = check(slider(), "coulomb", lam)
    assert getattr(found, blamed) > 1e-3 and not found.valid()


def test_frictionless_points_carry_no_friction():
    assert check(slider(), "signorini", np.array([1.5, 0, 0])).valid()
    assert check(slider(), "signorini", GOOD).force > 0.1


def test_an_unbalanced_object_and_nan_are_not_valid():
    G = np.array([[1.0], [0.0], [0.0]])
    problem = ContactProblem(np.eye(3), np.zeros(3), G, np.array([1.0]))
    assert check(problem, "signorini", np.array([1.0, 0, 0]), np.array([1.0])).valid()
    assert check(problem, "signorini", np.array([0.5, 0, 0]), np.array([0.5])).balance > 0.1
    assert not check(problem, "signorini", np.full(3, np.nan), np.zeros(1)).valid()


@pytest.mark.parametrize(("length", "force"), [(1e-3, 1.0), (1.0, 1e3), (1e3, 1e-3)])
def test_units_do_not_matter(length, force):
    problem = slider()
    other = ContactProblem(problem.W * length / force, problem.free * length, mu=0.4)
    off = GOOD * [1, 1.1, 1.1]
    assert check(other, "coulomb", off * force).largest == pytest.approx(check(problem, "coulomb", off).largest)
