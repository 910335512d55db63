"""The exported folder as its user gets it: compiles without warnings everywhere, tests itself, describes itself."""

import json
import shutil
import subprocess
import tempfile
from itertools import product
from pathlib import Path

import pytest
from export.embedded import export, needs_compiler, network, row, serial, spectral, tool
from support.fast_cases import fast_are
from surrogate.stored import train_folder

from cfem.core.errors import InputError, SpecError
from cfem.core.stage import Options
from cfem.export.compiled import build
from cfem.export.compiled.build import CORTEX_M7
from cfem.export.firmware.copying import library_files
from cfem.export.stage import run

PIPELINES = Path(__file__).parents[2] / "pipelines"
FEW = 20  # vectors for a row under sanitisers: each is 300 ticks
STRICT = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wshadow", "-Werror"]
VARIANTS = {
    "sanitised": ["-O0", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"],
    "contracted": ["-O3", "-ffp-contract=fast"],
    "not contracted": ["-O2", "-ffp-contract=off"],
}
BOARDS = {
    "m7": CORTEX_M7,
    "m4": ("-Os", "-mcpu=cortex-m4", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard", "-mthumb"),
}
MODELS = {
    "double": (spectral, {"full": True, "wire": True}),
    "forces": (
        lambda: spectral("force"),
        {"scalar": "float", "controller": {"command": "force", "observer": "equilibrium"}},
    ),
    "modules": (serial, {"scalar": "float", "controller": {"damping": 1e-7, "unilateral": False}}),
    "row": (row, {"scalar": "float", "controller": {"unilateral": False, "weights": [1.0] * 3 + [0.0] * 3}}),
    "network": (network, {"scalar": "float", "hidden_weights": "int16"}),
}


@pytest.fixture(scope="module", params=fast_are({"forces", "row"}, MODELS), ids=str)
def folder(request, tmp_path_factory):
    model, spec = MODELS[request.param]
    out = tmp_path_factory.mktemp("c")
    export(out, model(), vectors=FEW, **spec)
    return out


def selftest(folder, command: list[str]) -> str:
    with tempfile.TemporaryDirectory() as place:
        compiled = build.objects(command, folder, [*library_files(folder), "selftest.c"], Path(place))
        build.run([*command, "-o", "selftest", *map(str, compiled), "-lm"], place)
        done = subprocess.run([Path(place) / "selftest"], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def all_pass(said: str, vectors: int = 100) -> bool:
    passed, failed = said.splitlines()[-1].split(", ")
    return int(passed.split()[0]) >= vectors and failed == "0 failed"


def test_it_passes_its_own_test_without_undefined_behaviour(folder):
    assert all_pass(selftest(folder, [tool("gcc"), *STRICT, *VARIANTS["sanitised"]]), FEW)


@pytest.mark.parametrize(
    ("compiler", "variant"),
    fast_are([("clang", "sanitised")], [("gcc", "contracted"), ("gcc", "not contracted"), ("clang", "sanitised")]),
)
def test_it_passes_however_it_is_compiled(tmp_path, compiler, variant):
    export(tmp_path, spectral())
    assert all_pass(selftest(tmp_path, [tool(compiler), *STRICT, *VARIANTS[variant]]))


def test_a_wrong_coefficient_fails_the_self_test(tmp_path):
    export(tmp_path, spectral())
    text = (tmp_path / "cfem_data.c").read_text()
    (tmp_path / "cfem_data.c").write_text(text.replace("cfem_offset[2] = {", "cfem_offset[2] = {0.01 + "))
    with pytest.raises(AssertionError, match=r"[1-9]\d* failed"):
        selftest(tmp_path, [tool("gcc"), "-O1"])


def test_the_core_knows_no_heap_and_no_io(folder):
    """And it loops so often as a constant says."""
    for name in library_files(folder):
        text = (folder / name).read_text()
        assert not any(
            word in text for word in ("stdio", "stdlib", "malloc", "printf", "goto", "alloca", "while (1)", "for (;;)")
        )


def test_c_plus_plus_takes_the_header(tmp_path):
    export(tmp_path, spectral())
    source = tmp_path / "user.cpp"
    source.write_text('#include "cfem.h"\nint main() { cfem_controller c; cfem_init(&c); return 0; }\n')
    done = subprocess.run([tool("g++"), "-fsyntax-only", "-Wall", "-Werror", source], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(("model", "board"), fast_are([("double", "m7")], product(MODELS, BOARDS)))
def test_it_compiles_for_a_microcontroller(model, board, tmp_path):
    made, spec = MODELS[model]
    export(tmp_path, made(), **spec)
    build.objects([tool("arm-none-eabi-gcc"), *BOARDS[board], *STRICT], tmp_path, library_files(tmp_path), tmp_path)


@needs_compiler
def test_make_and_cmake_run_the_self_test(tmp_path):
    export(tmp_path, spectral())
    done = subprocess.run([tool("make"), "-C", tmp_path, "test", "example"], capture_output=True, text=True)
    assert done.returncode == 0 and "0 failed" in done.stdout, done.stderr
    example = subprocess.run([tmp_path / "example"], capture_output=True, text=True)
    assert len(example.stdout.splitlines()) == 20 and "held" not in example.stdout
    subprocess.run([tool("cmake"), "-S", tmp_path, "-B", tmp_path / "build"], check=True, capture_output=True)
    subprocess.run(["cmake", "--build", tmp_path / "build"], check=True, capture_output=True)
    subprocess.run([tmp_path / "build" / "selftest"], check=True, capture_output=True)


def test_the_command_exports_and_reports(tmp_path, counted):
    train_folder(tmp_path, "{kind: spectral, max_degree: 9}")
    (tmp_path / "export.yaml").write_text("model: model\nout: export\n")
    manifest = run(tmp_path / "export.yaml", ["formats=[c]", "c.scalar=float", "c.vectors=20"], None, Options())
    report = json.loads((tmp_path / "export" / "c" / "report.json").read_text())
    assert report["scalar"] == "float" and report["coefficient_bytes"] == manifest["results"]["bytes"]["c"]
    assert report["operations"]["tick"] > report["operations"]["model"] > 100
    if shutil.which("gcc"):
        assert manifest["results"]["parity"]["c"] < 1e-5 and report["bytes"]["here"]["static_ram"] == 0
    with pytest.raises(SpecError, match=r"c\.controller\.observer"):
        run(tmp_path / "export.yaml", ["c.controller.observer=guess"], None, Options())
    with pytest.raises(InputError, match="learned to move"):
        run(tmp_path / "export.yaml", ["formats=[c]", "c.mpc.ticks=50 Hz"], None, Options())
