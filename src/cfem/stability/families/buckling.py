"""Shallow arches that snap through, and columns that buckle."""

from functools import partial

import numpy as np

from cfem.equilibrium.system.actuation import displacement, force
from cfem.equilibrium.system.robot import Robot
from cfem.mechanics.body import make_body
from cfem.mechanics.element import ELEMENTS
from cfem.mechanics.material import LAWS
from cfem.mechanics.material.law import Material
from cfem.stability.bodies import box, cable, robot, watched
from cfem.stability.case import Case, converges, either
from cfem.stability.examine import Trial, attempt

ELEMENTS_HERE = ("tet10p0", "tet10", "hex8")
SPAN, DEPTH, THICKNESS, RISE = 100.0, 6.0, 2.0, 5.0  # mm; the limit load is 4 mN, some 2 mm down
LENGTH, SIDE = 100.0, 4.0  # mm, of the column
# Euler's load of a column that is pulled towards its foot: Timoshenko and Gere, Theory of Elastic Stability, 2nd ed.,
# section 2.8.
EULER = np.pi**2 * SIDE**4 / 12 / LENGTH**2  # N, at 1 MPa


def cases() -> list[Case]:
    """Cases of arches and columns below and beyond their critical loads."""
    listed = []
    for element in ELEMENTS_HERE:
        arch_of, column_of = partial(arch, element), partial(column, element)
        listed += [
            Case(
                f"buckling/arch/{element}/half its limit load", converges(also=_above), attempt(arch_of, force([0.002]))
            ),
            Case(
                f"buckling/arch/{element}/past its limit load",
                either("LIMIT_POINT", "BIFURCATION", "UNSTABLE", also=_below),
                attempt(arch_of, force([0.006])),
            ),
            *(
                Case(
                    f"buckling/arch/{element}/crown lowered by {amount:g} mm",
                    converges("any"),
                    attempt(arch_of, displacement([amount])),
                )
                for amount in (1.0, 3.0, 5.0, 8.0, 14.0)
            ),
        ]
        for factor in (0.5, 0.9, 1.2, 2.0):
            expect = converges(also=_straight) if factor < 1 else either("BIFURCATION", "UNSTABLE", also=_bent)
            name = f"buckling/column/{element}/{factor} of Euler's load"
            listed.append(Case(name, expect, attempt(column_of, force([factor * EULER]))))
        expect = either("BIFURCATION", "UNSTABLE", definite="any", also=_bent)
        listed.append(
            Case(f"buckling/column/{element}/end displaced by 5 mm", expect, attempt(column_of, displacement([5.0])))
        )
    return listed


def arch(element: str) -> Robot:
    """A shallow arch held at both ends, its crown pulled down by a long cable."""

    def rise(X: np.ndarray) -> np.ndarray:
        s = X[:, 0] / SPAN
        return X + np.column_stack([0 * s, 0 * s, RISE * np.sin(np.pi * s)])

    mesh = box((SPAN, DEPTH, THICKNESS), (20, 1, 1), element, bend=rise)
    crown = (SPAN / 2, DEPTH / 2, RISE + THICKNESS / 2 - 0.05)
    pulled = cable(mesh, [crown], (*crown[:2], -1000.0), radius=2.5)
    body = make_body(mesh, ELEMENTS[element], Material(LAWS["neo-hookean"], 1.0, 0.3))
    ends = np.flatnonzero((mesh.X[:, 0] < 1e-9) | (mesh.X[:, 0] > SPAN - 1e-9))
    return robot(body, [pulled], [watched(mesh, crown)], fixed=ends, unilateral=False)


def column(element: str) -> Robot:
    """A slender column, held at its foot, pulled along its axis by a cable to its foot."""
    mesh = box((LENGTH, SIDE, SIDE), (16, 1, 1), element)
    body = make_body(mesh, ELEMENTS[element], Material(LAWS["neo-hookean"], 1.0, 0.0))
    middle = SIDE / 2
    pulled = cable(mesh, [(LENGTH - 1.0, middle, middle)], (0.0, middle, middle), radius=1.5)
    return robot(body, [pulled], [watched(mesh, (LENGTH - 5.0, middle, middle), radius=1.5)])


def _above(trial: Trial) -> str | None:
    return None if trial.answer.delta_e[2] > -RISE / 2 else "the crown has snapped through before its limit load"


def _below(trial: Trial) -> str | None:
    crown = trial.answer.delta_e[2]
    return None if not trial.answer.converged or crown < -RISE else f"the crown went down by {-crown:.1f} mm only"


def _straight(trial: Trial) -> str | None:
    aside = np.abs(trial.answer.delta_e[1:]).max()
    return None if aside < 1.0 else f"it has bent by {aside:.2g} mm below Euler's load"


def _bent(trial: Trial) -> str | None:
    aside = np.abs(trial.answer.delta_e[1:]).max()
    return None if not trial.answer.converged or aside > 5.0 else "it stands straight beyond Euler's load"
