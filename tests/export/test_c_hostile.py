"""Every kind of C export under the sanitisers, with good, bad and mixed inputs in turns (hostile/driver.c): no
undefined behaviour, commands and estimates within their bounds, no tick that costs many times what a good one costs,
and soon after the last bad input all is as before."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest
from export.embedded import export, network, row, serial, spectral
from export.firmware import test_estimate, test_meet, test_swing, test_touch
from export.moving import folder_of, spec
from support.fast_cases import fast_are

from cfem.export.compiled import build
from cfem.export.firmware.estimate import write_c_estimate
from cfem.export.firmware.single import write_single
from cfem.export.spec import CSpec
from cfem.predict.load import load_model

HARNESS = Path(__file__).with_name("hostile")
STARTUP = "mps2_startup.c"  # of an emulated board
PROGRAM = re.compile(r'int main\(|#include "frames.h"')
SANITISED = ("-std=c99", "-g1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
FEW = 4000  # ticks, up to which a program that is not optimised costs less with its compilation
TURN = 500  # ticks of one phase
RECOVERY = 20  # good ticks after which it is alive again
COSTLY = 30  # times the branches of the longest good tick that a bad one may take
ROUNDS = 1000  # the same of a step of contact: all systems that it may solve, with all its patches
FORCES = {"command": "force", "observer": "equilibrium"}
FREE = {"unilateral": False}
MODELS = {
    "double": (spectral, {"full": True}),
    "forces": (lambda: spectral("force"), {"scalar": "float", "controller": FORCES}),
    "modules": (serial, {"scalar": "float", "controller": {"damping": 1e-7, **FREE}}),
    "network": (network, {"scalar": "float", "hidden_weights": "int16"}),
    "measured": (spectral, {"controller": {"observer": "measured"}}),
    "single precision": (spectral, {"arithmetic": "float"}),
    "row": (row, {"scalar": "float", "controller": {"weights": [1.0] * 3 + [0.0] * 3, **FREE}}),
}
PREDICTIVE = {
    "force": {},
    "displacement": {"kind": "displacement"},
    "one actuator": {"n_a": 1},
    "single precision": {"arithmetic": "float"},
}

pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="there is no gcc")


def survived(place, folder, kind, ticks, arithmetic, turn):
    """The driver's numbers, where it neither fell nor left a bound. turn: ticks of one phase."""
    sources = [path for path in folder.glob("*.c") if path.name != STARTUP and not PROGRAM.search(path.read_text())]
    gcc = ["gcc", *SANITISED, "-O0" if ticks <= FEW and turn == TURN else "-O1"]
    place.mkdir(exist_ok=True)
    harness = shutil.copytree(HARNESS, place / "driver")
    if arithmetic == "float":
        write_single(harness)
    compiled = build.objects(
        [*gcc, "-fsanitize-coverage=trace-pc"], folder, sorted(path.name for path in sources), place
    )
    driver = [f"-I{folder}", f"-I{harness}", harness / f"{kind}.c", harness / "driver.c"]
    subprocess.run([*gcc, "-o", "hostile", *driver, *compiled, "-lm"], cwd=place, check=True)
    done = subprocess.run(["./hostile", str(ticks), str(turn)], cwd=place, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return map(int, done.stdout.split())


def demand_survival(place, folder, kind, ticks, costly=COSTLY, arithmetic="double", turn=TURN):
    counted, lost, longest, good, most = survived(place, folder, kind, ticks, arithmetic, turn)
    assert counted == ticks and 0 < lost < 0.75 * ticks
    assert longest <= RECOVERY
    assert most <= costly * good


def predictive(place, name, ticks):
    words = {"arithmetic": "double", **PREDICTIVE[name]}
    arithmetic = words.pop("arithmetic")
    folder = folder_of(place, spec(**words).model_copy(update={"arithmetic": arithmetic}))
    demand_survival(place / "built", folder, "mpc", ticks, arithmetic=arithmetic)


def inverse(place, name, ticks):
    model, words = MODELS[name]
    export(place, model(), **words)
    demand_survival(place / "built", place, "controller", ticks, arithmetic=words.get("arithmetic", "double"))


def at_rest(place, bar, ticks):
    model = load_model(bar / "models" / "bar" / "spectral")
    write_c_estimate(place, model, CSpec(estimate=test_estimate.asked(model)))
    demand_survival(place / "built", place, "estimate", ticks)


def swinging(place, moving_bar, ticks):
    folder = moving_bar / "models" / "bar" / "spectral"
    test_swing.written(place, folder, test_swing.asked(folder))
    demand_survival(place / "built", place, "swing", ticks)


@pytest.fixture(scope="module")
def touching(bar, tmp_path_factory):
    """C folders of a bar before a ceiling, and of one with another bar above and a wall beside it."""
    place = tmp_path_factory.mktemp("contact")
    test_touch.export(bar, place / "rigid", {"ceiling": test_touch.CEILING}, friction=0.4)
    test_meet.export(bar, place / "soft", {"twin": test_meet.TWIN, "wall": test_meet.WALL})
    return place


def among(touching, place, case):
    """Steps with friction of 1e6 take long: all systems that they may solve."""
    kind, folder, ticks, turn = CONTACT[case]
    demand_survival(place, touching / folder / "c", kind, ticks, COSTLY if kind == "contact" else ROUNDS, turn=turn)


CONTACT = {  # of which each takes two minutes of CPU time at most
    "steps": ("touch", "rigid", 200_000, TURN),
    "steps among robots": ("meet", "soft", 20_000, TURN),
    "ticks": ("contact", "rigid", 200_000, TURN),
    "ticks among robots": ("contact", "soft", 20_000, 125),
}


def test_predictive_control_survives(tmp_path):
    predictive(tmp_path, "force", FEW)


@pytest.mark.parametrize("name", fast_are({"forces"}, ["double", "forces"]))
def test_the_controller_survives(tmp_path, name):
    """The other models are among those of 200 000 ticks."""
    inverse(tmp_path, name, FEW)


def test_the_estimator_survives(tmp_path, bar):
    at_rest(tmp_path, bar, FEW)


@pytest.mark.slow
def test_the_filter_of_what_moves_survives(tmp_path, moving_bar):
    swinging(tmp_path, moving_bar, FEW // 4)  # each costs four times the others'


@pytest.mark.slow
@pytest.mark.parametrize("name", PREDICTIVE)
def test_so_does_predictive_control_for_200_000_ticks(tmp_path, name):
    predictive(tmp_path, name, 200_000)


@pytest.mark.slow
@pytest.mark.parametrize("name", MODELS)
def test_so_does_the_controller_for_200_000_ticks(tmp_path, name):
    """20 000 of the row, whose tick costs a hundred times the others'."""
    inverse(tmp_path, name, 20_000 if name == "row" else 200_000)


@pytest.mark.slow
def test_so_does_the_estimator_for_200_000_frames(tmp_path, bar):
    at_rest(tmp_path, bar, 200_000)


@pytest.mark.slow
def test_so_does_the_filter_of_what_moves_for_200_000_frames(tmp_path, moving_bar):
    swinging(tmp_path, moving_bar, 200_000)


@pytest.mark.slow
@pytest.mark.parametrize("case", CONTACT)
def test_contact_survives(touching, tmp_path, case):
    """Fewer ticks where they take longer: one among robots takes 50 times a step."""
    among(touching, tmp_path / "built", case)
