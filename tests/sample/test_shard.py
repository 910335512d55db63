"""A failed row is kept as a row, and states outlive the file between."""

import io
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from sample.synthetic import FACTS, Factory, SyntheticSolver
from support.clip import clip

from cfem.core.errors import NumericalError
from cfem.equilibrium.predictor import knot
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import displacement
from cfem.equilibrium.system.problem import Problem
from cfem.equilibrium.system.solution import Status
from cfem.sample.knots_file import knots_bytes, read_knots
from cfem.sample.plan import actuation
from cfem.sample.runner import sample
from cfem.sample.shard import _start
from cfem.sample.spec import SampleSpec

ASKED = actuation("pulling", np.array([0.5, 0.5]), FACTS.reach, FACTS.compliance)
SPEC = SampleSpec(
    scene="scene.yaml", mesh="mesh", out="out", splits={"train": {"rows": 30, "method": "random"}}, skeleton=6, shard=10
)


def test_failed_rows_stay_with_their_reason_and_without_a_state(tmp_path):
    with ThreadPoolExecutor(1) as executor:
        spec = SPEC.model_copy(update={"space": "displacement"})
        tables = sample(spec, Factory(fails_beyond=10.0), tmp_path, executor)
    rows = tables["train"].to_pylist()
    failed = [row for row in rows if row["status"] != "converged"]
    assert 5 < len(failed) < 25 and [row["id"] for row in rows] == list(range(30))
    assert all(row["status"] == "step_too_small" and row["reason"] == Status.STEP_TOO_SMALL.value for row in failed)
    assert all(row["W"] is None and row["delta_a"] is None and row["energy"] is None for row in failed)
    assert all(np.mean(row["delta_a"]) <= 10.0 for row in rows if row["status"] == "converged")


def test_nothing_that_converges_is_an_error_and_not_an_empty_dataset(tmp_path):
    with ThreadPoolExecutor(1) as executor, pytest.raises(NumericalError, match="none of the first states"):
        sample(SPEC, Factory(fails_beyond=-1.0), tmp_path, executor)


def test_states_come_back_bit_for_bit():
    known = [knot(u, SyntheticSolver().solve(ASKED, None)) for u in np.eye(2)]
    for before, after in zip(known, read_knots(io.BytesIO(knots_bytes(known))), strict=True):
        for name in ("place", "delta", "lam", "stiffness", "x", "dx"):
            np.testing.assert_array_equal(getattr(before, name), getattr(after, name))


def test_a_prediction_that_puts_walls_through_each_other_gives_way_to_the_nearest_state():
    problem, none = Problem(clip("tet4")), np.zeros(0)
    open_legs = knot(np.array([0.1, 0.1]), solve(problem, displacement([0.4, 0.08])))
    solver = SyntheticSolver(facts=replace(FACTS, contact=problem.body.contact))
    near, far = (
        _start(solver, [open_legs], open_legs.place, displacement(each), none) for each in ([0.5, 0.1], [4.0, 0.8])
    )
    assert np.abs(near.x - open_legs.x).max() > 0.01
    np.testing.assert_array_equal(far.x, open_legs.x)
