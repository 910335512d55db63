"""The gate of samples in C against that of Python."""

import ctypes

import numpy as np
from export.embedded import needs_compiler

from cfem.export.compiled.build import STANDARD, compiler, run
from cfem.export.firmware.copying import SOURCES
from cfem.predict.estimation.gate import Gate, SampleVerdict

CODE = """#include "cfem_gate.h"
double spread(const cfem_gate *gate) { return gate->spread; }
void restart(cfem_gate *gate) { cfem_gate_restart(gate); }
int judge(cfem_gate *gate, double square, int n, double sigmas, int samples) {
    return cfem_gate_judge(gate, square, n, sigmas, samples);
}
"""
ORDER = [SampleVerdict.ACCEPTED, SampleVerdict.REJECTED, SampleVerdict.RESTART]


@needs_compiler
def test_verdicts_are_those_of_python(tmp_path):
    """Of squares that come in runs, with numbers of which there is no answer."""
    (tmp_path / "gate.c").write_text(CODE)
    words = [
        compiler(),
        *STANDARD,
        "-Wall",
        "-Wextra",
        "-Werror",
        "-I",
        str(SOURCES / "controller"),
        "-shared",
        "-fPIC",
    ]
    run([*words, "-o", "gate.so", "gate.c", "-lm"], tmp_path)
    library, state = ctypes.CDLL(str(tmp_path / "gate.so")), (ctypes.c_double * 8)()
    library.spread.restype = real = ctypes.c_double
    rng, gate, said = np.random.default_rng(0), Gate(4.0, 3), []
    library.restart(state)
    for _ in range(400):
        usual, n = rng.choice([1.0, 30.0, 1e4, np.inf, np.nan]), int(rng.integers(0, 9))
        for _ in range(rng.integers(1, 7)):
            square = usual * rng.chisquare(max(n, 1))
            verdict = gate.judge(square, n)
            assert library.judge(state, real(square), n, real(4.0), 3) == ORDER.index(verdict)
            assert library.spread(state) == gate.spread
            said.append(verdict)
    assert min(said.count(verdict) for verdict in ORDER) > 30
