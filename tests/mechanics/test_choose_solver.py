"""One measurement per machine decides; it is kept, and where it cannot be, the processor's maker decides."""

import json

import numpy as np
import pytest

from cfem.mechanics import choose_solver
from cfem.mechanics.choose_solver import block_pattern, fastest, kept, seconds_of
from cfem.mechanics.factorization import analyze

TIMES = {"pardiso": 1.0, "rslab": 2.0}


@pytest.fixture
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    fastest.cache_clear()
    yield tmp_path / "cfem"
    fastest.cache_clear()


def never():
    raise AssertionError("measured again")


def test_a_machine_is_measured_once(cache):
    assert kept("this machine", lambda: TIMES) == TIMES
    assert kept("this machine", never) == TIMES
    assert kept("another", lambda: {**TIMES, "rslab": 0.5})["rslab"] == 0.5
    assert len(list(cache.iterdir())) == 2


def test_the_first_of_two_processes_decides_for_both(cache):
    slower = {"pardiso": 9.0, "rslab": 2.0}

    def measured_by_another_meanwhile():
        kept("this machine", lambda: TIMES)
        return slower

    assert kept("this machine", measured_by_another_meanwhile) == TIMES


@pytest.mark.parametrize("text", ["", "[]", '{"seconds": {"pardiso": "quick"}}', json.dumps({"seconds": None})])
def test_a_damaged_measurement_is_repeated(cache, text):
    kept("this machine", lambda: TIMES)
    (path,) = cache.iterdir()
    path.write_text(text)
    assert kept("this machine", lambda: TIMES) == TIMES == kept("this machine", never)


@pytest.mark.parametrize(
    ("pardiso", "chosen"), [(0.5, "pardiso"), (0.69, "pardiso"), (0.71, "rslab"), (1.0, "rslab"), (2.0, "rslab")]
)
def test_pardiso_has_to_be_clearly_faster(cache, monkeypatch, pardiso, chosen):
    monkeypatch.setattr(choose_solver, "installed", lambda name: True)
    monkeypatch.setattr(choose_solver, "version", lambda name: "1")
    monkeypatch.setattr(choose_solver, "seconds_of", lambda analyze, name: {"pardiso": pardiso, "rslab": 1.0}[name])
    assert fastest(analyze) == chosen


@pytest.mark.parametrize(("maker", "chosen"), [("GenuineIntel Xeon", "pardiso"), ("AuthenticAMD EPYC", "rslab")])
def test_the_maker_decides_where_nothing_can_be_kept(cache, monkeypatch, maker, chosen):
    monkeypatch.setattr(choose_solver, "installed", lambda name: True)
    monkeypatch.setattr(choose_solver, "version", lambda name: "1")
    monkeypatch.setattr(choose_solver, "cache_folder", lambda: None)
    monkeypatch.setattr(choose_solver, "processor", lambda: maker)
    monkeypatch.setattr(choose_solver, "seconds_of", lambda analyze, name: never())
    assert fastest(analyze) == chosen


@pytest.mark.parametrize("only", ["rslab", "pardiso"])
def test_the_only_solver_serves(cache, monkeypatch, only):
    package = choose_solver.PACKAGES[only]
    monkeypatch.setattr(choose_solver, "installed", lambda name: name == package)
    assert fastest(analyze) == only


def test_the_measured_matrix_is_positive_definite_and_of_useful_size():
    pattern = block_pattern()
    assert 10_000 < pattern.n_dof < 15_000
    columns = np.repeat(np.arange(pattern.n_dof), np.diff(pattern.indptr))
    rows = np.asarray(pattern.indices)
    assert (rows[pattern.indptr[:-1]] == np.arange(pattern.n_dof)).all()  # each column begins with its diagonal
    off = np.bincount(rows, minlength=pattern.n_dof) + np.bincount(columns, minlength=pattern.n_dof) - 2
    assert 2 * off.max() < 500  # no entry beside the diagonal is larger than 2


def test_both_solvers_give_the_same_answer_to_rounding(monkeypatch):
    pytest.importorskip("pymklpardiso")
    monkeypatch.setattr(choose_solver, "SIDE", 6)
    pattern = block_pattern()
    data = -1.0 - np.random.default_rng(0).random(pattern.nnz)
    data[pattern.indptr[:-1]] = 500.0
    B = np.random.default_rng(1).standard_normal((pattern.n_dof, 3))
    one, other = (analyze(pattern, name)(data).solve(B) for name in ("rslab", "pardiso"))
    np.testing.assert_allclose(one, other, rtol=0, atol=1e-14 * np.abs(one).max())


def test_a_measurement_takes_time(monkeypatch):
    monkeypatch.setattr(choose_solver, "SIDE", 6)
    assert seconds_of(analyze, "rslab") > 0
