from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from cfem.control.search.qp import QpStatus
from cfem.stability.case import Case, named
from cfem.stability.evidence import misbehaviours
from cfem.stability.families.programs import _inverse
from cfem.stability.program import attempt

OPTIMAL = Case("case", named("OPTIMAL"), lambda: None)


@pytest.fixture(scope="module", params=["active_set", "osqp"])
def trial(request):
    return attempt(partial(_inverse, goal=(60.0, 20.0, 5.0)), request.param)()


def complaints(trial, **changes):
    return misbehaviours(OPTIMAL, replace(trial, answer=replace(trial.answer, **changes)).evidence())


def test_right_answers_stand(trial):
    assert complaints(trial) == []
    assert np.abs(trial.answer.y).max() + np.abs(trial.answer.z).max() > 0  # bounds are reached: they count


def test_wrong_answers_are_caught(trial):
    answer = trial.answer
    for changes, word in [
        ({"x": answer.x + 1e-3}, "stationarity"),
        ({"x": answer.x + 20.0}, "overstepped"),
        ({"x": answer.x * np.nan}, "not finite"),
        ({"z": answer.z + 1.0}, "stationarity"),
        ({"y": -answer.y, "z": -answer.z}, "not reached"),
        ({"status": QpStatus.INFEASIBLE}, "satisfy what is called infeasible"),
        ({"status": QpStatus.INACCURATE}, "not INACCURATE"),
    ]:
        assert any(word in sentence for sentence in complaints(trial, **changes)), (word, complaints(trial, **changes))


def test_an_infeasible_program_may_be_called_so(trial):
    empty = replace(trial.program, lower=np.full(3, 900.0), upper=np.full(3, 1000.0))
    called = replace(trial, program=empty, answer=replace(trial.answer, status=QpStatus.INFEASIBLE))
    assert misbehaviours(Case("case", named("INFEASIBLE"), lambda: None), called.evidence()) == []
