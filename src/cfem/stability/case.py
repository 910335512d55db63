"""A case: a name, what is right for it, said in advance, and how to try it."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

from cfem.core.errors import CfemError

# How a path may end that leads further than the robot can go.
AWAY = ("OUT_OF_REACH", "LIMIT_POINT", "BIFURCATION", "UNSTABLE")

Definite = Literal["positive", "semidefinite", "any"]


@dataclass(frozen=True)
class Expectation:
    """What is right for a case.

    statuses: names of those that a solve may end with
    error, word: of the CfemError that must be raised instead, and what its message must say
    definite: what W must be where an answer is claimed (semidefinite: rows depend on each other; any: the actuation
        holds what W alone does not)
    also: of the trial, a sentence that says what is wrong with it, None where nothing is"""

    statuses: frozenset[str] = frozenset()
    error: type[CfemError] | None = None
    word: str = ""
    definite: Definite = "positive"
    also: Callable[[Any], str | None] | None = None

    def __str__(self) -> str:
        if self.error is not None:
            return f"{self.error.__name__} '{self.word}'"
        claims = {"CONVERGED": "converges", "OPTIMAL": "optimal"}
        causes = sorted(self.statuses - claims.keys())
        named = causes if len(causes) < 2 else ["named cause"]
        return " or ".join([word for name, word in claims.items() if name in self.statuses] + named)


def converges(definite: Definite = "positive", also: Callable[[Any], str | None] | None = None) -> Expectation:
    """An equilibrium that stands up to the recomputation, and nothing else."""
    return Expectation(frozenset({"CONVERGED"}), definite=definite, also=also)


def named(*statuses: str) -> Expectation:
    """No equilibrium, and one of these causes."""
    return Expectation(frozenset(statuses))


def either(
    *statuses: str, definite: Definite = "positive", also: Callable[[Any], str | None] | None = None
) -> Expectation:
    """An equilibrium that stands up to the recomputation, or one of these causes."""
    return Expectation(frozenset({"CONVERGED", *statuses}), definite=definite, also=also)


def refuses(error: type[CfemError], word: str) -> Expectation:
    """Expectation of an error that names what is wrong by this word, in one sentence."""
    return Expectation(error=error, word=word)


@dataclass(frozen=True)
class Case:
    """A named situation.

    name: family/what
    attempt: makes the body and solves, and returns a trial (trial.py, program.py)
    heavy: takes minutes or gigabytes, and runs on request only"""

    name: str
    expect: Expectation
    attempt: Callable[[], Any]
    heavy: bool = False
