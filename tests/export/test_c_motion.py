"""The step in C against that of Python, on a model that has learned to move."""

import ctypes

import numpy as np
import pytest
from motion.learned import dataset, model, problem

from cfem.core.errors import InputError
from cfem.export.c_motion import write_c_motion
from cfem.export.compiled import STANDARD, compiler, run
from cfem.motion.step import Command, at_rest, effectors, step
from cfem.surrogate.motion import fit_motion
from cfem.surrogate.spectral import fit

needs_compiler = pytest.mark.skipif(compiler() is None, reason="no C compiler")


def parts(prony=()):
    data = dataset()
    arrays, facts = fit_motion(data, max_degree=8, folds=3)
    viscosity = [{**one, "prony": list(prony)} for one in facts["viscosity"]]
    meta = {"kind": "spectral", "form": "displacement", "scene": "bar", "motion": {"viscosity": viscosity}}
    meta["rows"] = {"effectors": list(problem().robot.rows.effectors)}
    return meta, fit(data, max_degree=8, folds=3).arrays, arrays


@needs_compiler
@pytest.mark.parametrize("held", [True, False])
def test_steps_are_those_of_python(tmp_path, held):
    from cfem.motion.model import MotionModel

    meta, static, moving = parts([(0.3, 0.01)])
    assert write_c_motion(tmp_path, meta, static, moving) > 0
    sources = ["cfem_motion.c", "cfem_motion_data.c"]
    strict = ["-Wall", "-Wextra", "-Werror", "-ffp-contract=off", "-O2", "-shared", "-fPIC"]
    run([compiler(), *STANDARD, *strict, "-o", "libmotion.so", *sources, "-lm"], tmp_path)
    library, n_q = ctypes.CDLL(str(tmp_path / "libmotion.so")), len(moving["scale"])
    state = (ctypes.c_double * (1 + 5 * n_q + 1))()
    python = MotionModel(model().static, moving, meta["motion"]["viscosity"])
    delta, dt = np.array([1.5]), 2e-4
    now = at_rest(python, delta)
    library.cfem_motion_rest(state, (ctypes.c_double * 1)(*delta))
    flags, tip = (ctypes.c_int * 1)(int(held)), (ctypes.c_double * 3)()
    force = 0.8 * now.lam[0]
    for index in range(100):
        value = 1.5 + 0.5 * np.sin(0.05 * (index + 1)) if held else force
        told = Command(displacement=np.array([value])) if held else Command(force=np.array([value]))
        now = step(python, now, told, dt)
        step_of_c = library.cfem_motion_step(state, (ctypes.c_double * 1)(value), flags, ctypes.c_double(dt))
        assert step_of_c == 0
    found = np.array(state)
    for name, values in (("q", found[1 : 1 + n_q]), ("p", found[1 + n_q : 1 + 2 * n_q])):
        wanted = getattr(now, name)
        np.testing.assert_allclose(values, wanted, atol=1e-10 * np.abs(wanted).max())
    np.testing.assert_allclose(found[-1], now.lam[0], rtol=1e-9)
    library.cfem_motion_effectors(state, tip)
    wanted = effectors(python, now)
    np.testing.assert_allclose(np.array(tip), wanted, atol=1e-10 * np.abs(wanted).max())


@needs_compiler
def test_a_step_that_is_not_found_changes_nothing(tmp_path):
    write_c_motion(tmp_path, *parts([(0.3, 0.01)]))
    run(
        [compiler(), *STANDARD, "-shared", "-fPIC", "-o", "libmotion.so", "cfem_motion.c", "cfem_motion_data.c", "-lm"],
        tmp_path,
    )
    library, n_q = ctypes.CDLL(str(tmp_path / "libmotion.so")), model().n_q
    state = (ctypes.c_double * (1 + 5 * n_q + 1))()
    library.cfem_motion_rest(state, (ctypes.c_double * 1)(1.0))
    before, flags = list(state), (ctypes.c_int * 1)(1)
    assert library.cfem_motion_step(state, (ctypes.c_double * 1)(float("nan")), flags, ctypes.c_double(1e-3)) == 1
    assert list(state) == before


def test_other_kinds_say_so(tmp_path):
    meta, static, moving = parts()
    with pytest.raises(InputError, match="spectral"):
        write_c_motion(tmp_path / "c", {**meta, "kind": "mlp"}, static, moving)
    assert not (tmp_path / "c").exists()
