"""Structures that C declares, as Python has them: their sizes are those of the compiler."""

import ctypes

import numpy as np
from export.embedded import needs_compiler

from cfem.export.compiled.build import library
from cfem.export.compiled.structures import numbers, structures

pytestmark = needs_compiler
HEADER = """#include <stdint.h>
#define MANY (2 + 1)
#define NONE 0
typedef float cfem_real;
typedef struct { /* a comment; with [brackets] */
    int count, numbers[MANY * 4 / 2]; uint32_t bits;
    double place[MANY][2], *at;
    const cfem_real weight[NONE ? NONE : 1];
    unsigned char flag;
} cfem_part;
typedef struct {
    unsigned (*ask)(void *with, const double *s);
    cfem_part part[2];
#if NONE
    double gone;
#endif
} cfem_whole;
"""


def test_members_lie_where_the_compiler_puts_them(tmp_path):
    (tmp_path / "cfem_example.h").write_text(HEADER)
    (tmp_path / "cfem_example.c").write_text(
        '#include "cfem_example.h"\n#include <stddef.h>\n'
        "unsigned long sizes[] = {sizeof(cfem_part), sizeof(cfem_whole), offsetof(cfem_whole, part[1].flag)};\n"
        "void fill(cfem_whole *to) { to->part[1].place[2][1] = 7.0; }\n"
    )
    types, code = structures(tmp_path, "cfem_example.h"), library(tmp_path)
    part, whole = types["cfem_part"], types["cfem_whole"]
    at = whole.part.offset + ctypes.sizeof(part) + part.flag.offset
    sizes = ctypes.sizeof(part), ctypes.sizeof(whole), at
    assert sizes == tuple((ctypes.c_ulong * 3).in_dll(code, "sizes"))
    assert not hasattr(whole, "gone")
    made = whole()
    code.fill(ctypes.byref(made))
    np.testing.assert_array_equal(np.array(made.part[1].place), [[0, 0], [0, 0], [0, 7]])
    numbers(made.part[0].place)[...] = [[1, 2], [3, 4], [5, 6]]
    assert made.part[0].place[1][0] == 3
