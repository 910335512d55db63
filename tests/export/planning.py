"""The tick in C that plans with contact, and Python's inverse step at the same states."""

import ctypes
from types import SimpleNamespace

import numpy as np
import pytest

from cfem.condensed.strokes import ridge_of
from cfem.control.search.inverse import Aim, Limits, inverse_step
from cfem.export.compiled.build import STANDARD, compiler, run
from cfem.export.compiled.controller import CompiledController
from cfem.export.compiled.touch import CompiledTouch

NO_MODEL = 64  # of cfem.h
LONGEST = 5.0  # mm: the step that the exports state
OTHERS = """#include "cfem_touch_control.h"
double *others(cfem_touch_controller *c) { return c->others[1]; }
int size(void) { return (int)sizeof(cfem_touch_controller); }
"""


class Planning(CompiledController):
    """cfem_touch_control of a folder."""

    def __init__(self, folder, obstacles, mu, flags):
        super().__init__(folder)
        touch = CompiledTouch(folder, flags)
        _, (_, self._bodies, count, friction, *_) = touch.given(np.zeros(1), obstacles, mu)
        self._state = (ctypes.c_double * 2_000_000)()
        self._references[0] = ctypes.byref(self._state)  # which the controller points to, and to the bodies
        assert touch.library.cfem_touch_control_init(self._references[0], self._bodies, count, friction) == 0
        self._library = SimpleNamespace(cfem_step=touch.library.cfem_touch_control)
        if (folder / "cfem_meet.c").exists():
            (folder / "others.c").write_text(OTHERS)
            run([compiler(), *STANDARD, "-shared", "-fPIC", "-o", "others.so", "others.c"], folder)
            at = ctypes.CDLL(str(folder / "others.so"))
            assert at.size() <= ctypes.sizeof(self._state)
            at.others.restype = ctypes.POINTER(ctypes.c_double)
            self.others = at.others(self._references[0])


def demand_same_ticks(planning, among, now, wanted):
    """Goals of the free tip at displacements `wanted`, from delta_a `now`, where `among` has settled. By how much of
    the free W_aa that of the touched robot differs, at most."""
    model, apart = among.patched.model, 0.0
    limits = Limits.of(model.reach, np.ones(model.rows.n_a, dtype=bool))
    for one in wanted:
        goal = model.rest_e + model.at_displacement(np.array([one])).delta_e
        aim = Aim(goal - model.rest_e, np.ones(len(goal)), ridge_of(1e-10, model.reach, model.length))
        here = among.at_displacement(now)
        step, found = inverse_step(here, aim, limits.within(now, LONGEST)), planning.step(goal)
        assert not found.status & NO_MODEL and found.delta_a == pytest.approx(step.delta_a, abs=1e-6)
        apart = max(apart, abs(here.W_aa[0, 0] / model.at_displacement(now).W_aa[0, 0] - 1))
        now = found.delta_a
        among.settle(now)
    return apart
