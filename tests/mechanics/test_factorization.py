import subprocess
import sys
from importlib.util import find_spec

import numpy as np
import pytest

from cfem.core.errors import InputError
from cfem.mechanics.assembly import make_pattern
from cfem.mechanics.factorization import SOLVERS, SingularMatrixError, analyze, solver_name

PATTERN = make_pattern(3, [np.array([[0, 1, 2]])], np.array([], dtype=int))


INSTALLED = [name for name in SOLVERS if name != "pardiso" or find_spec("pymklpardiso")]
every_solver = pytest.mark.parametrize("solver", INSTALLED)


def lower(matrix):
    return np.concatenate([matrix[column:, column] for column in range(9)])


def symmetric(eigenvalues, seed=0):
    Q = np.linalg.qr(np.random.default_rng(seed).standard_normal((9, 9)))[0]
    return Q @ np.diag(eigenvalues) @ Q.T


@every_solver
def test_solves_many_right_hand_sides_and_counts_negative_eigenvalues(solver):
    matrix = symmetric([1.0, 2, 3, 4, 5, 6, -1, -2, 7])
    factor = analyze(PATTERN, solver)(lower(matrix))
    B = np.random.default_rng(1).standard_normal((9, 4))
    np.testing.assert_allclose(matrix @ factor.solve(B), B, atol=1e-12)
    assert factor.negative == 2


@every_solver
@pytest.mark.parametrize(
    "matrix", [np.zeros((9, 9)), symmetric([0.0, 1, 2, 3, 4, 5, 6, 7, 8]), np.full((9, 9), np.nan)]
)
def test_singular_and_non_finite_matrices_are_reported(matrix, solver):
    with pytest.raises(SingularMatrixError):
        analyze(PATTERN, solver)(lower(matrix))


@every_solver
def test_an_earlier_factor_is_never_used_by_mistake(solver):
    """Where a solver keeps one factor only, the one before says that it is gone; else it still gives its own answer."""
    numeric = analyze(PATTERN, solver)
    one, other = symmetric(np.arange(1.0, 10)), symmetric(np.arange(2.0, 11), 1)
    first = numeric(lower(one))
    numeric(lower(other))
    B = np.ones((9, 1))
    if solver == "pardiso":
        with pytest.raises(RuntimeError, match="next one"):
            first.solve(B)
    else:
        np.testing.assert_allclose(one @ first.solve(B), B, atol=1e-10)


def test_the_environment_names_the_solver(monkeypatch):
    monkeypatch.setenv("CFEM_SOLVER", "rslab")
    assert solver_name() == "rslab"
    monkeypatch.setenv("CFEM_SOLVER", "magic")
    with pytest.raises(InputError, match="magic"):
        solver_name()


THREADS = """
import threading
import numpy as np
from cfem.mechanics.assembly import make_pattern
from cfem.mechanics.factorization import analyze
def work():
    analyze(make_pattern(3, [np.array([[0, 1, 2]])], np.array([], dtype=int)), "rslab")
    print("analysed", flush=True)
for _ in range(3):
    one = threading.Thread(target=work)
    one.start()
    one.join()
"""


def test_threads_that_end_harm_no_later_thread():
    """Where rslab was loaded in a thread that has ended, its allocator crashed the process in the next one."""
    ran = subprocess.run([sys.executable, "-c", THREADS], capture_output=True, text=True, timeout=60, check=False)
    assert ran.returncode == 0 and ran.stdout.split() == ["analysed"] * 3, ran.stderr
