"""The FMUs as fmpy sees them: valid, equal to Python, and clear about what they refuse."""

import ctypes
import shutil
import subprocess
import zipfile
from pathlib import Path

import fmpy
import numpy as np
import pytest
from export import moving
from export.embedded import needs_compiler, serial, spectral
from export.fmus import Unit, written
from export.test_c_controller import curve, limits_of
from fmpy.fmi1 import FMICallException
from fmpy.fmi3 import FMU3Model
from fmpy.validation import validate_fmu

from cfem.condensed.strokes import ridge_of
from cfem.control.closed_loop.tick import Belief, Pilot, drive
from cfem.control.search.goal_search import SearchSettings
from cfem.export.compiled.build import STANDARD, compiler, run
from cfem.export.fmu import pack
from cfem.motion.step import MotionCommand, at_rest, effectors, step
from cfem.predict.load import build

pytestmark = needs_compiler
EXACT = 1e-9
STEP = {"step": "5 ms"}


@pytest.fixture(scope="module")
def placed(tmp_path_factory):
    """Displacements are commanded; the robot moves too."""
    meta, arrays, motion = moving.robot()
    folder = tmp_path_factory.mktemp("placed")
    return written(folder, (meta, arrays), motion, STEP, start={"mm": [6.0, 5.0]})


@pytest.fixture(scope="module")
def forced(tmp_path_factory):
    """Forces are commanded, by the tick of the paper."""
    meta, arrays, motion = moving.robot()
    control = {"command": "force", "halvings": 0, "step": "3 mm", "start": {"mm": [6.0, 5.0]}}
    return written(tmp_path_factory.mktemp("forced"), (meta, arrays), motion, STEP, **control)


@pytest.fixture
def unit(tmp_path, request):
    """Starts FMUs, and ends them after the test."""
    started = []

    def start(path: Path, **values) -> Unit:
        started.append(Unit(path, tmp_path / str(len(started)), **values))
        return started[-1]

    yield start
    for one in started:
        one.close()


@pytest.mark.parametrize("kind", ["placed", "forced"])
def test_fmpy_finds_no_problem(request, kind):
    fmus = request.getfixturevalue(kind)
    assert set(fmus) == {"controller", "robot", "moving"}
    for path in fmus.values():
        assert validate_fmu(str(path)) == []


def test_units_convert_to_si(placed):
    units = {one.name: one.baseUnit for one in fmpy.read_model_description(str(placed["robot"])).unitDefinitions}
    assert (units["mm"].m, units["mm"].factor) == (1, 1e-3)
    assert (units["N"].kg, units["N"].m, units["N"].s, units["N"].factor) == (1, 1, -2, 1.0)


def test_the_robot_is_that_of_python(placed, unit):
    model, robot = build(*spectral()), unit(placed["robot"])
    for u in ([6.0, 5.0], [7.0, 9.0], [9.5, 8.0]):
        robot.put("command", u)
        if u != [6.0, 5.0]:  # outputs at the start are those of the start values
            robot.step(0.02)
        expected = model.at_displacement(u)
        assert robot.get("position") == pytest.approx(model.rest_e + expected.delta_e, abs=EXACT)
        assert robot.get("force") == pytest.approx(expected.lambda_a, abs=EXACT)
        assert robot.get("displacement") == u and robot.get("outside") == [0]


def test_so_is_the_robot_under_forces(forced, unit):
    model, robot = build(*spectral()), unit(forced["robot"])
    for u in ([6.0, 5.0], [2.0, 9.0]):
        forces = model.at_displacement(u).lambda_a
        robot.put("command", forces)
        robot.step(0.02)
        assert robot.get("displacement") == pytest.approx(u, abs=EXACT)
        assert robot.get("position") == pytest.approx(model.rest_e + model.at_displacement(u).delta_e, abs=EXACT)


def test_modules_in_a_row_are_a_robot_too(tmp_path, unit):
    meta, arrays = serial()
    model = build(meta, arrays)
    robot = unit(written(tmp_path, (meta, arrays), None, {"parts": ["robot"]})["robot"])
    u = np.linspace(2.0, 9.0, model.rows.n_a)
    robot.put("command", u)
    robot.step()
    assert robot.get("position") == pytest.approx(model.rest_e + model.at_displacement(u).delta_e, abs=EXACT)
    assert robot.get("force") == pytest.approx(model.at_displacement(u).lambda_a, abs=EXACT)


def test_fmpy_simulates_it(placed):
    model = build(*spectral())
    given = np.array(
        [(0.0, 6.0, 5.0), (0.1, 8.0, 5.0)], dtype=[("time", float), ("command.c0", float), ("command.c1", float)]
    )
    names = [f"command.{name}" for name in model.rows.actuators]
    given.dtype.names = ("time", *names)
    wanted = [f"position.{name}" for name in model.rows.effectors]
    found = fmpy.simulate_fmu(str(placed["robot"]), stop_time=0.1, output_interval=0.05, input=given, output=wanted)
    last = [found[name][-1] for name in wanted]
    # the input at the beginning of the last step: halfway
    assert last == pytest.approx(model.rest_e + model.at_displacement([7.0, 5.0]).delta_e, abs=EXACT)


@pytest.mark.parametrize("kind", ["placed", "forced"])
def test_the_robot_in_motion_is_that_of_python(request, unit, kind):
    robot, motion = unit(request.getfixturevalue(kind)["moving"]), moving.model()
    now = at_rest(motion, np.array([6.0, 5.0]))
    command = now.lam if kind == "forced" else now.q[:2]
    assert robot.get("position") == pytest.approx(motion.rest_e + effectors(motion, now), abs=EXACT)
    for k in range(12):
        before, command = command, command * (1 + 0.02 * np.array([np.sin(k), np.cos(k)]))
        robot.put("command", command)
        robot.step(0.015)  # three steps of 5 ms
        for share in (1 / 3, 2 / 3, 1.0):
            u = {"force": command} if kind == "forced" else {"displacement": before + share * (command - before)}
            now = step(motion, now, MotionCommand(**u), 0.005)
        assert robot.get("position") == pytest.approx(motion.rest_e + effectors(motion, now), abs=EXACT)
        assert robot.get("displacement") == pytest.approx(now.q[:2], abs=EXACT)
        assert robot.get("force") == pytest.approx(now.lam, abs=EXACT)


def test_fmpy_integrates_the_states_of_the_robot_in_motion(forced):
    """CVode, with forces that jump after 2 ms, against Python's midpoint rule in steps of 50 us."""
    motion = moving.model()
    now = at_rest(motion, np.array([6.0, 5.0]))
    rest, pull, start = now.lam, 1.3 * now.lam, motion.rest_e + effectors(motion, now)
    fields = [(name, float) for name in ("time", *(f"command.{name}" for name in motion.rows.actuators))]
    names = [f"position.{name}" for name in motion.rows.effectors]
    end = fmpy.simulate_fmu(
        str(forced["moving"]),
        fmi_type="ModelExchange",
        stop_time=0.022,
        relative_tolerance=1e-8,
        output_interval=0.001,
        input=np.array([(0.0, *rest), (0.002, *rest), (0.002, *pull), (0.022, *pull)], fields),
        output=names,
    )[-1]
    for _ in range(400):
        now = step(motion, now, MotionCommand(force=pull), 5e-5)
    truth = motion.rest_e + effectors(motion, now)
    travel = np.abs(truth - start).max()
    assert travel > 0.1
    np.testing.assert_allclose([end[name] for name in names], truth, atol=1e-6 * travel)


def test_derivatives_of_its_states_are_those_of_python(forced, tmp_path):
    """Runge and Kutta's fourth order under forces that rise; states go back to where they were saved."""
    motion, description = moving.model(), fmpy.read_model_description(str(forced["moving"]))
    count, name = description.numberOfContinuousStates, description.modelExchange.modelIdentifier
    folder = fmpy.extract(str(forced["moving"]), str(tmp_path / "it"))
    fmu = FMU3Model(guid=description.guid, unzipDirectory=folder, modelIdentifier=name, instanceName="it")
    fmu.instantiate()
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    fmu.enterContinuousTimeMode()
    references = {
        block: [one.valueReference for one in description.modelVariables if one.name.startswith(f"{block}.")]
        for block in ("command", "position")
    }
    room, rates = (ctypes.c_double * count)(), (ctypes.c_double * count)()
    now, until, steps = at_rest(motion, np.array([6.0, 5.0])), 0.02, 200
    rest, rise, h = now.lam, 0.3 * now.lam, until / steps

    def slope(t, x):
        fmu.setTime(t)
        fmu.setFloat64(references["command"], (rest + t / until * rise).tolist())
        room[:] = x
        fmu.setContinuousStates(room, count)
        fmu.getContinuousStateDerivatives(rates, count)
        return np.array(rates)

    fmu.getContinuousStates(room, count)
    x, saved = np.array(room), fmu.getFMUState()
    for t in h * np.arange(steps):
        a = slope(t, x)
        b = slope(t + h / 2, x + h / 2 * a)
        c = slope(t + h / 2, x + h / 2 * b)
        x = x + h / 6 * (a + 2 * b + 2 * c + slope(t + h, x + h * c))
    slope(until, x)
    for k in range(2 * steps):
        now = step(motion, now, MotionCommand(force=rest + (k + 0.5) / (2 * steps) * rise), h / 2)
    position = fmu.getFloat64(references["position"])
    assert position == pytest.approx(motion.rest_e + effectors(motion, now), abs=1e-6)
    assert x[: len(now.q)] == pytest.approx(now.q, abs=1e-6) and np.abs(now.q - [6, 5, 0, 0]).max() > 0.01
    with pytest.raises(FMICallException):
        slope(until, np.full(count, np.nan))
    fmu.setFMUState(saved)
    fmu.getContinuousStates(room, count)
    assert np.array(room)[:2] == pytest.approx([6.0, 5.0]) and not np.array(room)[2:].any()
    fmu.terminate()
    fmu.freeInstance()


def test_a_robot_under_displacements_has_no_states_to_integrate(forced, placed):
    held, free = (fmpy.read_model_description(str(each["moving"])) for each in (placed, forced))
    assert held.modelExchange is None and held.coSimulation is not None
    assert free.modelExchange.modelIdentifier == free.coSimulation.modelIdentifier
    assert free.numberOfContinuousStates == len(free.derivatives) > 0


def test_the_controller_is_that_of_python(forced, unit):
    """Forces, the last linearisation for where they lead, in reach and out of it."""
    model, controller = build(*spectral()), unit(forced["controller"])
    ridge, settings = ridge_of(1e-10, model.reach, model.length), SearchSettings(iterations=1, step=3.0)
    pilot = Pilot(model, "force", "previous_step", limits_of(model), np.ones(3), ridge, settings)
    belief = Belief.at(pilot, np.array([6.0, 5.0]))
    assert controller.get("command") == pytest.approx(model.at_displacement([6.0, 5.0]).lambda_a, abs=EXACT)
    for goal in curve(model, 12, beyond=1.5):
        controller.put("goal", goal)
        controller.step()
        belief = drive(pilot, belief, goal - model.rest_e)
        assert controller.get("command") == pytest.approx(belief.u, rel=EXACT, abs=EXACT)


def test_two_fmus_track_a_curve_and_the_loop_removes_an_offset(placed, unit):
    """The sensor is 0.8 mm off, within what the cables can correct: the robot as measured comes to the goal."""
    model, controller, robot = build(*spectral()), unit(placed["controller"]), unit(placed["robot"])
    angle, missed = np.linspace(0, 2 * np.pi, 60), []
    pulls = 8 + 1.4 * np.stack([np.cos(angle), np.sin(angle)], axis=1)  # both cables are taut all the way
    goals = [model.rest_e + model.at_displacement(pull).delta_e for pull in pulls]
    for goal in [goals[0]] * 20 + [*goals]:
        controller.put("goal", goal)
        controller.step()
        robot.put("command", controller.get("command"))
        robot.step(controller.tick)
        missed.append(np.linalg.norm(np.subtract(robot.get("position"), goal)))
    size = np.linalg.norm(np.ptp(goals, axis=0))
    assert max(missed[20:]) < 1e-3 * size
    assert controller.get("status") == [0] and controller.said == robot.said == []
    W_ea = model.at_displacement(robot.get("displacement")).W_ea
    offset = W_ea @ np.array([1.0, -1.0])
    offset *= 0.8 / np.linalg.norm(offset)
    controller.set({"sample_age": 1})
    for _ in range(200):
        measured = robot.get("position") + offset
        controller.put("measured", measured)
        controller.step()
        robot.put("command", controller.get("command"))
        robot.step(controller.tick)
    assert np.linalg.norm(measured - goals[-1]) < 0.05 * 0.8


def test_a_step_of_several_ticks_hears_a_sample_once(placed, unit):
    """As three ticks with the same sample, whose age grows."""
    model, three, single = build(*spectral()), unit(placed["controller"]), unit(placed["controller"])
    goal = curve(model, 3)[0]
    for k in range(6):
        for controller in (three, single):
            controller.put("goal", goal)
            controller.put("measured", goal + [0.1 * k, 0.2, 0.0])
        three.set({"sample_age": 1})
        three.step(3 * three.tick)
        for age in (1, 2, 3):
            single.set({"sample_age": age})
            single.step()
        assert three.get("command", "reference", "status") == single.get("command", "reference", "status")


@pytest.mark.parametrize("part", ["controller", "robot", "moving"])
def test_states_go_back_and_to_another_instance(placed, unit, part):
    one, other = unit(placed[part]), unit(placed[part])
    block, values = ("goal", build(*spectral()).rest_e + [0, 4, 3]) if part == "controller" else ("command", [7.0, 6.0])
    one.put(block, values)
    one.step()
    state, time = one.fmu.getFMUState(), one.time
    stored = one.fmu.serializeFMUState(state)
    one.step()
    expected = one.get("command", "reference", "position", "force")
    one.put(block, np.asarray(values) * 0.9)
    one.step()
    assert one.get("command", "reference", "position", "force") != expected
    one.fmu.setFMUState(state)
    other.fmu.setFMUState(other.fmu.deserializeFMUState(stored))
    for each in (one, other):
        each.time = time
        each.step()
        assert each.get("command", "reference", "position", "force") == expected
    one.fmu.freeFMUState(state)
    with pytest.raises(FMICallException, match="status 3"):
        unit(placed["robot" if part == "controller" else "controller"]).fmu.deserializeFMUState(stored)


REFUSED = {
    "NaN": (lambda one: one.set({"goal.tip.x": np.nan}), "goal.tip.x is NaN: give a number in mm"),
    "infinite": (lambda one: one.set({"measured.tip.x": np.inf}), "measured.tip.x is infinite: give a number in mm"),
    "metres": (lambda one: (one.put("goal", np.divide(one.get("goal"), 1e3)), one.step()), "goals are in mm"),
    "step": (lambda one: one.step(0.003), "a step of 0.003 s is no multiple of the tick of this FMU, 0.01 s"),
    "backwards": (lambda one: one.fmu.doStep(0.0, -0.01), "a step of -0.01 s is none: it must be positive"),
    "jump": (lambda one: one.fmu.doStep(0.5, 0.01), "the step begins at 0.5 s, and the FMU stands at 0 s"),
    "output": (lambda one: one.put("command", [1.0, 1.0]), "is no input and cannot be set"),
    "type": (lambda one: one.fmu.getFloat64([one.variables["status"].valueReference]), "status is of type UInt32"),
    "no variable": (lambda one: one.fmu.getFloat64([10**6]), "there is no variable with value reference 1000000"),
    "another type": (lambda one: one.fmu.getInt8([1]), "this FMU has no variables of type Int8"),
    "initialised": (lambda one: one.fmu.enterInitializationMode(), "the FMU is initialised already: reset it first"),
}


@pytest.mark.parametrize("what", REFUSED)
def test_bad_input_is_one_sentence_and_changes_nothing(placed, unit, what):
    controller, as_it_was = unit(placed["controller"]), unit(placed["controller"])
    do, said = REFUSED[what]
    with pytest.raises(FMICallException, match="status 3"):
        do(controller)
    assert [(status, said in text) for status, text in controller.said] == [(3, True)], controller.said
    for one in (controller, as_it_was):
        one.put("goal", build(*spectral()).rest_e + [0, 4, 3])
        one.time = 0.0
        one.step()
    assert controller.get("command", "reference") == as_it_was.get("command", "reference")


def test_a_robot_far_outside_says_so(placed, forced, unit):
    robot = unit(placed["robot"])
    robot.put("command", [24.0, 24.0])
    robot.step()
    assert robot.get("outside") == [1]
    pulled = unit(forced["moving"])
    pulled.put("command", [1e9, 1e9])
    with pytest.raises(FMICallException, match="status 3"):
        pulled.step(1.0)
    assert "the equations of motion are not solved in a step of" in pulled.said[0][1] and pulled.get("time") == [0.0]
    lost = unit(forced["robot"])
    lost.put("command", [-1e9, 1e9])
    with pytest.raises(FMICallException, match="status 3"):
        lost.step()
    assert "no equilibrium under this command is known to the model" in lost.said[0][1]


def test_what_cannot_be_instantiated(placed, unit):
    """Another token, and another interface; no resources are needed."""
    one = unit(placed["robot"])
    name, token, log = b"it", one.fmu.guid.encode(), one.fmu.logMessage
    rest = (False, False, False, False, None, 0, None, log, one.fmu.intermediateUpdate)
    bare = one.fmu.fmi3InstantiateCoSimulation(name, token, None, *rest)
    assert bare and one.said == []
    one.fmu.fmi3FreeInstance(bare)
    assert not one.fmu.fmi3InstantiateCoSimulation(name, b"{0}", None, *rest)
    assert "the instantiation token is not that of this FMU" in one.said[-1][1]
    assert not one.fmu.fmi3InstantiateCoSimulation(name, token, None, False, False, True, *rest[3:])
    assert "has no event mode" in one.said[-1][1]


@pytest.mark.parametrize(("kind", "part"), [("placed", "controller"), ("forced", "moving")])
def test_the_signatures_are_those_of_the_standard(request, tmp_path, kind, part):
    """Compiled behind the official headers, which fmpy brings: a function of another type would not compile; every one
    of them is there."""
    fmpy.extract(str(request.getfixturevalue(kind)[part]), str(tmp_path))
    headers = Path(fmpy.__file__).parent / "c-code"
    strict = ("-Wall", "-Wextra", "-Werror", "-Wno-strict-prototypes", f"-I{headers}", "-include", "fmi3Functions.h")
    names = ("cfem_fmu.c", "cfem_fmu_absent.c")
    run([compiler(), *STANDARD, "-O0", *strict, "-c", *names], tmp_path / "sources")
    declared = {name for name in dir(fmpy.fmi3.FMU3Slave) if name.startswith("fmi3")} | {
        name for name in dir(fmpy.fmi3.FMU3Model) if name.startswith("fmi3")
    }
    library = next((tmp_path / "binaries").glob("*/*"))
    listed = subprocess.run(["nm", "-D", "--defined-only", str(library)], capture_output=True, text=True, check=True)
    symbols = {line.split()[-1] for line in listed.stdout.splitlines()}
    assert declared <= symbols and not [name for name in symbols if name.startswith("cfem_")]


def test_without_a_compiler_the_sources_alone_are_written(tmp_path, monkeypatch):
    monkeypatch.setattr(pack, "compiler", lambda: None)
    path = written(tmp_path, spectral(), None, {"parts": ["robot"]})["robot"]
    names = zipfile.ZipFile(path).namelist()
    assert "sources/cfem_fmu_robot.c" in names and not [name for name in names if name.startswith("binaries")]
    assert validate_fmu(str(path)) == []


def test_the_same_robot_has_the_same_bytes(placed, tmp_path):
    meta, arrays, motion = moving.robot()
    again = written(tmp_path, (meta, arrays), motion, STEP, start={"mm": [6.0, 5.0]})
    for part, path in placed.items():
        assert path.read_bytes() == again[part].read_bytes()


@pytest.mark.slow
@pytest.mark.parametrize("part", ["controller", "robot", "moving"])
def test_fmpy_compiles_it_from_its_sources(placed, unit, tmp_path, part):
    from fmpy.build import build_platform_binary

    stripped = tmp_path / "stripped"
    fmpy.extract(str(placed[part]), str(stripped))
    binary = next((stripped / "binaries").glob("*/*"))
    binary.unlink()
    (tmp_path / "build").mkdir()
    build_platform_binary(stripped, tmp_path / "build")
    assert binary.exists()
    packed = tmp_path / f"{part}.fmu"
    with zipfile.ZipFile(packed, "w") as out:
        for path in stripped.rglob("*"):
            out.write(path, path.relative_to(stripped))
    one, other = unit(packed), unit(placed[part])
    for each in (one, other):
        each.put(
            *(("goal", build(*spectral()).rest_e + [0, 4, 3]) if part == "controller" else ("command", [7.0, 6.0]))
        )
        each.step()
    outputs = ("command", "reference", "position", "force")
    assert one.get(*outputs) == pytest.approx(other.get(*outputs), abs=EXACT)


def test_the_program_that_the_page_shows_closes_the_loop(placed, tmp_path, monkeypatch):
    for path in placed.values():
        shutil.copyfile(path, tmp_path / path.name)
    monkeypatch.chdir(tmp_path)
    text = (Path(__file__).parents[3] / "docs" / "fmi.md").read_text()
    shown = {}
    exec(text.split("```python\n")[1].split("```")[0], shown)
    model = build(*spectral())
    last = shown["robot"].getFloat64(shown["of_robot"]["position"])
    commanded = shown["robot"].getFloat64(shown["of_robot"]["command"])
    assert last == pytest.approx(model.rest_e + model.at_displacement(commanded).delta_e, abs=EXACT)
    assert np.linalg.norm(np.subtract(last, shown["goal"])) < np.linalg.norm(np.subtract(shown["rest"], shown["goal"]))
    for name in ("robot", "controller"):
        shutil.rmtree(shown[name].unzipDirectory)
