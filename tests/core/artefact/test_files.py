"""Whatever operation of the disk fails, and wherever a process dies: the old artefact or the new one, never a part."""

import errno
import os
import resource
import shutil
import stat
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
from core.artefact.test_verify import Empty, Stage, fill

from cfem.core.artefact import files, replace
from cfem.core.artefact.files import locked, write_whole
from cfem.core.artefact.manifest import read_manifest
from cfem.core.artefact.replace import recover_folder, replace_folder
from cfem.core.artefact.verify import judge
from cfem.core.errors import DiskError, OutputError
from cfem.core.stage import Options, run_stage

CODES = (errno.EIO, errno.ENOSPC, errno.EROFS)


class Disk:
    """The n-th operation that changes a file fails, and with `dead` all after it, as if the process had died."""

    def __init__(self, monkeypatch, n: int = 0, dead: bool = False, code: int = errno.EIO):
        self.count, self.n, self.dead, self.code = 0, n, dead, code
        for name in ("replace", "fsync", "unlink", "mkdir", "rmdir", "truncate", "write"):
            monkeypatch.setattr(os, name, self._counted(getattr(os, name)))
        monkeypatch.setattr(files, "open", self._open, raising=False)

    def _open(self, path, mode="r", **options):
        if "w" in mode:
            self._tick()
        return open(path, mode, **options)

    def _counted(self, function):
        def call(*arguments, **options):
            self._tick()
            return function(*arguments, **options)

        return call

    def _tick(self):
        self.count += 1
        if self.count == self.n or (self.dead and 0 < self.n < self.count):
            raise OSError(self.code, os.strerror(self.code), "the disk")


@pytest.fixture
def quick():
    """A folder in memory where there is one: a disk takes its time to sync, and there is much to sync."""
    memory = Path("/dev/shm")
    with tempfile.TemporaryDirectory(dir=memory if memory.is_dir() else None) as folder:
        yield Path(folder)


def made(tmp_path, value="old"):
    return Stage("count", 1, Empty(), {}, tmp_path / "out", extra={"value": value})


def run(tmp_path, value):
    return run_stage(made(tmp_path, value), fill, Options(force=True))


@pytest.mark.parametrize("dead", [False, True], ids=["one fails", "all fail from then on"])
def test_the_nth_operation_fails_for_every_n(quick, dead):
    run(quick / "whole", "old")
    with pytest.MonkeyPatch.context() as patch:
        counter = Disk(patch)
        run(quick / "whole", "new")
    assert counter.count > 30
    for n in range(1, counter.count + 1):
        folder = quick / str(n)
        run(folder, "old")
        with pytest.MonkeyPatch.context() as patch:
            Disk(patch, n, dead, CODES[n % len(CODES)])
            try:
                run(folder, "new")
            except DiskError as error:
                assert "cannot write" in str(error)
        with locked(folder / "out"):
            recover_folder(folder / "out")
        assert judge(folder / "out").damage == ()
        assert run_stage(made(folder, "new"), fill, Options())["status"] in ("done", "up to date")
        assert (
            judge(folder / "out").damage == ()
            and read_manifest(folder / "out")["made_from"] == made(folder, "new").made_from()
        )
        assert {path.name for path in folder.iterdir()} <= {"out", ".out.lock", ".out.made_from"}
        shutil.rmtree(folder)


def test_a_replacement_cut_in_two_is_undone(tmp_path, monkeypatch):
    """On a disk that cannot swap folders."""
    run(tmp_path, "old")
    (tmp_path / "new").mkdir()
    monkeypatch.setattr("cfem.core.artefact.replace.exchange", lambda one, other: False)
    monkeypatch.setattr("cfem.core.artefact.replace.sync_tree", lambda folder: None)
    renamed = os.replace

    def die(source, target):
        if (Path(source), Path(target)) == (tmp_path / "new", tmp_path / "out"):
            raise KeyboardInterrupt
        renamed(source, target)

    monkeypatch.setattr(os, "replace", die)
    with pytest.raises(KeyboardInterrupt):
        replace_folder(tmp_path / "new", tmp_path / "out")
    assert not (tmp_path / "out").exists()
    monkeypatch.undo()
    assert run_stage(made(tmp_path, "old"), lambda folder: 1 / 0, Options())["status"] == "up to date"


@pytest.mark.parametrize("there", [True, False])
def test_a_folder_of_others_is_not_taken_for_a_replacement_cut_in_two(tmp_path, there):
    other = tmp_path / ".out.123.old"
    other.mkdir()
    (other / "thesis.tex").write_text("years")
    if there:
        run(tmp_path, "old")
    run(tmp_path, "new")
    assert (other / "thesis.tex").read_text() == "years" and judge(tmp_path / "out").damage == ()


def test_what_a_killed_write_left_is_not_taken_for_a_result(tmp_path):
    def interrupt(folder):
        (folder / ".numbers.bin.123.tmp").write_text("half")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_stage(made(tmp_path), interrupt, Options())
    assert set(run_stage(made(tmp_path), fill, Options())["files"]) == {"numbers.bin", "deep/text.txt"}


def test_a_file_larger_than_the_user_may_write_is_the_disk_s_refusal(tmp_path):
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    write_whole(tmp_path / "file", b"old")
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, hard))
    try:
        with pytest.raises(DiskError, match="File too large"):
            write_whole(tmp_path / "file", bytes(2000))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [b"old"]


def test_who_holds_the_lock_is_said(tmp_path):
    code = (
        "import sys, pathlib, cfem.core.artefact.files as f\nwith f.locked(pathlib.Path(sys.argv[1])): print(); input()"
    )
    words = [sys.executable, "-c", code, str(tmp_path / "out")]
    other = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    other.stdout.readline()
    with pytest.raises(OutputError, match=f"process {other.pid} on "), locked(tmp_path / "out"):
        pass
    other.kill()
    other.communicate()
    with locked(tmp_path / "out"):
        pass


def test_bytes_reach_the_disk_before_the_name_and_the_name_after(tmp_path, monkeypatch):
    done = []
    real_fsync, real_replace = os.fsync, os.replace

    def fsync(handle):
        done.append("folder" if stat.S_ISDIR(os.fstat(handle).st_mode) else "file")
        real_fsync(handle)

    def rename(*names):
        done.append("rename")
        real_replace(*names)

    monkeypatch.setattr(os, "fsync", fsync)
    monkeypatch.setattr(os, "replace", rename)
    write_whole(tmp_path / "a", b"1")
    assert done == ["file", "rename", "folder"]


def test_a_folder_s_files_and_both_renames_of_its_place_reach_the_disk(tmp_path, monkeypatch):
    synced = []
    for module in (files, replace):
        monkeypatch.setattr(module, "sync", lambda path: synced.append(Path(path).name))
    for name in ("partial", "out"):
        (tmp_path / name / "inner").mkdir(parents=True)
        (tmp_path / name / "inner" / "file").write_bytes(b"1")
    files.sync_tree(tmp_path / "partial")
    assert sorted(synced) == ["file", "inner", "partial"]
    synced.clear()
    replace_folder(tmp_path / "partial", tmp_path / "out")
    assert tmp_path.name in synced
