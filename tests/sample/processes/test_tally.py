"""What progress says of the states that the processes of a pool have solved and are solving."""

import multiprocessing

import pytest
from support.blocks import bar

from cfem.equilibrium.newton import NewtonSettings
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import displacement
from cfem.equilibrium.system.problem import Problem
from cfem.sample.processes import tally
from cfem.sample.processes.tally import Tally, shared_counts


@pytest.fixture
def counts(monkeypatch):
    for name in ("_counts", "_place", "_begun"):
        monkeypatch.setattr(tally, name, getattr(tally, name))
    return shared_counts(multiprocessing.get_context("spawn"), 2)


def test_states_that_fail_are_counted():
    assert str(Tally()) == ""
    assert str(Tally(10, 0, 52)) == "5 factorisations a solve"
    assert str(Tally(12, 2, 76).since(Tally(10, 0, 52))) == "12 factorisations a solve, 2 failed"


def test_a_slow_solve_is_named_with_its_steps_and_halvings_while_it_goes_on(counts):
    tally.join(counts)
    tally.join(counts)  # as a second process would, after which this one writes there
    tally.begin("test", 7)
    cost = tally.cost()
    cost.factorizations += tally.SLOW - 1
    assert tally.read(counts).slowest is None
    cost.factorizations, cost.steps, cost.halvings = 31, 9, 4
    assert str(tally.read(counts)) == "row 7 of test is slow: 9 load steps, 4 halved, 31 factorisations, 0 s"
    tally.add(True, 31)
    assert str(tally.read(counts)) == "31 factorisations a solve, 1 failed"


def test_solves_of_no_row_are_in_nobodys_sight(counts):
    tally.join(counts)
    tally.cost().factorizations += 99
    assert tally.read(counts) == Tally()


@pytest.mark.slow
def test_a_solve_counts_the_steps_that_it_halves(counts):
    """One correction a step is never enough, so that each step is halved until it is too small."""
    problem = Problem(bar(divisions=(4, 1, 1)))
    tally.join(counts)
    tally.begin("train", 3)
    settings = NewtonSettings(max_iterations=1)
    ended = solve(problem, displacement([5.0, 0.0]), settings=settings, cost=tally.cost())
    begun, _, row, factorizations, steps, halvings = list(counts)[4:10]
    assert not ended.converged and begun > 0 and row == 3
    assert (factorizations, steps) == (ended.factorizations, ended.steps)
    assert 1 < halvings <= steps
