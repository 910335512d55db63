"""Compiled sources are kept, and never those of a folder that has changed since."""

from export.embedded import needs_compiler

from cfem.export.compiled.build import library

pytestmark = needs_compiler


def test_a_folder_written_again_is_compiled_again_and_the_same_files_are_not(tmp_path):
    source = tmp_path / "answer.c"
    source.write_text('#include "answer.h"\nint answer(void) { return ANSWER; }\n')
    (tmp_path / "answer.h").write_text("#define ANSWER 1\n")
    first = library(tmp_path, names=("answer.c",))
    assert first.answer() == 1 and library(tmp_path, names=("answer.c",)) is first
    (tmp_path / "answer.h").write_text("#define ANSWER 2\n")
    assert library(tmp_path, names=("answer.c",)).answer() == 2
