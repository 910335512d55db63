"""An artefact is whole or absent, current or stale, and never lost to an error."""

import os
import subprocess
import sys

import numpy as np
import pytest

from cfem.core.artefact.content import artefact_file
from cfem.core.artefact.files import content_sha256, file_sha256, locked, write_whole
from cfem.core.artefact.manifest import harm, read_manifest
from cfem.core.artefact.stage_run import Stage
from cfem.core.artefact.unfinished import partial_folder
from cfem.core.errors import GateError, InputError, OutputError, SpecError
from cfem.core.spec import Spec
from cfem.core.stage import Options, run_stage


class Numbers(Spec):
    value: int = 1
    out: str = "somewhere"


def stage(tmp_path, value=1, precious=False, inputs=None, out="out"):
    return Stage("count", 1, Numbers(value=value, out=out), inputs or {}, tmp_path / out, ("out",), precious)


def write(text="1"):
    def work(folder):
        (folder / "result.txt").write_text(text)
        return {"answer": 42}

    return work


def refuse(folder):
    raise AssertionError("must not run")


def test_runs_once_then_is_up_to_date(tmp_path):
    assert run_stage(stage(tmp_path), write(), Options())["status"] == "done"
    again = run_stage(stage(tmp_path), refuse, Options())
    assert again["status"] == "up to date" and again["results"] == {"answer": 42}
    assert run_stage(stage(tmp_path), refuse, Options(check=True))["status"] == "up to date"


def test_a_changed_spec_input_or_missing_file_makes_it_stale(tmp_path):
    source = tmp_path / "source"
    source.write_text("a")
    run_stage(stage(tmp_path, inputs={"source": source}), write(), Options())
    for changed in (stage(tmp_path, value=2, inputs={"source": source}), stage(tmp_path)):
        with pytest.raises(GateError, match="stale"):
            run_stage(changed, refuse, Options(check=True))
    (tmp_path / "out" / "result.txt").unlink()
    with pytest.raises(GateError):
        run_stage(stage(tmp_path, inputs={"source": source}), refuse, Options(check=True))
    source.write_text("b")
    assert run_stage(stage(tmp_path, inputs={"source": source}), write("2"), Options())["status"] == "done"


def test_an_error_leaves_the_old_output_as_it_was(tmp_path):
    run_stage(stage(tmp_path), write("old"), Options())

    def fail(folder):
        (folder / "result.txt").write_text("new")
        raise InputError("no good")

    with pytest.raises(InputError):
        run_stage(stage(tmp_path, value=2), fail, Options())
    assert (tmp_path / "out" / "result.txt").read_text() == "old"
    assert run_stage(stage(tmp_path), refuse, Options())["status"] == "up to date"


def test_an_interrupted_stage_finds_its_part_again_and_another_one_does_not(tmp_path):
    def interrupt(folder):
        (folder / "half").write_text("x")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_stage(stage(tmp_path), interrupt, Options())
    assert (partial_folder(tmp_path / "out") / "half").exists()
    seen = []
    run_stage(stage(tmp_path), lambda folder: seen.append((folder / "half").exists()) or {}, Options())
    with pytest.raises(KeyboardInterrupt):
        run_stage(stage(tmp_path, value=3), interrupt, Options())
    run_stage(stage(tmp_path, value=4), lambda folder: seen.append((folder / "half").exists()) or {}, Options())
    assert seen == [True, False]


def test_a_name_that_leads_out_of_the_folder_is_refused(tmp_path):
    with pytest.raises(SpecError, match="outside the artefact"):
        run_stage(stage(tmp_path), lambda folder: write_whole(folder / "../../picture.png", b"x") or {}, Options())
    write_whole(tmp_path / "free.txt", b"x")


def test_precious_output_is_replaced_only_by_force(tmp_path):
    run_stage(stage(tmp_path, precious=True), write("old"), Options())
    with pytest.raises(OutputError, match="other inputs"):
        run_stage(stage(tmp_path, value=2, precious=True), refuse, Options())
    run_stage(stage(tmp_path, value=2, precious=True), write("new"), Options(force=True))
    assert (tmp_path / "out" / "result.txt").read_text() == "new"


def test_what_cfem_did_not_make_is_not_touched(tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "thesis.tex").write_text("years")
    with pytest.raises(OutputError, match="not made by cfem"):
        run_stage(stage(tmp_path), refuse, Options())


def test_two_writers_exclude_each_other_and_a_dead_one_does_not_block(tmp_path):
    code = (
        "import sys, pathlib, cfem.core.artefact.files as f\n"
        "with f.locked(pathlib.Path(sys.argv[1])): print('in', flush=True); sys.stdin.read()"
    )
    other = subprocess.Popen(
        [sys.executable, "-c", code, str(tmp_path / "out")], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    assert other.stdout.readline() == b"in\n"
    with pytest.raises(OutputError, match="another process"):
        run_stage(stage(tmp_path), refuse, Options())
    other.kill()
    other.communicate()
    with locked(tmp_path / "out"):
        pass


def test_a_file_changed_by_hand_is_made_again_and_kept(tmp_path):
    run_stage(stage(tmp_path), write("1"), Options())
    result = tmp_path / "out" / "result.txt"
    result.write_text("2")
    with pytest.raises(GateError, match=r"stale: result.txt has changed since it was made"):
        run_stage(stage(tmp_path), refuse, Options(check=True))
    assert run_stage(stage(tmp_path), write("1"), Options())["status"] == "done"
    assert result.read_text() == "1" and (tmp_path / "out.old-1" / "result.txt").read_text() == "2"


def test_a_file_that_has_only_another_time_is_as_it_was_and_one_of_the_same_time_is_not_read(tmp_path, monkeypatch):
    run_stage(stage(tmp_path), write("1"), Options())
    result, read = tmp_path / "out" / "result.txt", []
    monkeypatch.setattr("cfem.core.artefact.manifest.file_sha256", lambda path: read.append(path) or file_sha256(path))
    assert run_stage(stage(tmp_path), refuse, Options())["status"] == "up to date" and not read
    os.utime(result, (1, 1))
    assert run_stage(stage(tmp_path), refuse, Options())["status"] == "up to date" and read == [result]


def test_harm_names_the_file(tmp_path):
    run_stage(stage(tmp_path), write("1"), Options())
    (tmp_path / "out" / "result.txt").write_text("2")
    assert harm(tmp_path / "out", read_manifest(tmp_path / "out")) == "result.txt has changed since it was made"
    (tmp_path / "out" / "result.txt").unlink()
    assert harm(tmp_path / "out", read_manifest(tmp_path / "out")) == "result.txt is missing"


def test_damage_is_found_on_reading(tmp_path):
    run_stage(stage(tmp_path), write(), Options())
    out = tmp_path / "out"
    assert artefact_file(out, "result.txt").read_text() == "1"
    (out / "result.txt").write_text("2")
    with pytest.raises(InputError, match="SHA-256"):
        artefact_file(out, "result.txt")
    (out / "manifest.json").write_text("{")
    with pytest.raises(InputError, match="damaged"):
        read_manifest(out)
    with pytest.raises(InputError, match="no such artefact"):
        read_manifest(tmp_path / "none")


def test_content_hash_sees_values_and_not_their_spelling():
    assert content_sha256({"a": np.array([1.0, 2.0]), "b": (1,)}) == content_sha256({"b": [1], "a": [1.0, 2.0]})
    assert content_sha256([1.0]) != content_sha256([1.0 + 2e-16])


def test_write_whole_leaves_no_temporary_file(tmp_path):
    write_whole(tmp_path / "a" / "file", b"x")
    write_whole(tmp_path / "a" / "file", b"y")
    assert [p.name for p in (tmp_path / "a").iterdir()] == ["file"] and (tmp_path / "a" / "file").read_bytes() == b"y"
