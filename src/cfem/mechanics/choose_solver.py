"""Choice of the sparse solver for this machine: measured once on a small body, then read from the user's cache folder.

PARDISO takes half of rslab's time per factorisation on Intel's processors and about the same on AMD's. The choice
changes results by rounding alone. CFEM_SOLVER overrides it."""

import json
import os
import time
from collections.abc import Callable
from contextlib import suppress
from functools import lru_cache
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path

import numpy as np

from cfem.core.cache import cache_folder
from cfem.core.optional import installed
from cfem.core.system import processor
from cfem.mechanics.assembly import Pattern, make_pattern

PACKAGES = {"pardiso": "pymklpardiso", "rslab": "rslab"}
CLEARLY = 0.7  # of rslab's time; where PARDISO takes more, the open solver stays
SIDE = 16  # nodes along an edge of the block that is measured: some 12 000 unknowns
REPEATS = 3

Analyze = Callable[[Pattern, str], Callable]


@lru_cache(maxsize=1)
def fastest(analyze: Analyze) -> str:
    """Name of the solver: 'pardiso' where it is installed and clearly faster here, otherwise 'rslab'. analyze:
    factorization.analyze.

    Where no measurement can be kept, the processor's maker decides: two runs on one machine use the same solver."""
    available = [name for name, package in PACKAGES.items() if installed(package)]
    if "pardiso" not in available or "rslab" not in available:
        return available[0] if available else "rslab"
    machine = f"{processor()}; rslab {version('rslab')}; py-mkl-pardiso {version('py-mkl-pardiso')}"
    seconds = kept(machine, lambda: {name: seconds_of(analyze, name) for name in available})
    if seconds is None:
        return "pardiso" if "intel" in machine.lower() else "rslab"
    return "pardiso" if seconds["pardiso"] < CLEARLY * seconds["rslab"] else "rslab"


def kept(machine: str, measure: Callable[[], dict[str, float]]) -> dict[str, float] | None:
    """The measurement of a machine from the cache folder, made and kept there where there is none yet. Of two processes
    that measure at once, the first decides for both. None where nothing can be kept."""
    folder = cache_folder()
    if folder is None:
        return None
    path = folder / f"solvers-{sha256(machine.encode()).hexdigest()[:16]}.json"
    measured = _read(path)
    if measured is None:
        partial = path.with_name(f".{path.name}.{os.getpid()}.tmp")
        try:
            path.unlink(missing_ok=True)  # damaged
            partial.write_text(json.dumps({"machine": machine, "seconds": measure()}), encoding="utf-8")
            with suppress(FileExistsError):
                os.link(partial, path)
        except OSError:
            return None
        finally:
            partial.unlink(missing_ok=True)
        measured = _read(path)
    return measured


def _read(path: Path) -> dict[str, float] | None:
    """Seconds of each solver that `kept` wrote; None where the file is missing or is something else."""
    try:
        seconds = json.loads(path.read_text(encoding="utf-8"))["seconds"]
        return {name: float(seconds[name]) for name in PACKAGES}
    except (OSError, ValueError, KeyError, TypeError):
        return None


def seconds_of(analyze: Analyze, solver: str) -> float:
    """CPU seconds of one factorisation and one solve: the least of a few."""
    pattern = block_pattern()
    factor = analyze(pattern, solver)
    data = -1.0 - np.random.default_rng(0).random(pattern.nnz)
    data[pattern.indptr[:-1]] = 500.0  # the diagonal, larger than the sum of its row
    spent = []
    for _ in range(REPEATS):
        begin = time.process_time()
        factor(data)
        spent.append(time.process_time() - begin)
    return min(spent)


def block_pattern() -> Pattern:
    """Pattern of a block of hexahedra."""
    node = np.arange(SIDE**3).reshape(SIDE, SIDE, SIDE)
    corners = [
        node[x : SIDE - 1 + x, y : SIDE - 1 + y, z : SIDE - 1 + z] for x in (0, 1) for y in (0, 1) for z in (0, 1)
    ]
    return make_pattern(node.size, [np.stack([corner.ravel() for corner in corners], axis=1)], np.array([], dtype=int))
