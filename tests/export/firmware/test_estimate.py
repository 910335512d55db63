"""The estimator in C against that of Python, and against the truth, on the bar's model."""

import re
import subprocess

import numpy as np
import pytest
from export.embedded import needs_compiler, tool
from support.bad_samples import KINDS, spoiling

import cfem
from cfem.core.errors import InputError
from cfem.export.compiled.build import STANDARD, compiler, run
from cfem.export.compiled.estimate import CompiledEstimator, estimate_parity
from cfem.export.firmware.copying import library_files
from cfem.export.firmware.estimate import firmware_filter, moving_frames, status_of, write_c_estimate
from cfem.export.spec import CEstimateSpec, CSpec
from cfem.predict.estimation.filter import Filter
from cfem.predict.estimation.markers import markers_near
from cfem.predict.load import load_model

pytestmark = needs_compiler
STRICT = ("-O0", "-Wall", "-Wextra", "-Werror", "-Wpedantic", "-fsanitize=undefined", "-fno-sanitize-recover")


def asked(model, loads=("tip.y", "skin.2"), markers=6, along=None, **other):
    places = {f"m{n}": {"mm": place.tolist()} for n, place in enumerate(markers_near(model, markers))}
    given = {"markers": places, "noise": "0.05 mm", "rate": "20 Hz", **other}
    given["actuators"] = {"displacement": "0.05 mm", "force": "10 mN"}
    if loads:
        given["loads"] = {"rows": list(loads), "largest": "10 mN", "lasts": "1 s", "along": along}
    return CEstimateSpec.model_validate(given)


@pytest.fixture(scope="module")
def both(model, tmp_path_factory):
    """The filter in Python and in C."""
    folder = tmp_path_factory.mktemp("c")
    made = write_c_estimate(folder, model, CSpec(estimate=asked(model)))
    return made, CompiledEstimator(folder, STRICT), folder


def frame(made, x, rng=None):
    n_a, one = made.estimator.model.rows.n_a, made.estimator
    places = one.places(x)
    if rng is not None:
        places = places + one.noise * rng.normal(size=places.shape)
    nothing = np.full(n_a, np.nan)
    return {"place": places, "displacement": nothing, "force": nothing, "command": nothing}


@pytest.mark.parametrize(("loads", "along"), [(("tip.y", "skin.2"), None), (("tip.y", "tip.z"), [1, 3]), ((), None)])
def test_a_moving_robot_with_lost_and_wrong_markers_is_estimated_as_in_python(model, tmp_path, loads, along):
    made = write_c_estimate(tmp_path, model, CSpec(estimate=asked(model, loads, along=along)))
    compiled = CompiledEstimator(tmp_path, STRICT)
    left_out = 0
    for one in moving_frames(made):
        answer, x, P = one.pop("answer"), one.pop("x"), one.pop("covariance")
        found = compiled.tick(**one)
        assert found.status == status_of(answer.status) and found.iterations == answer.iterations
        np.testing.assert_allclose(found.x, x, atol=1e-8 * made.estimator.scale.min())
        wide = np.outer(made.estimator.scale, made.estimator.scale)
        assert np.abs((found.covariance - P) / wide).max() < 1e-8
        np.testing.assert_allclose(found.effector, answer.delta_e, atol=1e-8)
        np.testing.assert_allclose(compiled.modes(x), answer.rows, atol=1e-8)
        assert found.noise == pytest.approx(answer.noise, rel=1e-6)
        assert found.left_out == sum(1 << m for m in answer.outliers)
        left_out += found.left_out > 0
    assert left_out > 8


def test_a_material_is_folded_in(bar_of_any_material, tmp_path):
    model = load_model(bar_of_any_material)
    spec = CSpec(estimate=asked(model), parameters={"young": "1.3 MPa", "poisson": 0.34})
    assert estimate_parity(tmp_path, write_c_estimate(tmp_path, model, spec)) < 1e-8
    other = CSpec(estimate=asked(model), parameters={"young": "2 MPa", "poisson": 0.34})
    write_c_estimate(tmp_path, model, CSpec(estimate=asked(model), parameters=spec.parameters))
    assert estimate_parity(tmp_path, firmware_filter(other.estimate, model, np.array([0.34, 2.0]))) > 1e-6


def test_intervals_cover(both):
    """One frame alone, forces as assumed: 95 % intervals hold in 92 to 98 % of 900 numbers."""
    made, compiled, _ = both
    rng, inside = np.random.default_rng(0), []
    for _ in range(300):
        x = np.concatenate([rng.uniform(1, 6, 1), 0.01 * rng.normal(size=2)])
        found = compiled.alone(**frame(made, x, rng))
        assert found.status == 0
        inside.append(np.abs(found.x - x) < 1.96 * np.sqrt(np.diag(found.covariance)))
    assert 0.92 < np.mean(inside) < 0.98


def test_statuses_say_what_is_wrong_and_spoil_nothing(both):
    made, compiled, _ = both
    x = np.array([3.0, 0.004, 0.0])
    compiled.reset()
    good = frame(made, x)
    first = compiled.tick(**good)
    assert first.status == 0 and first.left_out == 0
    blind = {**good, "place": np.full((6, 3), np.nan)}
    assert compiled.alone(**blind).status == 1  # fewer numbers than unknowns
    wrong = good["place"].copy()
    wrong[:3] += [[30.0, 0, 0], [0, -25.0, 0], [0, 0, 40.0]]
    assert compiled.tick(**{**good, "place": wrong}).status == 2
    odd = good["place"].copy()
    odd[2, 1] = np.inf
    assert compiled.tick(**{**good, "place": odd}).status == 0  # not measured
    last = compiled.tick(**blind)
    assert last.status == 0 and np.abs(last.x - x)[0] < 0.1  # what is known carries it
    huge = {**good, "place": np.full((6, 3), 1e200)}
    assert compiled.tick(**huge).status != 0
    after = compiled.tick(**good)
    assert after.status == 0 and np.abs(after.x - x)[0] < 0.05


def test_the_folder_s_own_test_passes_and_its_arrays_do_not_grow(both):
    """No heap; static memory is none, but for the caller's own filter."""
    _, _, folder = both
    strict, own = ["-Wall", "-Wextra", "-Werror", "-O1"], ("cfem_estimate.c", "cfem_estimate_fit.c")
    program = ["-o", "estimate", "estimate.c", *library_files(folder), "-lm"]
    run([compiler(), *STANDARD, *strict, *program], folder)
    said = run(["./estimate"], folder)
    assert "60 frames, 0 failed" in said
    run([compiler(), *STANDARD, *strict, "-c", *own], folder)
    symbols = run([tool("nm"), *(name.replace(".c", ".o") for name in own)], folder)
    assert not re.search(r" [bBdDC] ", symbols) and "malloc" not in symbols


@pytest.mark.slow
def test_it_runs_on_an_emulated_cortex_m7(bar, tmp_path):
    tool("arm-none-eabi-gcc"), tool("qemu-system-arm")
    model = load_model(bar / "models" / "bar" / "spectral")
    places = [place.tolist() for place in markers_near(model, 5)]
    markers = "{" + ", ".join(f"m{n}: {{mm: {place}}}" for n, place in enumerate(places)) + "}"
    (tmp_path / "export.yaml").write_text(
        f"model: {bar / 'models' / 'bar' / 'spectral'}\nout: out\nformats: [c]\nc:\n  vectors: 5\n  estimate:\n"
        f"    markers: {markers}\n    noise: 0.1 mm\n    loads: {{rows: [tip.y], largest: 10 mN}}\n"
    )
    results = cfem.run_stage("export", tmp_path / "export.yaml")["results"]
    assert results["parity"]["c estimate"] < 1e-8
    done = subprocess.run([tool("make"), "-s", "-C", tmp_path / "out" / "c", "emulate"], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    found = re.search(r"60 frames, 0 failed.*\na frame: mean \d+, without wrong markers (\d+)", done.stdout)
    assert 10_000 < int(found[1]) < 1_000_000


@pytest.mark.parametrize(
    ("change", "said"),
    [({"loads": ("top.x",)}, "no row 'top.x'"), ({"markers": 33}, "at most 32")],
)
def test_what_does_not_fit_gets_one_sentence(model, tmp_path, change, said):
    with pytest.raises((InputError, ValueError), match=said):
        write_c_estimate(tmp_path, model, CSpec(estimate=asked(model, **change)))


SPOILT, CLEAN = 60, 20  # frames
NUMBERS = ("place", "displacement", "force")


def spoilt_frames(made, seed, kind, what):
    """(frame, unknowns) of a robot that moves; `what` of these is spoilt for a while: places, displacement, force, or
    all at once; kind None: nothing."""
    rng, one = np.random.default_rng(seed), made.estimator
    names = [name for name in NUMBERS if kind is not None and what in (name, "all")]
    spoilt = {name: spoiling(kind, np.random.default_rng(seed), SPOILT) for name in names}
    for number in range(30 + SPOILT + CLEAN):
        u = np.array([3 + 1.5 * np.sin(0.1 * number)])
        x = np.r_[u, 0.005 * np.sin(0.03 * number), 0.004]
        given = {**frame(made, x, rng), "displacement": u + one.sensor * rng.normal(size=1), "command": u}
        given["force"] = one.tensions(x) + one.tension * rng.normal(size=1)
        for name in names:
            if 0 <= number - 30 < SPOILT:
                given[name] = spoilt[name](number - 30, given[name])
        yield given, x


def left_after_bad_frames(made, compiled, seed, kind, what, python=None):
    """By how much the unknowns are off more than in a recording without bad frames, over their standard deviation then,
    20 good frames later; inf where there is no estimate."""
    ends = []
    for bad in (None, kind):
        compiled.reset()
        for given, truth in spoilt_frames(made, seed, bad, what):
            found, x = compiled.tick(**given), truth
            if python is not None and bad is not None:
                answer = python.tick(given["place"], given["displacement"], given["command"], given["force"])
                assert found.status == status_of(answer.status)
                if not found.status:
                    np.testing.assert_allclose(found.x[:1], answer.delta_a, atol=1e-6)
        ends.append((found.x - x, np.sqrt(np.diag(found.covariance)), found.status))
    (clean, deviation, _), (off, _, status) = ends
    return np.inf if status else float((np.abs(off - clean) / deviation).max())


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("what", ["all", *(pytest.param(one, marks=pytest.mark.slow) for one in NUMBERS)])
def test_bad_frames_are_rejected_as_in_python_and_left_behind(both, kind, what):
    made, compiled, _ = both
    python = Filter(made.estimator, made.slip, made.ticks, made.offset, made.gate.spec)
    assert left_after_bad_frames(made, compiled, 2, kind, what, python) < 2


@pytest.mark.slow
def test_a_thousand_recordings_are_estimated_after_bad_frames(both):
    made, compiled, _ = both
    cases = [(KINDS[seed % 6], ("place", "displacement", "force", "all")[seed // 6 % 4]) for seed in range(1000)]
    left = [left_after_bad_frames(made, compiled, seed, *case) for seed, case in enumerate(cases)]
    assert max(left) < 2
