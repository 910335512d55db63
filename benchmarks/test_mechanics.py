"""Parts of a solve side by side in one run: laws, elements and solvers as ratios to each other.

`python -m pytest benchmarks/test_mechanics.py`; where a whole sample's time goes: benchmarks/tour.py."""

from importlib.util import find_spec

import numpy as np
import pytest
from support.blocks import bar, box_body

from cfem.equilibrium.predictor import knot, predict
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system import actuation
from cfem.equilibrium.system.evaluation import SolveCost
from cfem.equilibrium.system.problem import Problem
from cfem.mechanics.body import response
from cfem.mechanics.element import ELEMENTS
from cfem.mechanics.factorization import SOLVERS, analyze
from cfem.mechanics.material import LAWS

INSTALLED = [name for name in SOLVERS if name != "pardiso" or find_spec("pymklpardiso")]


@pytest.fixture
def divisions(benchmark):
    """A mesh whose times mean something, or a small one where nothing is timed."""
    return (24, 5, 5) if benchmark.enabled else (6, 2, 2)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.benchmark(group="internal force, tet10p0")
def test_law(benchmark, divisions, law):
    body = box_body((60, 10, 10), divisions, law=law)
    x = body.mesh.X * [1.01, 1.0, 0.99]
    assert benchmark(response, body, x).min_J > 0


@pytest.mark.parametrize("element", ELEMENTS)
@pytest.mark.benchmark(group="stiffness assembly, one mesh of cubes")
def test_assembly(benchmark, divisions, element):
    problem = Problem(bar(element, divisions=divisions))
    at = problem.evaluate(problem.rest, np.empty(0))
    data, _ = benchmark(problem.stiffness, at, np.zeros(2))
    assert np.isfinite(data).all()


@pytest.mark.parametrize("solver", INSTALLED)
@pytest.mark.benchmark(group="numeric factorisation, tet10p0")
def test_factorisation(benchmark, divisions, solver):
    problem = Problem(bar(divisions=divisions))
    data, _ = problem.stiffness(problem.evaluate(problem.rest, np.empty(0)), np.zeros(2))
    assert benchmark(analyze(problem.pattern, solver), data).negative == 0


@pytest.mark.parametrize("start", ["cold", "predicted", "factorisation alone"])
@pytest.mark.benchmark(group="one sample, tet10p0")
def test_sample(benchmark, start):
    problem = Problem(bar(divisions=(16, 3, 3) if benchmark.enabled else (6, 2, 2)))
    target = np.array([4.0, 3.0])
    near = solve(problem, actuation.displacement(0.95 * target))
    knots = [knot(0.95 * target, near)]

    def sample():
        how = actuation.displacement(target)
        return solve(problem, how, predict(knots, target, how) if start == "predicted" else None)

    if start == "factorisation alone":
        at = problem.evaluate(near.state.x, near.state.pressure)
        benchmark(problem.factor, at, near.state.lam, SolveCost())
    else:
        assert benchmark(sample).converged
