"""The filter of what moves in C against that of Python, and against the truth, on the bar's model."""

import ctypes
import re

import numpy as np
import pytest
from export.embedded import needs_compiler, tool
from support.fast_cases import fast_are

from cfem.core.errors import InputError, SpecError
from cfem.export.compiled.build import run
from cfem.export.compiled.swing import CompiledSwing
from cfem.export.firmware.estimate import bits, firmware_filter, status_of, write_c_estimate
from cfem.export.firmware.folder import write_c
from cfem.export.firmware.motion import write_c_motion
from cfem.export.firmware.mpc import write_c_mpc
from cfem.export.firmware.swing import moving_filter_of, swinging_frames, write_c_swing
from cfem.export.spec import CSpec
from cfem.motion.estimation.marker_filter import MarkerFilter
from cfem.motion.load import load_motion
from cfem.motion.step import MotionCommand, at_rest, step
from cfem.predict.estimation.markers import markers_near
from cfem.predict.load import load_model, read_arrays, read_model

pytestmark = needs_compiler
STRICT = ("-O0", "-Wall", "-Wextra", "-Werror", "-Wpedantic", "-fsanitize=undefined", "-fno-sanitize-recover")
DT, TIP = 2e-3, ("tip.x", "tip.y", "tip.z")


@pytest.fixture(scope="module")
def folder(moving_bar):
    return moving_bar / "models" / "bar" / "spectral"


def asked(folder, driven="displacement", loads=TIP, **other):
    places = markers_near(load_model(folder), 5)
    given = {"markers": {f"m{n}": {"mm": place.tolist()} for n, place in enumerate(places)}, "noise": "0.1 mm"}
    given |= {"rate": "500 Hz", "dynamics": {"driven": driven}, "actuators": {"displacement": "0.05 mm"}}
    if loads:
        given["loads"] = {"rows": list(loads), "largest": "10 mN", "lasts": "1 s"}
    return CSpec.model_validate({"vectors": 3, "estimate": given, **other})


def written(place, folder, spec):
    """The filter in Python, and its C folder."""
    meta, arrays = read_model(folder)
    model, motion = load_model(folder), load_motion(folder)
    write_c(place, meta, arrays, spec, model.domain.states[:3, :1])
    write_c_motion(place, meta, arrays, read_arrays(folder, "motion.npz"))
    return write_c_swing(place, write_c_estimate(place, model, spec), spec, motion)


@pytest.fixture(scope="module")
def both(folder, tmp_path_factory):
    place = tmp_path_factory.mktemp("c")
    made = written(place, folder, asked(folder))
    return made, CompiledSwing(place, STRICT), place


def compared(made, compiled):
    """Statuses, iterations and markers left out as in Python, numbers to 1e-8 of their scale; how many left one out."""
    left_out = 0
    for one in swinging_frames(made, DT):
        answer, x, P = one.pop("answer"), one.pop("x"), one.pop("covariance")
        found = compiled.frame(**one)
        assert (found.status, found.iterations) == (status_of(answer.status), answer.iterations)
        assert found.left_out == bits(answer.outliers)
        assert found.unseen == bits(tuple(made.unknowns.index(name) for name in answer.unseen))
        assert np.abs((found.x - x) / made.scale).max() < 1e-8
        assert np.abs((found.covariance - P) / np.outer(made.scale, made.scale)).max() < 1e-8
        assert found.noise == pytest.approx(answer.noise, rel=1e-6)
        np.testing.assert_allclose(found.effector, answer.delta_e, atol=1e-8)
        np.testing.assert_allclose(compiled.modes(x), answer.rows, atol=1e-8)
        left_out += found.left_out > 0
    return left_out


def test_a_robot_that_rings_is_followed_as_in_python(both):
    """Markers lost and wrong, a frame without any, an actuator that is not where its command is."""
    assert compared(*both[:2]) > 8


@pytest.mark.parametrize(
    ("driven", "loads"), fast_are([("force", ("tip.y",))], [("force", ("tip.y",)), ("displacement", ())])
)
def test_so_is_one_under_forces_and_one_that_nobody_pushes(folder, tmp_path, driven, loads):
    made = written(tmp_path, folder, asked(folder, driven, loads))
    compiled, nothing = CompiledSwing(tmp_path), np.full(1, np.nan)
    assert compared(made, compiled) > 8
    compiled.reset()
    blind = compiled.frame(place=made.estimator.rest, displacement=nothing, force=nothing, command=nothing)
    assert blind.status == (16 if driven == "force" else 0)  # forces that nobody stated


def test_intervals_hold(both, folder):
    """A step of the model's own motion, whose vibration the filter does not know: 95 % intervals hold in 90 % or more.
    They may hold in all, as this motion has none of the faults of model and actuators that the filter allows for; so
    that they say something, most are less than half as wide as what varies."""
    made, compiled, _ = both
    motion, rng, swings = load_motion(folder), np.random.default_rng(0), []
    missed, truth, deviation = [], [], []
    nothing = np.full(1, np.nan)
    for _ in range(6):
        compiled.reset()
        now, push = at_rest(motion, np.array([2.0])), 0.01 * rng.normal(size=3)
        for frame in range(30):
            u = np.array([2.0 if frame < 3 else 2.6])
            for _ in range(4):
                now = step(motion, now, MotionCommand(displacement=u, push=push), DT / 4)
            y = np.r_[now.q, push, 0.0]
            swings.append(np.abs(now.q[1:]).max())
            seen = made.estimator.rest + made.markers.seen(y)[0].reshape(-1, 3)
            seen = seen + 0.1 * rng.normal(size=seen.shape)
            found = compiled.frame(place=seen, displacement=nothing, force=nothing, command=u)
            assert found.status == 0
            if frame > 10:
                missed.append(np.abs(found.x - y)), truth.append(y)
                deviation.append(np.sqrt(np.diag(found.covariance)))
    inside = np.array(missed) < 1.96 * np.array(deviation)
    varies = np.std(truth, axis=0) > 1e-6 * made.scale
    sharp = np.std(truth, axis=0)[varies] / np.mean(deviation, axis=0)[varies]
    assert inside[:, varies].mean() > 0.9 and np.median(sharp) > 2 and max(swings) > 0.3


def test_it_begins_again_where_it_is_lost(both):
    made, compiled, _ = both
    compiled.reset()
    nothing, u = np.full(1, np.nan), np.array([2.0])
    good = {"place": made.estimator.places(np.r_[2.0, 0, 0, 0]), "displacement": nothing, "force": nothing}
    good["command"] = u
    assert compiled.frame(**good).status == 0
    huge = {**good, "place": np.full((5, 3), 1e200)}
    for _ in range(12):
        assert compiled.frame(**huge).status != 0
    after = compiled.frame(**good)
    assert after.status == 0 and abs(after.x[0] - 2.0) < 0.1


@pytest.mark.parametrize("garbage", [1e9, -1e300, np.nan])
def test_a_command_that_no_robot_reaches_is_not_followed(both, garbage):
    made, compiled, _ = both
    compiled.reset()
    filtered = MarkerFilter(made.estimator, made.motion, made.kind, made.uncertainty, made.gate.spec)
    nothing, u = np.full(1, np.nan), made.estimator.middle[:1]
    y = np.r_[at_rest(made.motion, u).q, np.zeros(len(made.scale) - made.motion.n_q)]
    places = made.estimator.rest + made.markers.seen(y)[0].reshape(-1, 3)
    for frame in range(12):
        command = np.array([garbage]) if frame == 9 else u
        answer = filtered.tick(places, None, command, DT if frame else 0.0)
        found = compiled.frame(place=places, displacement=nothing, force=nothing, command=command)
        assert found.status == status_of(answer.status) == 0
        np.testing.assert_allclose(found.x / made.scale, filtered.last[0] / made.scale, atol=1e-8)


@pytest.mark.slow
def test_a_folder_with_predictive_control_too_tests_itself(folder, tmp_path):
    """Its steps are compiled twice, with other lengths. No static memory."""
    spec = asked(folder, mpc={"ticks": "100 Hz", "horizon": 5}, controller={"command": "force"})
    written(tmp_path, folder, spec)
    write_c_mpc(tmp_path, spec, *read_model(folder), read_arrays(folder, "motion.npz"))
    run([tool("make"), "-s", "swing"], tmp_path)
    assert "filter of what moves: 60 frames, 0 failed" in run(["./swing"], tmp_path)
    symbols = run([tool("nm"), "cfem_swing.o", "cfem_swing_step.o", "cfem_swing_places.o"], tmp_path)
    assert not re.search(r" [bBdDC] ", symbols) and "malloc" not in symbols


def test_what_has_no_c_code_gets_one_sentence(folder):
    def refused(spec):
        return moving_filter_of(firmware_filter(spec.estimate, load_model(folder), None), spec, load_motion(folder))

    with pytest.raises(InputError, match="has loads on effectors only"):
        refused(asked(folder, loads=("skin.1",)))
    with pytest.raises(SpecError, match="double precision"):
        refused(asked(folder, scalar="float"))


@pytest.mark.parametrize("driven", fast_are({"force"}, ["displacement", "force"]))
def test_the_slope_by_a_slip_is_that_of_the_command(folder, tmp_path, driven):
    """Against differences of the frame's own motion, of two steps or more."""
    spec = asked(folder, driven)
    rare = spec.model_copy(update={"estimate": spec.estimate.model_copy(update={"rate": 100.0})})
    made = written(tmp_path, folder, rare)
    compiled = CompiledSwing(tmp_path)
    assert made.forward.count(0.01) > 1
    stands = at_rest(made.motion, made.estimator.middle[:1])
    u = stands.q[:1] if driven == "displacement" else stands.lam

    def after(command):
        compiled.reset()
        state = compiled._filter
        np.ctypeslib.as_array(state.z)[: made.motion.n_q] = stands.q
        np.ctypeslib.as_array(state.u)[:], state.known = u, 1
        compiled._library.cfem_swing_advance(ctypes.byref(state), (ctypes.c_double * 1)(*command))
        assert state.known
        return np.array(state.z), np.array(state.by_slip)[:, 0]

    h = 1e-4 * u
    expected = (after(1.05 * u + h)[0] - after(1.05 * u - h)[0]) / (2 * h)
    found, n_q = after(1.05 * u)[1], made.motion.n_q
    for part in (slice(n_q), slice(n_q + (driven == "displacement"), 2 * n_q)):
        np.testing.assert_allclose(found[part], expected[part], atol=3e-2 * np.abs(expected[part]).max())
