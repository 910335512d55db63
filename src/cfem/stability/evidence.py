"""Evidence measured of an answer, and the verdict on it."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from cfem.stability.case import Case

# Above what the smallest eigenvalue of W, scaled to a unit diagonal, must be: beyond what rounding makes.
_DEFINITE = {
    "positive": (1e-12, "positive definite"),
    "semidefinite": (-1e-9, "positive semidefinite"),
    "any": (float("-inf"), "made of numbers"),
}


@dataclass(frozen=True)
class LimitCheck:
    """A measured value that must not exceed its limit; NaN does."""

    what: str
    value: float
    limit: float

    @property
    def passed(self) -> bool:
        return bool(self.value <= self.limit)

    def __str__(self) -> str:
        return f"{self.what}: {self.value:.2g}, at most {self.limit:.2g} is right"


@dataclass(frozen=True)
class Evidence:
    """Measurements of one answer; those after `checks` are for the table, None where there is none.

    status: its name
    claimed: whether it says to be an answer
    checks: all that must hold of it
    residual: relative, recomputed
    tolerance: what the answer states that its residual may be, as asked for or as rounding allows
    rounding: as stated
    asymmetry: of W, before it is symmetrised
    smallest_eigenvalue, condition: of W scaled to a unit diagonal, so that units do not matter"""

    status: str
    claimed: bool
    checks: tuple[LimitCheck, ...] = ()
    residual: float | None = None
    tolerance: float | None = None
    rounding: float | None = None
    asymmetry: float | None = None
    smallest_eigenvalue: float | None = None
    condition: float | None = None
    iterations: int | None = None
    factorizations: int | None = None


@runtime_checkable
class Examinable(Protocol):
    """A trial that says what was measured of its answer: what an attempt of a case returns."""

    def evidence(self) -> Evidence:
        """Measurements of the answer."""
        ...


def misbehaviours(case: Case, evidence: Evidence) -> list[str]:
    """Sentences about what is wrong; none where the answer is right and as expected."""
    expect = case.expect
    wrong = [str(check) for check in evidence.checks if not check.passed]
    if expect.error is not None:
        wrong.append(f"{expect} was due, and it went on to {evidence.status}")
    elif evidence.status not in expect.statuses:
        wrong.append(f"{' or '.join(sorted(expect.statuses))} was due, not {evidence.status}")
    if evidence.claimed and evidence.smallest_eigenvalue is not None:
        floor, what = _DEFINITE[expect.definite]
        if not evidence.smallest_eigenvalue > floor:
            wrong.append(f"W is not {what}: its smallest eigenvalue is {evidence.smallest_eigenvalue:.2g}")
    return wrong


def error_misbehaviours(case: Case, error: BaseException) -> list[str]:
    """Sentences about what is wrong with an exception: none where it is the error expected and names its cause."""
    expect = case.expect
    if expect.error is None or not isinstance(error, expect.error):
        return [f"{expect} was due, not {type(error).__name__}: {error}"]
    if expect.word not in str(error):
        return [f"{type(error).__name__} does not say '{expect.word}': {error}"]
    return []
