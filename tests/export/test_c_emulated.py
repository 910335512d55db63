"""The controller on emulated Cortex-M4 and M7: passes its test there, commands what it commands here, and is small."""

import re
import subprocess

import numpy as np
import pytest
from export.embedded import export, serial, spectral, tool


def measured(folder, *target: str) -> tuple[np.ndarray, str]:
    """(goals, 2 n_a) commands of measure.c, and all that was said."""
    done = subprocess.run([tool("make"), "-s", "-C", folder, *target], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    rows = [line.split()[2:] for line in done.stdout.splitlines() if line.startswith("command")]
    return np.array(rows, float), done.stdout


@pytest.mark.parametrize(
    ("robot", "cpu", "scalar", "tolerance", "most"),
    [
        (spectral, "m7", "double", 1e-9, 40_000),
        pytest.param(spectral, "m7", "float", 1e-6, 40_000, marks=pytest.mark.slow),
        pytest.param(spectral, "m4", "float", 1e-6, 400_000, marks=pytest.mark.slow),
        pytest.param(serial, "m7", "double", 1e-9, 120_000, marks=pytest.mark.slow),
    ],
)
def test_it_commands_what_it_commands_here(tmp_path, robot, cpu, scalar, tolerance, most):
    tool("arm-none-eabi-gcc"), tool("qemu-system-arm")
    options = {"unilateral": robot is spectral, "damping": 1e-7}
    export(tmp_path, robot(), scalar=scalar, vectors=30, controller=options)
    here, _ = measured(tmp_path, "measure")
    there, said = measured(tmp_path, "emulate", f"CPU={cpu}")
    assert ", 0 failed" in said
    assert np.abs(here - there).max() <= tolerance * np.abs(here).max() and len(here) >= 5
    median, stack = re.search(r"median (\d+) .* instructions", said), re.search(r"stack (\d+) bytes", said)
    assert 0 < int(median[1]) < most
    assert 0 < int(stack[1]) < (4096 if robot is spectral else 16384)
