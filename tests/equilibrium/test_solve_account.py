"""What a solve says that it cost."""

import time

import numpy as np
from support.blocks import bar

from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import displacement
from cfem.equilibrium.system.problem import Problem


def test_factorizations_and_seconds_are_those_of_the_solve(monkeypatch):
    problem, counted = Problem(bar(element="hex8", divisions=(6, 1, 1))), []
    factor = problem._factor
    monkeypatch.setattr(problem, "_factor", lambda data: (counted.append(1), factor(data))[1])
    begin = time.perf_counter()
    found = solve(problem, displacement(np.array([3.0, 2.0])))
    elapsed = time.perf_counter() - begin
    assert found.converged and found.factorizations == len(counted) and 0 < found.seconds <= elapsed
