"""The library for Arduino and PlatformIO: it compiles with the flags of these builds, and its example tracks."""

import json
import subprocess

import numpy as np
import pytest
from export import moving
from export.embedded import export, network, row, serial, spectral, tool
from surrogate.stored import train_folder

from cfem.core.stage import Options
from cfem.export.compiled import build
from cfem.export.firmware.arduino import write_library
from cfem.export.firmware.copying import library_files
from cfem.export.stage import run
from cfem.predict.load import build as model_of

BOARDS = {  # as the cores of STM32, Teensy, Renesas and nRF52 have them
    "m4": ("-mcpu=cortex-m4", "-mfpu=fpv4-sp-d16"),
    "m7": ("-mcpu=cortex-m7", "-mfpu=fpv5-d16"),
}
SHARED = ("-mthumb", "-mfloat-abi=hard", "-Os", "-ffunction-sections", "-fdata-sections", "-Wall", "-Wextra", "-Werror")
C = ("-std=gnu11",)
SKETCH = ("-x", "c++", "-std=gnu++14", "-fno-exceptions", "-fno-rtti", "-fno-threadsafe-statics")
SKETCH += ("-include", "Arduino.h")
# What the sketch asks of an Arduino core; this one prints to standard output, and its clock runs by what asks it.
CORE = r"""
#pragma once
#include <math.h>
#include <stdio.h>
#include <stdint.h>
struct Port {
    void begin(long) {}
    void print(double number, int digits) { printf("%.*f", digits, number); }
    void print(char letter) { putchar(letter); }
    void println(const char *text) { puts(text); }
};
static Port Serial;
static unsigned long micros() { static unsigned long now = 0; return now += 1000; }
"""
MAIN = "int main() {\n    setup();\n    for (int k = 0; k < 4000; k++) loop();\n    return 0;\n}\n"
ROBOTS = {
    "spectral": (spectral, {}),
    "float": (spectral, {"scalar": "float"}),
    "modules": (serial, {"controller": {"unilateral": False}}),
    "row": (row, {"controller": {"unilateral": False}}),
    "network": (network, {"hidden_weights": "int16"}),
}


def library(tmp_path, robot: str = "spectral"):
    """The library, with a core beside its example."""
    model, spec = ROBOTS[robot]
    export(tmp_path / "c", model(), vectors=5, **spec)
    place = write_library(tmp_path / "arduino", tmp_path / "c", model()[0])
    (tmp_path / "Arduino.h").write_text(CORE)
    return place


def test_its_cards_name_it_and_its_one_header(tmp_path):
    place = library(tmp_path)
    assert place.name == "cfem_synthetic"
    lines = (place / "library.properties").read_text().splitlines()
    card = dict(line.split("=", 1) for line in lines)
    also = json.loads((place / "library.json").read_text())
    assert card["name"] == also["name"] == place.name and card["version"] == also["version"]
    assert card["includes"] == also["headers"] == "cfem_synthetic.h" and card["architectures"] == "*"
    assert (place / "src" / card["includes"]).exists()
    example = also["examples"][0]
    assert (place / example["base"] / example["files"][0]).exists()
    missing = {"name", "version", "author", "maintainer", "sentence", "paragraph", "category", "url"} - set(card)
    assert not missing


def test_a_robot_with_the_name_of_a_part_replaces_none_of_its_headers(tmp_path):
    place = library(tmp_path, "row")
    assert place.name == "cfem_robot_row" and (place / "src" / "cfem_robot_row.h").exists()
    assert (place / "src" / "cfem_row.h").read_bytes() == (tmp_path / "c" / "cfem_row.h").read_bytes()


def test_it_has_the_sources_of_the_c_folder_and_no_program(tmp_path):
    place = library(tmp_path)
    assert library_files(place / "src") == library_files(tmp_path / "c")
    for path in (tmp_path / "c").glob("cfem*.[ch]"):
        if path.name != "cfem_vectors.h":
            assert (place / "src" / path.name).read_bytes() == path.read_bytes()
    assert not {"main.c", "selftest.c", "measure.c", "cfem_vectors.h"} & {one.name for one in place.rglob("*")}


@pytest.mark.parametrize(
    ("robot", "board"),
    [
        pytest.param(robot, board, marks=() if (robot, board) == ("spectral", "m4") else pytest.mark.slow)
        for robot in ROBOTS
        for board in BOARDS
    ],
)
def test_it_compiles_as_builds_for_boards_compile_it(tmp_path, robot, board):
    gcc, place = tool("arm-none-eabi-gcc"), library(tmp_path, robot)
    flags = [*BOARDS[board], *SHARED, f"-I{place / 'src'}"]
    build.objects([gcc, *flags, *C], place / "src", library_files(place / "src"), tmp_path)
    sketch = str(place / "examples" / "Track" / "Track.ino")
    build.run([tool("arm-none-eabi-g++"), *flags, f"-I{tmp_path}", *SKETCH, "-c", sketch, "-o", "t.o"], tmp_path)
    needed = build.run(["arm-none-eabi-nm", "-u", "t.o"], tmp_path)
    assert "U cfem_step" in needed and "cfem_step" in build.run(["arm-none-eabi-nm", "cfem_controller.o"], tmp_path)


def test_a_board_whose_double_is_short_is_refused(tmp_path):
    place = library(tmp_path)
    header = str(place / "src" / "cfem_synthetic.h")
    command = [tool("gcc"), "-fsyntax-only", "-U__SIZEOF_DOUBLE__", "-D__SIZEOF_DOUBLE__=4", "-x", "c", header]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode and "fewer than 8 bytes on this board" in done.stderr


def test_its_example_goes_to_a_point_and_back(tmp_path):
    place = library(tmp_path)
    objects = build.objects([tool("gcc"), "-O0", *C], place / "src", library_files(place / "src"), tmp_path)
    sketch = tmp_path / "Track.cpp"
    sketch.write_text((place / "examples" / "Track" / "Track.ino").read_text() + MAIN)
    link = [tool("g++"), f"-I{place / 'src'}", f"-I{tmp_path}", *SKETCH[2:], str(sketch), *map(str, objects)]
    build.run([*link, "-lm", "-o", "track"], tmp_path)
    said = build.run([str(tmp_path / "track")], tmp_path).splitlines()
    assert "held" not in said and len(said) > 400
    commands = np.array([line.split() for line in said], float)
    model = model_of(*spectral())
    reached = np.array([model.rest_e + model.at_displacement(one).delta_e for one in commands])
    text = (place / "src" / "cfem_data.c").read_text()
    goal = np.array(text.split("cfem_example_goal[3] = {")[1].split("}")[0].split(","), float)
    assert np.abs(reached[200] - goal).max() < 1e-3 * model.length and np.ptp(commands, axis=0).max() > 1
    assert np.abs(commands[-1] - commands[0]).max() < 0.05


def test_c_plus_plus_takes_all_parts_by_the_one_header(tmp_path):
    """Of a robot that moves, with predictive control."""
    moving.folder_of(tmp_path / "c", moving.spec())
    place = write_library(tmp_path / "arduino", tmp_path / "c", spectral()[0])
    header = (place / "src" / "cfem_synthetic.h").read_text()
    assert '#include "cfem_mpc.h"' in header and '#include "cfem_motion.h"' in header
    user = tmp_path / "user.cpp"
    user.write_text("#include <cfem_synthetic.h>\n#include <cfem_synthetic.h>\nint main() { return CFEM_NA - 2; }\n")
    build.run(
        [tool("g++"), *SKETCH[2:-2], "-Wall", "-Werror", "-fsyntax-only", f"-I{place / 'src'}", str(user)], tmp_path
    )


def test_the_command_writes_it_alone(tmp_path):
    train_folder(tmp_path, "{kind: spectral, max_degree: 9}")
    (tmp_path / "export.yaml").write_text("model: model\nout: export\n")
    results = run(tmp_path / "export.yaml", ["formats=[arduino]", "c.vectors=5"], None, Options())["results"]
    (place,) = (tmp_path / "export" / "arduino").iterdir()
    assert any(line.startswith(f"arduino: library {place.name}, ") for line in results["headline"])
    assert results["bytes"]["arduino"] > 10_000 and not (tmp_path / "export" / "c").exists()
