"""What stands at `--out` is never lost: replaced where it is our own and cheap, else moved aside or refused."""

import json
import os

import pytest

from cfem.core.artefact.files import locked
from cfem.core.artefact.manifest import read_manifest
from cfem.core.artefact.stage_run import Stage
from cfem.core.artefact.unfinished import partial_folder
from cfem.core.errors import DiskError, InputError, OutputError
from cfem.core.spec import Spec
from cfem.core.stage import Options, run_stage


class Empty(Spec):
    pass


def make(out, name="count", value="new", precious=False, force=False):
    def fill(folder):
        (folder / "result.txt").write_text(value)
        return {}

    stage = Stage(name, 1, Empty(), {}, out, precious=precious, extra={"value": value})
    return run_stage(stage, fill, Options(force=force))


def texts(folder):
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("force", [False, True])
@pytest.mark.parametrize("manifest", [None, '{"name": "PWA"}', '{"name": "PWA", "files": {}, "content": "x"}'])
def test_a_folder_of_another_program_is_never_replaced(tmp_path, manifest, force):
    out = tmp_path / "webapp"
    (out / "src").mkdir(parents=True)
    (out / "src" / "app.js").write_text("years")
    if manifest:
        (out / "manifest.json").write_text(manifest)
    before = texts(out)
    with pytest.raises(OutputError, match="not made by cfem"):
        make(out, force=force)
    assert texts(out) == before


@pytest.mark.parametrize("force", [False, True])
def test_results_of_another_stage_are_never_replaced(tmp_path, force):
    make(tmp_path / "out", "sample")
    with pytest.raises(OutputError, match=r"holds results of cfem sample, which cfem mesh does not replace"):
        make(tmp_path / "out", "mesh", force=force)
    assert (tmp_path / "out" / "result.txt").read_text() == "new"


@pytest.mark.parametrize("force", [False, True])
def test_foreign_files_in_an_artefact_are_moved_aside_with_it(tmp_path, force, capsys):
    make(tmp_path / "out", value="old")
    (tmp_path / "out" / "thesis.tex").write_text("years")
    make(tmp_path / "out", force=force)
    assert texts(tmp_path / "out") == {"result.txt", "manifest.json"}
    assert (tmp_path / "out.old-1" / "thesis.tex").read_text() == "years"
    said = capsys.readouterr().err
    assert "out.old-1" in said and "thesis.tex" in said and said.count("\n") == 1


def test_what_is_precious_is_kept_and_by_force_moved_aside(tmp_path, capsys):
    make(tmp_path / "out", value="first", precious=True)
    for precious in (True, False):  # whatever the new run would be
        with pytest.raises(OutputError, match="other inputs"):
            make(tmp_path / "out", value="second", precious=precious)
    make(tmp_path / "out", value="second", precious=True, force=True)
    make(tmp_path / "out", value="second", precious=True, force=True)
    found = [(tmp_path / name / "result.txt").read_text() for name in ("out", "out.old-1", "out.old-2")]
    assert found == ["second", "first", "second"]
    first, second = capsys.readouterr().err.splitlines()
    assert first.endswith("bytes)") or first.endswith("kB)")
    assert "is now in" in second and "; with 1 older, " in second and second.endswith("cfem clean tells what can go)")


def test_cheap_results_are_replaced_without_a_trace(tmp_path, capsys):
    make(tmp_path / "out", value="old")
    make(tmp_path / "out")
    assert {path.name for path in tmp_path.iterdir()} == {"out", ".out.lock"} and not capsys.readouterr().err


def test_an_error_moves_nothing_aside(tmp_path):
    make(tmp_path / "out", value="old", precious=True)
    with pytest.raises(InputError):
        run_stage(Stage("count", 1, Empty(), {}, tmp_path / "out"), fail, Options(force=True))
    assert (tmp_path / "out" / "result.txt").read_text() == "old"


def fail(folder):
    raise InputError("no good")


def test_a_damaged_artefact_is_kept_and_by_force_moved_aside(tmp_path):
    make(tmp_path / "out", value="old")
    manifest = tmp_path / "out" / "manifest.json"
    os.truncate(manifest, manifest.stat().st_size // 2)
    with pytest.raises(InputError, match="damaged"):
        make(tmp_path / "out")
    make(tmp_path / "out", force=True)
    assert (tmp_path / "out.old-1" / "result.txt").read_text() == "old"


def test_a_link_to_a_folder_is_written_through(tmp_path):
    (tmp_path / "big" / "disk").mkdir(parents=True)
    link = tmp_path / "out"
    link.symlink_to(tmp_path / "big" / "disk")
    for value in ("old", "new"):
        make(link, value=value)
        assert link.is_symlink() and (tmp_path / "big" / "disk" / "result.txt").read_text() == value
    assert make(link)["status"] == "up to date"


def test_links_at_the_names_of_our_own_files_are_refused(tmp_path):
    victim = tmp_path / "victim"
    victim.write_text("precious")
    lock = tmp_path / ".out.lock"
    lock.symlink_to(victim)
    with pytest.raises(OutputError, match=r"\.out\.lock: is a symbolic link"), locked(tmp_path / "out"):
        pass
    lock.unlink()
    (tmp_path / "elsewhere").mkdir()
    partial_folder(tmp_path / "out").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(OutputError, match=r"\.out\.partial: is a symbolic link"):
        make(tmp_path / "out")
    assert victim.read_text() == "precious" and not list((tmp_path / "elsewhere").iterdir())


def test_the_working_folder_and_a_file_are_no_place_for_an_artefact(tmp_path, monkeypatch):
    from pathlib import Path

    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    for out in (Path("."), Path(".."), tmp_path / "here"):
        with pytest.raises(OutputError, match="the folder that you are in"):
            make(out)
    (tmp_path / "file").write_text("x")
    with pytest.raises(OutputError, match="is a file, not a folder"):
        make(tmp_path / "file")
    for out in (tmp_path / "file" / "out", tmp_path / "file" / "deep" / "out"):
        with pytest.raises(DiskError, match="a file stands where a folder is needed") as told:
            make(out)
        assert str(tmp_path / "file") in str(told.value)
    assert (tmp_path / "file").read_text() == "x"


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_no_permission_is_said_as_such(tmp_path):
    (tmp_path / "closed").mkdir(mode=0o500)
    with pytest.raises(DiskError, match=r"Permission denied .*that you may write to"):
        make(tmp_path / "closed" / "out")


def test_no_permission_is_not_called_a_full_disk():
    import errno

    from cfem.core.artefact.files import disk_errors

    for code, advice in ((errno.EACCES, "you may write to"), (errno.ENOSPC, "free space"), (errno.EROFS, "read-only")):
        with pytest.raises(DiskError, match=advice), disk_errors("there"):
            raise OSError(code, os.strerror(code))


def test_the_manifest_says_what_is_precious(tmp_path):
    for precious in (True, False):
        make(tmp_path / str(precious), precious=precious)
        assert read_manifest(tmp_path / str(precious))["precious"] is precious
        assert json.loads((tmp_path / str(precious) / "manifest.json").read_bytes())["stage"] == "count"
