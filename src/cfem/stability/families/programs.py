"""Quadratic programs of inverse control at their worst, by both solvers:

minimise |W_ea lambda + delta_free_e - goal|^2 / 2 + ridge |W_aa lambda + delta_free_a|^2 / 2 within the bounds of the
tensions lambda and of the course W_aa lambda + delta_free_a."""

from collections.abc import Callable
from functools import partial

import numpy as np

from cfem.stability.case import Case, Expectation, named
from cfem.stability.program import HardProgram, attempt

OPTIMAL, INFEASIBLE, NOT_FINITE = named("OPTIMAL"), named("INFEASIBLE"), named("NOT_FINITE")
NAN, INF = float("nan"), float("inf")


def cases() -> list[Case]:
    """Cases of quadratic programs, each by both solvers."""
    tables: dict[str, tuple[Expectation, Callable[[], HardProgram]]] = {
        "well posed": (OPTIMAL, _inverse),
        "out of reach": (OPTIMAL, partial(_inverse, goal=(60.0, 20.0, 5.0))),
        "goal a metre away": (OPTIMAL, partial(_inverse, goal=(1e3, -1e3, 1e3))),
        "goal a kilometre away": (OPTIMAL, partial(_inverse, goal=(1e6, 0.0, 0.0))),
        "goal where it stands": (OPTIMAL, partial(_inverse, goal=(0.0, 0.0, 0.0))),
        "W_ea singular": (OPTIMAL, partial(_inverse, spread=0.0)),
        "W_ea singular, no ridge": (OPTIMAL, partial(_inverse, spread=0.0, ridge=0.0)),
        "W_ea zero, no ridge": (OPTIMAL, partial(_inverse, strength=0.0, ridge=0.0)),
        "condition 1e8": (OPTIMAL, partial(_inverse, spread=1e-8, ridge=0.0)),
        "condition 1e4, no ridge": (OPTIMAL, partial(_inverse, spread=1e-4, ridge=0.0)),
        "forces in kilonewtons": (OPTIMAL, partial(_inverse, force_unit=1e3)),
        "forces in nanonewtons": (OPTIMAL, partial(_inverse, force_unit=1e-9)),
        "lengths in kilometres": (OPTIMAL, partial(_inverse, length_unit=1e6)),
        "lengths in nanometres": (OPTIMAL, partial(_inverse, length_unit=1e-6)),
        "actuators 1e6 apart in strength": (OPTIMAL, partial(_inverse, apart=1e6)),
        "box of no width": (OPTIMAL, partial(_inverse, box=((2.0, 2.0), (0.0, 10.0), (0.0, 10.0)))),
        "all boxes of no width": (OPTIMAL, partial(_inverse, box=((2.0, 2.0), (1.0, 1.0), (0.0, 0.0)), course=None)),
        "box as narrow as rounding": (OPTIMAL, partial(_inverse, box=((2.0, 2.0 + 1e-12), (0.0, 10.0), (0.0, 10.0)))),
        "open boxes": (OPTIMAL, partial(_inverse, box=((0.0, INF), (-INF, INF), (-INF, 10.0)))),
        "no course rows": (OPTIMAL, partial(_inverse, course=None)),
        "course rows alike": (OPTIMAL, partial(_inverse, repeat=3)),
        "course of no width": (OPTIMAL, partial(_inverse, course=((2.0, 2.0), (0.0, 12.0), (0.0, 12.0)))),
        "bounds of the box that exclude each other": (
            INFEASIBLE,
            partial(_inverse, box=((2.0, 1.0), (0.0, 10.0), (0.0, 10.0))),
        ),
        "bounds of the course that exclude each other": (
            INFEASIBLE,
            partial(_inverse, course=((5.0, 4.0), (0.0, 12.0), (0.0, 12.0))),
        ),
        "course out of the box's reach": (
            INFEASIBLE,
            partial(_inverse, course=((900.0, 1000.0), (0.0, 12.0), (0.0, 12.0))),
        ),
        "course just out of the box's reach": (
            INFEASIBLE,
            partial(
                _inverse, course=((11.2, 12.0), (0.0, 12.0), (0.0, 12.0)), box=((0.0, 10.0), (0.0, 0.0), (0.0, 0.0))
            ),
        ),
        "objective of NaN": (NOT_FINITE, partial(_inverse, goal=(NAN, 0.0, 0.0))),
        "compliance infinite": (NOT_FINITE, partial(_inverse, strength=INF)),
        "bounds of NaN": (NOT_FINITE, partial(_inverse, course=((NAN, 1.0), (0.0, 12.0), (0.0, 12.0)))),
        "box of NaN": (NOT_FINITE, partial(_inverse, box=((NAN, 1.0), (0.0, 10.0), (0.0, 10.0)))),
    }
    return [
        Case(f"programs/{label}/{backend}", expect, attempt(make, backend))
        for label, (expect, make) in tables.items()
        for backend in ("active_set", "osqp")
    ]


def _inverse(
    goal: tuple[float, ...] = (6.0, 3.0, -2.0),
    spread: float = 0.3,
    strength: float = 1.0,
    ridge: float = 1e-6,
    force_unit: float = 1.0,
    length_unit: float = 1.0,
    apart: float = 1.0,
    box: tuple = ((0.0, 10.0), (0.0, 10.0), (0.0, 10.0)),
    course: tuple | None = ((0.0, 12.0), (0.0, 12.0), (0.0, 12.0)),
    repeat: int = 1,
) -> HardProgram:
    """Inverse step of three actuators and one effector.

    spread: smallest singular value of W_ea over its largest
    strength: of W_ea
    apart: force of the last actuator over that of the first, for the same motion
    force_unit, length_unit: of the numbers, in N and mm
    repeat: how often the rows of the course come"""
    U, V = (np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))[0] for seed in (1, 2))
    W_ea = (U * [1.0, np.sqrt(spread), spread]) @ V
    W_aa = np.array([[1.0, 0.3, 0.1], [0.3, 1.1, 0.2], [0.1, 0.2, 0.9]])
    with np.errstate(invalid="ignore"):
        unit = np.geomspace(1.0, apart, 3) / force_unit  # of a force of 1 N, as written
        W_ea, W_aa = strength * W_ea / unit / length_unit, W_aa / unit / length_unit
        M = np.vstack([W_ea, np.sqrt(ridge) * W_aa])
        d = np.concatenate([np.array(goal) / length_unit, np.zeros(3)])
    bounds = np.empty((0, 2)) if course is None else np.tile(np.array(course) / length_unit, (repeat, 1))
    rows = np.empty((0, 3)) if course is None else np.tile(W_aa, (repeat, 1))
    return HardProgram(M, d, rows, *bounds.T.copy(), np.array(box) * unit[:, None], 10.0 * unit)
