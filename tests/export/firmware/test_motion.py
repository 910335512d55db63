"""The step in C against that of Python, on robots that move, made by hand."""

import ctypes
from itertools import product

import numpy as np
import pytest
from export.embedded import export, needs_compiler
from export.moving import model, robot
from support.fast_cases import fast_are

from cfem.core.errors import InputError
from cfem.export.compiled.build import library
from cfem.export.firmware.motion import write_c_motion
from cfem.motion.step import MotionCommand, at_rest, effectors, step

STRICT = ("-Wall", "-Wextra", "-Werror", "-ffp-contract=off", "-O1")


def compiled(folder, n_a):
    meta, arrays, moving = robot(n_a)
    export(folder, (meta, arrays))
    assert write_c_motion(folder, meta, arrays, moving) > 0
    return library(folder, STRICT)


@needs_compiler
@pytest.mark.parametrize("n_a, held", fast_are([(1, True), (2, False)], product([1, 2], [True, False])))
def test_steps_are_those_of_python(tmp_path, n_a, held):
    python, c = model(n_a), compiled(tmp_path, n_a)
    n_q = python.n_q
    state, doubles = (ctypes.c_double * (1 + 5 * n_q + n_a))(), ctypes.c_double * n_a
    delta, dt = python.static.domain.delta_a.mean(axis=0), 2e-3
    now = at_rest(python, delta)
    c.cfem_motion_rest(state, doubles(*delta))
    flags, tip = (ctypes.c_int * n_a)(*[int(held)] * n_a), (ctypes.c_double * 3)()
    force = 0.8 * now.lam
    for index in range(60):
        value = delta * (1 + 0.2 * np.sin(0.1 * (index + 1))) if held else force
        told = MotionCommand(displacement=value) if held else MotionCommand(force=value)
        now = step(python, now, told, dt)
        assert c.cfem_motion_step(state, doubles(*value), flags, ctypes.c_double(dt)) == 0
    found = np.array(state)
    assert np.abs(now.q[n_a:]).max() > 1e-2
    for name, values in (("q", found[1 : 1 + n_q]), ("p", found[1 + n_q : 1 + 2 * n_q])):
        wanted = getattr(now, name)
        np.testing.assert_allclose(values, wanted, atol=1e-10 * np.abs(wanted).max())
    np.testing.assert_allclose(found[-n_a:], now.lam, rtol=1e-9)
    c.cfem_motion_effectors(state, tip)
    wanted = effectors(python, now)
    np.testing.assert_allclose(np.array(tip), wanted, atol=1e-10 * np.abs(wanted).max())


@needs_compiler
def test_a_step_that_is_not_found_changes_nothing(tmp_path):
    c, n_q = compiled(tmp_path, 1), model(1).n_q
    state = (ctypes.c_double * (1 + 5 * n_q + 1))()
    c.cfem_motion_rest(state, (ctypes.c_double * 1)(1.0))
    before, flags = list(state), (ctypes.c_int * 1)(1)
    assert c.cfem_motion_step(state, (ctypes.c_double * 1)(float("nan")), flags, ctypes.c_double(1e-3)) == 1
    assert list(state) == before


def test_other_kinds_say_so(tmp_path):
    meta, arrays, moving = robot()
    with pytest.raises(InputError, match="spectral"):
        write_c_motion(tmp_path / "c", {**meta, "kind": "mlp"}, arrays, moving)
    assert not (tmp_path / "c").exists()
