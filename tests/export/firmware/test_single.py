"""Folders of C in single precision."""

import ctypes
import re
import subprocess

import numpy as np
import pytest
from export.embedded import export, needs_compiler, network, row, serial, spectral, tool
from export.moving import both, folder_of, goals, model, spec
from pydantic import ValidationError
from support.fast_cases import fast_are

from cfem.export.compiled import build
from cfem.export.compiled.mpc import CompiledMpc
from cfem.export.firmware.copying import library_files
from cfem.export.firmware.single import write_single
from cfem.export.spec import CSpec, ExportSpec
from cfem.motion.altered import Altered
from cfem.plant.imperfect_plant import Imperfection, ImperfectPlant
from cfem.plant.moving_plant import MovingModelPlant

M4F = ["-std=c99", "-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16"]
SOFTENED, HELD = 2, 16
ROBOTS = {"spectral": spectral, "serial": serial, "network": network, "row": row}
DOUBLE = """#include "a 1.0 double.h" /* a double, 1.0 */
#define SMALL 1e-9 // 2.0
static double root(double x) { return x < .5 ? sqrt(x) * 2. : fmax(1.5e+3, -HUGE_VAL) + 10 + 0x1e3 + 3u; }
const char *text = "double 1.0 \\" 2.0", sign = '"';
const double most = 1.797e308, least = 1e-300, float_already = 1.5f;
"""
SINGLE = """#include "a 1.0 double.h" /* a double, 1.0 */
#define SMALL 1e-9f // 2.0
static float root(float x) { return x < .5f ? sqrtf(x) * 2.f : fmaxf(1.5e+3f, -HUGE_VALF) + 10 + 0x1e3 + 3u; }
const char *text = "double 1.0 \\" 2.0", sign = '"';
const float most = HUGE_VALF, least = 0.0f, float_already = 1.5f;
"""


def single(kind: str = "force", **options) -> CSpec:
    return spec(kind, **options).model_copy(update={"arithmetic": "float"})


def test_types_literals_and_functions_change_and_text_stays(tmp_path):
    (tmp_path / "some.c").write_text(DOUBLE)
    for _ in range(2):  # what is single stays
        write_single(tmp_path)
        assert (tmp_path / "some.c").read_text() == SINGLE


@pytest.mark.parametrize("kind", ["force", pytest.param("displacement", marks=pytest.mark.slow)])
def test_nothing_on_a_board_is_computed_in_double(tmp_path, kind):
    gcc, folder = tool("arm-none-eabi-gcc"), folder_of(tmp_path / "c", single(kind))
    warned = ["-Wall", "-Wextra", "-Wdouble-promotion", "-Wunsuffixed-float-constants", "-Werror", "-O1"]
    compiled = build.objects([gcc, *M4F, *warned], folder, library_files(folder), tmp_path)
    symbols = build.run(["arm-none-eabi-nm", *map(str, compiled)], tmp_path)
    assert "U sqrtf" in symbols
    assert not re.findall(r"U (?:__aeabi_(?:d\w+|\w+2d)|sqrt|fmin|fmax)$", symbols, re.MULTILINE)


@needs_compiler
@pytest.mark.parametrize("robot", fast_are({"spectral"}, ROBOTS))
def test_the_controller_passes_its_test(tmp_path, robot):
    folder, options = tmp_path, {"unilateral": robot == "spectral", "damping": 1e-7}
    export(folder, ROBOTS[robot](), vectors=20, arithmetic="float", controller=options)
    for command in (["make", "-s", "-C", str(folder), "selftest", "CFLAGS=-O1"], [str(folder / "selftest")]):
        done = subprocess.run(command, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
    assert ", 0 failed" in done.stdout


def missed(compiled: CompiledMpc, chosen: CSpec, u: np.ndarray, ticks: int = 60) -> tuple[float, np.ndarray]:
    """Mean distance (mm) from the goals of a figure-eight of a robot that is 10 % stiffer than its model, and the
    commands; none is held."""
    body = MovingModelPlant(Altered(model(), 1.1, 1.2), 1 / 50, 2)
    body.settle(u, chosen.controller.command)
    plant, there = ImperfectPlant(body, Imperfection(0.1, 1.0, 1), seed=2), goals(ticks + 8, speeds=(9, 18))
    measured, errors, commands = None, [], []
    for k in range(ticks):
        said = compiled.step(there[k : k + 8], *(() if measured is None else (measured.x_e, measured.t)))
        assert not said.status & HELD
        measured = plant.step(said.u, chosen.controller.command)
        errors.append(np.linalg.norm(plant.actual.x_e - there[k]))
        commands.append(said.u)
    return float(np.mean(errors)), np.array(commands)


@needs_compiler
@pytest.mark.parametrize(
    ("kind", "options"),
    [
        ("force", {}),
        ("displacement", {"rate": "0.1 mm"}),
        pytest.param("force", {"largest_force": "7 N", "force_rate": "0.3 N"}, marks=pytest.mark.slow),
    ],
)
def test_a_figure_eight_is_tracked_as_in_double(tmp_path, kind, options):
    double, python = both(tmp_path / "double", spec(kind, **options))
    chosen = single(kind, **options)
    compiled = CompiledMpc(folder_of(tmp_path / "single", chosen))
    assert compiled.bytes < 0.55 * double.bytes
    wanted, exact = missed(double, chosen, python.belief.u)
    error, u = missed(compiled, chosen, python.belief.u)
    assert error < 1.01 * wanted
    np.testing.assert_allclose(u, exact, atol=2e-3 * np.abs(exact).max())


@needs_compiler
def test_planes_that_cannot_be_kept_are_missed_and_never_held(tmp_path):
    """Multipliers of what is missed are large beside the objective's slopes, and a program may need another price."""
    obstacles = [{"point": {"mm": [0, 50, 0]}, "normal": [0, -1, 0]}]
    chosen = single(mpc={"obstacles": obstacles}, force_rate="0.1 N")
    compiled, python = both(tmp_path, chosen)
    there, before, status = goals(20), python.belief.u, []
    for k in range(12):
        said = compiled.step(there[k : k + 8])
        assert not said.status & HELD and np.abs(said.u - before).max() < 0.1001
        before = said.u
        status.append(said.status)
    assert python.tick(there[0], None, there[:8]).softened and status[0] & SOFTENED


@needs_compiler
def test_the_state_of_a_finger_fits_into_48_kilobytes(tmp_path):
    """Two cables, five inner motions, no Prony terms; 20 ticks, 10 commands of each cable."""
    folder = folder_of(tmp_path, single(mpc={"horizon": 20, "moves": 10}))
    header = folder / "cfem_motion_data.h"
    text = header.read_text().replace("CFEM_MOTION_NQ 4", "CFEM_MOTION_NQ 7")
    header.write_text(text.replace("CFEM_MOTION_TERMS 1", "CFEM_MOTION_TERMS 0"))
    (folder / "size.c").write_text('#include "cfem_mpc.h"\nint size(void) { return sizeof(cfem_mpc); }\n')
    build.run([build.compiler(), *build.STANDARD, "-shared", "-fPIC", "-o", "size.so", "size.c"], folder)
    assert 40_000 < ctypes.CDLL(str(folder / "size.so")).size() <= 48_000


def test_what_is_not_in_single_precision_is_refused():
    with pytest.raises(ValidationError, match="obstacles and estimate need double"):
        CSpec(arithmetic="float", estimate={"noise": "0.1 mm", "markers": {"m": {"mm": [0, 0, 0]}}})
    with pytest.raises(ValidationError, match="not for an FMU"):
        ExportSpec(model="m", out="o", formats=["fmu"], c={"arithmetic": "float"})
