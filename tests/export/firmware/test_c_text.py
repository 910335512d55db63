"""Text in generated C stays text: the compiler reads back the same bytes, whatever they are."""

import subprocess

import numpy as np
import pytest
from export.embedded import needs_compiler, spectral

from cfem.export.compiled.build import compiler
from cfem.export.firmware import c_text
from cfem.export.firmware.folder import write_c
from cfem.export.spec import CSpec

HOSTILE = [
    'a"; int x = system("touch pwned"); const char *y = "',
    'line\nbreak", "carriage\rreturn',
    "backslash \\ at the end\\",
    "trigraph ??/ and ??'",
    "digits after an escape: \x01234",
    "end of a comment */ #include </etc/passwd> /*",
    "é µ 漢 \x7f\x1b[31m",
]


@needs_compiler
def test_the_compiler_reads_back_the_same_bytes(tmp_path):
    source = tmp_path / "text.c"
    literals = ",\n".join(c_text.string(text) for text in HOSTILE)
    comments = "\n".join(c_text.comment(text) for text in HOSTILE)
    source.write_text(
        f"{comments}\n#include <stdio.h>\nstatic const char *texts[] = {{{literals}}};\n"
        f"int main(void) {{ int i; for (i = 0; i < {len(HOSTILE)}; i++) {{ fputs(texts[i], stdout); putchar(0); }} "
        "return 0; }\n"
    )
    command = [compiler(), "-std=c99", "-Wall", "-Werror", "-o", tmp_path / "text", source]
    subprocess.run(command, check=True, capture_output=True)
    said = subprocess.run([tmp_path / "text"], check=True, capture_output=True).stdout
    assert said.split(b"\0")[:-1] == [text.encode() for text in HOSTILE]


@pytest.mark.parametrize("text", HOSTILE)
def test_names_and_the_scene_of_a_model_are_text_in_the_folder(tmp_path, text):
    """Reading a model refuses such names; the export does not count on it."""
    meta, arrays = spectral()
    names = {"effectors": meta["rows"]["effectors"], "actuators": [text, "right"]}
    write_c(
        tmp_path,
        {**meta, "scene": text, "rows": names},
        arrays,
        CSpec(vectors=2),
        np.array(meta["domain"]["states"])[:2, :2],
    )
    header = (tmp_path / "cfem_data.h").read_text()
    line = next(line for line in header.splitlines() if line.startswith("#define CFEM_ACTUATORS"))
    assert line == f"#define CFEM_ACTUATORS {c_text.string(text + ' right')}"
    assert header.splitlines()[0] == c_text.comment(
        f"{text}, kind spectral, form displacement: by cfem export. Units: mm, N, MPa."
    )
