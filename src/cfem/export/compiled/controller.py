"""A C export compiled on this machine: its sizes, and the controller in a shared library as a Python object."""

import ctypes
import os
import re
import shutil
import subprocess  # nosec B404
import tempfile
from dataclasses import dataclass
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
    found = {
        "here": _size(folder, [host, "-Os"], "size") if host else None,
        "cortex-m7": _size(folder, [target, *CORTEX_M7], "arm-none-eabi-size") if target else None,
    }
    return found


def _size(folder: Path, command: list[str], size: str) -> dict[str, int] | None:
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


def library(folder: Path, flags: tuple[str, ...] = FAST, names: tuple[str, ...] | None = None) -> ctypes.CDLL:
    """Sources of the folder as a shared library, all but programs unless given. InputError where there is no compiler.

    What was compiled from the same files is not compiled again."""
    files = tuple((path.name, file_sha256(path)) for path in sorted(folder.glob("*.[ch]")))
    return _library(folder, names or library_files(folder), flags, files)


@lru_cache(maxsize=32)
def _library(
    folder: Path, names: tuple[str, ...], flags: tuple[str, ...], files: tuple[tuple[str, str], ...]
) -> ctypes.CDLL:
    """files: names and SHA-256 of what the folder holds."""
    command = compiler()
    if not command:
        raise InputError("there is no C compiler on the PATH", do="install gcc or clang")
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as place:  # Windows keeps a library that is loaded
        out = Path(place) / "libcfem.so"
        sources = [str((folder / name).resolve()) for name in names]
        run([command, *STANDARD, *flags, "-shared", "-fPIC", "-o", str(out), *sources, "-lm"], place)
        return ctypes.CDLL(str(out))


@dataclass(frozen=True)
class TickCommand:
    """What a tick commands: delta_a (n_a,) mm, lambda_a (n_a,) N, reference (n_e,) mm, status as in cfem.h, tick: its
    number."""

    delta_a: np.ndarray
    lambda_a: np.ndarray
    reference: np.ndarray
    status: int
    tick: int


class CompiledController:
    """One robot's controller. n_a, n_e: its sizes."""

    def __init__(self, folder: Path):
        text = (folder / "cfem_data.h").read_text(encoding="utf-8")
        defines = defines_of(text)
        self.n_a, self.n_e = int(defines["CFEM_NA"]), int(defines["CFEM_NE"])
        real = {"float": ctypes.c_float, "double": ctypes.c_double}[re.search(r"typedef (\w+) cfem_real", text)[1]]
        a, e = self.n_a, self.n_e
        full = [("W_ee", e * e), ("energy", 1)] if int(defines["CFEM_FULL"]) else []
        row = [("steps", 1), ("change", 1)] if int(defines["CFEM_ROW"]) else []
        model = [("delta_a", a), ("lambda_a", a), ("W_aa", a * a), ("W_ea", e * a), ("free_a", a), ("free_e", e), *full]
        model += row
        inputs = [("goal", real * e), ("x_e", real * e), ("delta_a", real * a), ("tick", ctypes.c_uint32)]
        outputs = [("delta_a", real * a), ("lambda_a", real * a), ("reference", real * e)]
        outputs += [("tick", ctypes.c_uint32), ("status", ctypes.c_uint)]
        feedback = [("total", e), ("moved", e), ("references", int(defines["CFEM_LATE"]) * e), ("integral", 1)]
        state = [("delta_a", a), ("lambda_a", a), ("reference", e), *feedback]
        self._input, self._output = struct_of(inputs)(), struct_of(outputs)()
        self._model = struct_of([(name, ctypes.c_double * size) for name, size in model])()
        self._library = library(folder)
        # cfem_controller, or more: its vectors; counts of the feedback, the model at the last command, two pointers
        more = [("rest", ctypes.c_double * (sum(size for _, size in model) + 16))]
        self._state = struct_of([(name, ctypes.c_double * size) for name, size in state] + more)()
        self._references = [ctypes.byref(one) for one in (self._state, self._input, self._output)]
        self.reset()

    def reset(self) -> None:
        self._library.cfem_init(self._references[0])

    @property
    def moved(self) -> np.ndarray:
        """(n_e,) mm by which the goal is moved."""
        return np.array(self._state.moved)

    @property
    def integral(self) -> float:
        """K_I of the last sample."""
        return self._state.integral[0]

    def step(
        self,
        goal: np.ndarray,
        x_e: np.ndarray | None = None,
        tick: int = 0,
        delta_a: np.ndarray | None = None,
    ) -> TickCommand:
        """goal (n_e,) mm absolute; x_e (n_e,) mm absolute: the latest sample of the effectors, which followed the
        command of that number; delta_a (n_a,) mm for the observer that needs it."""
        self._input.goal[:] = goal.tolist()
        self._input.tick = tick
        if x_e is not None:
            self._input.x_e[:] = x_e.tolist()
        if delta_a is not None:
            self._input.delta_a[:] = delta_a.tolist()
        self._library.cfem_step(*self._references)
        out = self._output
        return TickCommand(np.array(out.delta_a), np.array(out.lambda_a), np.array(out.reference), out.status, out.tick)

    def model(self, s: np.ndarray) -> dict[str, np.ndarray]:
        """The members of cfem_condensed at s (n_a,), flat, and 'status'."""
        status = self._library.cfem_model((ctypes.c_double * self.n_a)(*s.tolist()), ctypes.byref(self._model))
        return {name: np.array(getattr(self._model, name)) for name, _ in self._model._fields_} | {"status": status}


def defines_of(text: str) -> dict[str, str]:
    """Of a header: what each name stands for."""
    return dict(re.findall(r"^#define (\w+) (.*)$", text, re.MULTILINE))


def struct_of(fields: list[tuple[str, type]]) -> type[ctypes.Structure]:
    """A C structure of these members."""
    return type("Struct", (ctypes.Structure,), {"_fields_": fields})
