"""The series of a batch of environments: numba's lanes against the exported C, one robot after the other.

    python benchmarks/gym_series.py MODEL

MODEL: a folder of `cfem train` with a spectral model of form displacement. Prints JSON: nanoseconds of CPU time for the
energy's slopes and Hessian and the effectors of one robot, the least of some rounds, by numba's loops over lanes and by
cfem_spectral, compiled with -O3 -march=native."""

import argparse
import ctypes
import json
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from cfem.export.compiled.build import library
from cfem.export.firmware.folder import write_c
from cfem.export.spec import CSpec
from cfem.gym.lanes import LANES, add_up, fill_basis, room_of
from cfem.gym.robots import Robots
from cfem.predict.load import build, read_model

ROUNDS, REPEATS, ROBOTS = 15, 100, 1024
LOOP = """#include "cfem_parts.h"
double cfem_sum;
void cfem_loop(int count, const double *s) {
    cfem_parts parts;
    for (int i = 0; i < count; i++) cfem_spectral(s + i * CFEM_NA, &parts), cfem_sum += parts.gradient[0];
}
"""


def least(call: Callable[[], None], robots: int) -> float:
    """Nanoseconds of CPU time a robot."""
    found = []
    for _ in range(ROUNDS):
        begin = time.process_time()
        for _ in range(REPEATS):
            call()
        found.append(time.process_time() - begin)
    return 1e9 * min(found) / REPEATS / robots


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", type=Path)
    meta, arrays = read_model(parser.parse_args().model)
    model = build(meta, arrays)
    robots, (low, high) = Robots(model), model.domain.delta_a
    s = np.random.default_rng(0).uniform(low, high, (ROBOTS, len(low)))
    series, lanes = robots.series, np.ascontiguousarray(s[:LANES].T)
    sums = room_of(series, len(low))

    def by_lanes() -> None:
        fill_basis(lanes, series, sums.table, sums.basis)
        add_up(series.values, sums.basis, sums.sums)

    by_lanes()  # compiled
    with tempfile.TemporaryDirectory() as place:
        write_c(Path(place), meta, arrays, CSpec(), s[:20])
        (Path(place) / "cfem_loop.c").write_text(LOOP)
        code = library(Path(place), ("-O3", "-march=native"))
        numba, c = (
            least(by_lanes, LANES),
            least(lambda: code.cfem_loop(ROBOTS, s.ctypes.data_as(ctypes.c_void_p)), ROBOTS),
        )
    print(json.dumps({"numba_ns": numba, "c_ns": c, "ratio": c / numba}, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
