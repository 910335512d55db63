"""C sources of an export compiled on this machine: a shared library, and how large they are."""

import ctypes
import os
import re
import shutil
import subprocess  # nosec B404
import tempfile
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np

from cfem.core.artefact.files import file_sha256
from cfem.core.errors import InputError
from cfem.export.firmware.copying import library_files

STANDARD = ("-std=c99", "-ffp-contract=fast")
FAST = tuple(os.environ.get("CFLAGS", "-O2").split())  # as make takes it
CORTEX_M7 = ("-Os", "-mcpu=cortex-m7", "-mfpu=fpv5-d16", "-mfloat-abi=hard", "-mthumb")


def compiler() -> str | None:
    """The first of cc, gcc, clang on the PATH."""
    return next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))), None)


def sizes(folder: Path) -> dict[str, dict[str, int] | None]:
    """Bytes of the compiled core by compiler: flash (code and constants), static_ram, stack (the sum of all its frames,
    more than any chain of calls needs); None for a compiler that is not here."""
    host, target = compiler(), shutil.which("arm-none-eabi-gcc")
    return {
        "here": _size(folder, [host, "-Os"], "size") if host else None,
        "cortex-m7": _size(folder, [target, *CORTEX_M7], "arm-none-eabi-size") if target else None,
    }


def _size(folder: Path, command: list[str], size: str) -> dict[str, int] | None:
    """Bytes of the core compiled by a command, as the program `size` lists them; None where that is not here."""
    if not shutil.which(size):
        return None
    with tempfile.TemporaryDirectory() as place:
        run(
            [
                *command,
                *STANDARD,
                "-fstack-usage",
                "-c",
                *(str((folder / name).resolve()) for name in library_files(folder)),
            ],
            place,
        )
        listed = run([size, *sorted(path.name for path in Path(place).glob("*.o"))], place)
        rows = [[int(word) for word in line.split()[:3]] for line in listed.splitlines()[1:]]
        text, data, bss = np.sum(rows, axis=0).tolist()
        frames = "".join(path.read_text(encoding="utf-8") for path in Path(place).glob("*.su"))
    stack = sum(int(line.split("\t")[1]) for line in frames.splitlines())
    return {"flash": text + data, "static_ram": data + bss, "stack": stack}


def run(command: list[str], folder: Path | str) -> str:
    """stdout; InputError with what the command said where it fails."""
    # compilers found on PATH, and what they made of our sources; no shell
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)  # nosec B603
    if done.returncode:
        raise InputError(
            f"{Path(command[0]).name} failed: {(done.stderr or done.stdout).strip()[:2000]}", where=str(folder)
        )
    return done.stdout


def demand_compiler() -> str:
    """The compiler. InputError where there is none."""
    executable = compiler()
    if not executable:
        raise InputError("there is no C compiler on the PATH", do="install gcc or clang")
    return executable


def files_of(folder: Path) -> tuple[tuple[str, str], ...]:
    """Names and SHA-256 of the C sources and headers of a folder."""
    return tuple((path.name, file_sha256(path)) for path in sorted(folder.glob("*.[ch]")))


def library(folder: Path, flags: tuple[str, ...] = FAST, names: tuple[str, ...] | None = None) -> ctypes.CDLL:
    """Sources of the folder as a shared library, all but programs unless given. InputError where there is no compiler.

    What was compiled from the same files is not compiled again."""
    return _library(folder, names or library_files(folder), flags, files_of(folder))


@lru_cache(maxsize=32)
def _library(
    folder: Path, names: tuple[str, ...], flags: tuple[str, ...], files: tuple[tuple[str, str], ...]
) -> ctypes.CDLL:
    """Shared library, compiled once for the same files: names and SHA-256 of the folder's."""
    command = demand_compiler()
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as place:  # Windows keeps a library that is loaded
        out = Path(place) / "libcfem.so"
        compiled = objects([command, *STANDARD, *flags, "-fPIC"], folder, names, Path(place))
        run([command, *flags, "-shared", "-o", str(out), *map(str, compiled), "-lm"], place)
        return ctypes.CDLL(str(out))


def objects(command: list[str], folder: Path, names: Sequence[str], place: Path) -> list[Path]:
    """Object files, in `place`, of sources of a folder."""
    run([*command, "-c", *(str((folder / name).resolve()) for name in names)], place)
    return [place / f"{Path(name).stem}.o" for name in names]


def defines_of(*headers: Path) -> dict[str, str]:
    """Values of the words that headers define."""
    text = "".join(path.read_text(encoding="utf-8") for path in headers)
    return dict(re.findall(r"^#define (\w+) (.*)$", text, re.MULTILINE))
