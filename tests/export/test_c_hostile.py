"""The predictive controller under the sanitisers, with streams of good, bad and mixed inputs (hostile_mpc.c)."""

import shutil
import subprocess
from pathlib import Path

import pytest
from export.moving import folder_of, spec

HARNESS = Path(__file__).with_name("hostile_mpc.c")
OTHERS = ("mps2_startup.c",)  # of an emulated board
SANITISED = ("-std=c99", "-O1", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")

pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="there is no gcc")


def demand_survival(folder, kind, ticks):
    folder_of(folder, spec(kind))
    sources = [
        path.name for path in folder.glob("*.c") if path.name not in OTHERS and "int main(" not in path.read_text()
    ]
    build = ["gcc", *SANITISED, "-I.", "-o", "hostile", str(HARNESS), *sources, "-lm"]
    subprocess.run(build, cwd=folder, check=True)
    done = subprocess.run(["./hostile", str(ticks)], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    counted, held, longest = map(int, done.stdout.split())
    assert counted == ticks and 0 < held < ticks / 2
    assert longest <= 20  # good ticks after which it commands again


@pytest.mark.parametrize("kind", ["force", "displacement"])
def test_bad_inputs_leave_commands_in_bounds_and_the_controller_alive(tmp_path, kind):
    demand_survival(tmp_path, kind, 4000)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["force", "displacement"])
def test_so_do_200_000_ticks(tmp_path, kind):
    demand_survival(tmp_path, kind, 200_000)
