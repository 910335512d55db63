"""The verdict on made-up evidence."""

import numpy as np
import pytest

from cfem.core.errors import InputError, SpecError
from cfem.stability.case import Case, converges, either, named, refuses
from cfem.stability.evidence import Evidence, LimitCheck, error_misbehaviours, misbehaviours

GOOD = Evidence("CONVERGED", True, (LimitCheck("residual", 1e-12, 1e-8),), 1e-12, 1e-13, 1e-15, 0.1, 10.0, 5, 3)
ENDS = named("SINGULAR")


def verdict(expect, **changes):
    return misbehaviours(Case("case", expect, lambda: None), Evidence(**{**GOOD.__dict__, **changes}))


def test_right_is_right():
    assert verdict(converges()) == []
    assert verdict(either("SINGULAR")) == []
    assert verdict(ENDS, status="SINGULAR", claimed=False, smallest_eigenvalue=None) == []
    assert verdict(converges("semidefinite"), smallest_eigenvalue=-1e-15) == []
    assert verdict(converges("any"), smallest_eigenvalue=-1.0) == []


@pytest.mark.parametrize("value", [1e-7, np.nan, np.inf])
def test_a_check_that_fails_or_says_nothing_is_wrong(value):
    assert "residual" in verdict(converges(), checks=(LimitCheck("residual", value, 1e-8),))[0]


@pytest.mark.parametrize(
    "expect, changes",
    [
        (converges(), {"status": "SINGULAR", "claimed": False}),
        (either("SINGULAR"), {"status": "STEP_TOO_SMALL", "claimed": False}),
        (either("SINGULAR"), {"status": "TOO_MANY_ITERATIONS", "claimed": False}),
        (ENDS, {}),
        (refuses(SpecError, "outside"), {}),
        (converges(), {"smallest_eigenvalue": 0.0}),
        (converges(), {"smallest_eigenvalue": np.nan}),
        (converges("semidefinite"), {"smallest_eigenvalue": -1e-3}),
    ],
)
def test_what_was_not_expected_is_wrong(expect, changes):
    assert len(verdict(expect, **changes)) == 1


def test_errors_are_right_only_where_expected_and_where_they_name_the_cause():
    outside = Case("case", refuses(SpecError, "outside"), lambda: None)
    assert error_misbehaviours(outside, SpecError("cable 'a' lies outside the body")) == []
    assert "does not say" in error_misbehaviours(outside, SpecError("bad"))[0]
    for error in (InputError("outside"), ValueError("outside"), ZeroDivisionError()):
        assert type(error).__name__ in error_misbehaviours(outside, error)[0]
    assert "converges was due" in error_misbehaviours(Case("case", converges(), lambda: None), SpecError("outside"))[0]
