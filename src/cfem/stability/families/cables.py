"""Cables: pulled far and further than there is to pull, slack, folded, doubled, without a place to go."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from cfem.core.errors import SpecError
from cfem.equilibrium.system.actuation import displacement, force, pull
from cfem.equilibrium.system.robot import Robot
from cfem.mechanics.element import ELEMENTS
from cfem.mechanics.material import LAWS
from cfem.stability.bodies import bar, bar_body, bar_cables, cable, robot, watched
from cfem.stability.case import AWAY, Case, converges, either, named, refuses
from cfem.stability.examine import Trial, attempt

BESIDE = [(15.0, 3.0, 5.0), (35.0, 3.0, 5.0), (55.0, 3.0, 5.0)]
ROUTES = {  # points, pull point
    "corner of 90 degrees": ([(30.0, 5.0, 2.0), (30.0, 5.0, 8.0)], (0.0, 5.0, 2.0)),
    "folded back": ([(50.0, 5.0, 2.0), (15.0, 5.0, 2.0)], (0.0, 5.0, 2.0)),
    "zigzag": ([(15.0, 5.0, 2.0), (20.0, 5.0, 8.0), (25.0, 5.0, 2.0), (30.0, 5.0, 8.0)], (0.0, 5.0, 2.0)),
    "within the body": ([(20.0, 5.0, 2.0), (40.0, 5.0, 2.0)], None),
    "points 0.01 mm apart": ([(30.0, 5.0, 2.0), (30.01, 5.0, 2.0), (50.0, 5.0, 2.0)], (0.0, 5.0, 2.0)),
    "pull point 10 km away": ([(55.0, 5.0, 5.0)], (55.0, 5.0, 1e7)),
}
PULLS = {  # of a single cable along the bar, whose length is 55 mm: mm, expectation
    "to 25 % of its length": (14.0, converges()),
    "to 50 % of its length": (27.5, either(*AWAY)),
    "to 99 % of its length": (54.5, either(*AWAY)),
    "to its whole length": (55.0, named(*AWAY)),
    "beyond its length": (200.0, named(*AWAY)),
    "a kilometre": (1e6, named(*AWAY)),
}
SLACK = {
    "one of two": ([6.0, -4.0], [False, True]),
    "both": ([-3.0, -5.0], [True, True]),
    "by a hair": ([0.0, -1e-6], [True, True]),
    "by a metre": ([6.0, -1e3], [False, True]),
    "neither": ([6.0, 4.0], [False, False]),
}


def cases() -> list[Case]:
    """Cases of cables, from pulled to refused."""
    return [*_pulled(), *_slack_or_routed(), *_special()]


def _pulled() -> list[Case]:
    """Cases of cables that are pulled by a part of their length, by all of it, and by more."""
    return [
        Case(f"cables/pulled {label}/{law}", expect, attempt(partial(_single, law=law), displacement([amount])))
        for law in LAWS
        for label, (amount, expect) in PULLS.items()
    ] + [
        Case(
            f"cables/both pulled to half/{element}",
            either(*AWAY),
            attempt(partial(_two, element), displacement([27.5, 27.5])),
        )
        for element in ELEMENTS
    ]


def _slack_or_routed() -> list[Case]:
    """Cables that go slack, and cables on every route."""
    return [
        Case(f"cables/slack/{label}", converges(also=partial(_slack, which)), attempt(bar, displacement(target)))
        for label, (target, which) in SLACK.items()
    ] + [
        Case(f"cables/{label}/{how}", converges(), attempt(partial(_routed, label), actuation))
        for label in ROUTES
        for how, actuation in {"displacement": displacement([2.0]), "force": force([0.2])}.items()
    ]


def _special() -> list[Case]:
    """Cables drawn to their pull points, alike, pushing, or without a place to go."""
    return [
        Case("cables/tip drawn almost to its pull point", converges(), attempt(_to_pull_point, displacement([14.9]))),
        Case(
            "cables/tip drawn onto its pull point",
            named(*AWAY, "SINGULAR"),
            attempt(_to_pull_point, displacement([15.0])),
        ),
        Case("cables/tip drawn beyond its pull point", named(*AWAY), attempt(_to_pull_point, displacement([16.0]))),
        Case("cables/two alike, displacements", named("SINGULAR"), attempt(_alike, displacement([3.0, 3.0]))),
        Case(
            "cables/two alike, displacements that differ",
            converges("semidefinite", also=partial(_slack, [False, True])),
            attempt(_alike, displacement([3.0, 2.0])),
        ),
        Case("cables/two alike, forces", converges("semidefinite"), attempt(_alike, force([0.3, 0.2]))),
        Case(
            "cables/two alike, pulled as one",
            converges("semidefinite"),
            attempt(_alike, pull([0.3, 0.3], [10.0, 10.0])),
        ),
        Case(
            "cables/two nearly alike",
            either("SINGULAR", definite="semidefinite"),
            attempt(partial(_alike, 1e-6), displacement([3.0, 3.0])),
        ),
        Case("cables/asked to push", converges(also=partial(_slack, [True, False])), attempt(bar, force([-0.3, 0.2]))),
        Case(
            "cables/pushing where they may",
            converges(),
            attempt(partial(bar, unilateral=False), displacement([-3.0, 1.0])),
        ),
        Case(
            "cables/coincident points",
            refuses(SpecError, "coincide"),
            partial(_refused, [(30.0, 5.0, 2.0)] * 2, (0.0, 5.0, 2.0)),
        ),
        Case(
            "cables/point at its pull point",
            refuses(SpecError, "coincide"),
            partial(_refused, [(30.0, 5.0, 2.0)], (30.0, 5.0, 2.0)),
        ),
        Case("cables/one point alone", refuses(SpecError, "two points"), partial(_refused, [(30.0, 5.0, 2.0)], None)),
        Case("cables/no point", refuses(SpecError, "two points"), partial(_refused, [], (0.0, 5.0, 2.0))),
    ]


def _slack(expected: Sequence[bool], trial: Trial) -> str | None:
    slack = trial.answer.slack.tolist()
    right = slack == list(expected) or not trial.answer.converged
    return None if right else f"slack cables are {slack}, not {list(expected)}"


def _single(law: str = "neo-hookean") -> Robot:
    body = bar_body(law=law)
    return robot(body, bar_cables(body.mesh)[:1], [watched(body.mesh, (60.0, 5.0, 5.0))])


def _two(element: str) -> Robot:
    return bar(bar_body(element))


def _routed(label: str) -> Robot:
    body = bar_body()
    return robot(body, [cable(body.mesh, *ROUTES[label])], [watched(body.mesh, (60.0, 5.0, 5.0))])


def _to_pull_point() -> Robot:
    body = bar_body()
    lift = cable(body.mesh, [(55.0, 5.0, 5.0)], (55.0, 5.0, 20.0))
    return robot(body, [lift], [watched(body.mesh, (60.0, 5.0, 5.0))])


def _alike(apart: float = 0.0) -> Robot:
    body = bar_body()
    both = [
        cable(body.mesh, BESIDE, (0.0, 3.0, 5.0)),
        cable(body.mesh, np.add(BESIDE, [0.0, apart, 0.0]), (0.0, 3.0 + apart, 5.0)),
    ]
    return robot(body, both, [watched(body.mesh, (60.0, 5.0, 5.0))])


def _refused(points: Sequence[Sequence[float]], pull_point: Sequence[float] | None):
    return cable(bar_body().mesh, points, pull_point)
