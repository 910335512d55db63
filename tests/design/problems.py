"""Design problems on the finger in closed form, and on functions whose fronts are known."""

import numpy as np
from parametric.synthetic import LENGTH, POISSON, ROWS, YOUNG, Arc

from cfem.condensed.parameters import Parameter
from cfem.design.objectives import Dexterity, Strength, position_rows
from cfem.design.problem import DesignProblem
from cfem.parametric.differences import Stencil
from cfem.parametric.states import States

TIP = position_rows(ROWS, "tip", "here")
REFERENCE = np.array([40.0, 0.45, 3.0])


def finger(constraints=None, free=(0, 1), **more) -> DesignProblem:
    """Bent by 10 mm of cable."""
    objectives = {"dexterity": Dexterity(TIP, 2, np.pi / 2, None), "strength": Strength(TIP, 1, 91.0, None)} | more
    return DesignProblem(Arc(), "displacement", np.array([10.0]), list(free), REFERENCE, objectives, constraints or {})


class Plain:
    """No robot: a family of states that carry p alone, x and y in [0, 1]."""

    rows, reach, length, stencil = ROWS, np.array([[0.0, 20.0]]), 40.0, Stencil(6, 0.01)
    parameters = (Parameter("x", "x", "1", 0.0, 1.0, 0.5), Parameter("y", "y", "1", 0.0, 1.0, 0.5))

    def at(self, kind, u, p):
        m = len(p)
        W = np.tile(np.eye(4), (m, 1, 1))
        return States(ROWS, W, np.zeros((m, 4)), np.zeros((m, 1)), np.asarray(p, float), np.zeros((m, 3)))


def plain(constraints=None, **objectives) -> DesignProblem:
    """objectives, constraints: functions of p (m, 2)."""
    wrapped = [
        {name: (lambda states, one=one: one(states.p)) for name, one in group.items()}
        for group in (objectives, constraints or {})
    ]
    return DesignProblem(Plain(), "displacement", np.zeros(1), [0, 1], np.array([0.5, 0.5]), *wrapped)


__all__ = ["LENGTH", "POISSON", "YOUNG", "finger", "plain"]
