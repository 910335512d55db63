"""What Linux has and Windows and macOS lack is taken away in a process of its own: the stages work all the same.

Windows is imitated: no fcntl and no resource, locks by an `msvcrt` that has its rules, folders that cannot be opened,
files that only a handle with write access can sync, no calls for cores, and texts that are not UTF-8 by default."""

import subprocess
import sys
import textwrap

import pytest
from core.test_optional import write_scene
from support.blocked import BLOCK, cfem_without

WINDOWS = textwrap.dedent(
    """
    import fcntl, multiprocessing.connection, os, subprocess, sys, tempfile, types

    posix, real_open, real_fsync = fcntl, os.open, os.fsync

    def locking(handle, mode, count):
        assert mode == 2 and os.lseek(handle, 0, os.SEEK_CUR) > 1e6
        try:
            posix.lockf(handle, posix.LOCK_EX | posix.LOCK_NB, count, 0, os.SEEK_CUR)
        except OSError:
            raise PermissionError(13, "Permission denied") from None

    def open_(path, flags, *rest, **options):
        if os.path.isdir(path) and not options:
            raise PermissionError(13, "Permission denied", str(path))
        return real_open(path, flags, *rest, **options)

    def fsync(handle):
        if not posix.fcntl(handle, posix.F_GETFL) & (os.O_WRONLY | os.O_RDWR):
            raise OSError(9, "Bad file descriptor")
        real_fsync(handle)

    sys.modules["msvcrt"] = types.SimpleNamespace(locking=locking, LK_NBLCK=2)
    sys.modules["fcntl"] = sys.modules["resource"] = None
    for name in "pread pwrite sched_getaffinity fork O_NOFOLLOW O_DIRECTORY getuid geteuid killpg".split():
        delattr(os, name)
    import cfem.core.system as system
    system.sys = types.SimpleNamespace(platform="win32")
    os.open, os.fsync = open_, fsync
    """
)
MACOS = "import os; del os.sched_getaffinity"
SAMPLE = """
scene: scene.yaml
mesh: mesh
out: samples
space: pulling
splits: {train: {rows: 4, method: random, seed: 1}, test: {rows: 2, method: random, seed: 2}}
skeleton: 2
"""


def run(words, folder, system):
    done = cfem_without(set(), words, folder, system)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.slow
def test_windows_meshes_samples_and_verifies(tmp_path):
    write_scene(tmp_path, "hex8")
    assert "mesh: done" in run(["mesh", "scene.yaml"], tmp_path, WINDOWS)
    assert "mesh: up to date" in run(["mesh", "scene.yaml"], tmp_path, WINDOWS)
    assert "mesh: done" in run(["mesh", "scene.yaml", "--force"], tmp_path, WINDOWS)
    (tmp_path / "sample.yaml").write_text(SAMPLE)
    assert "sample: done" in run(["sample", "sample.yaml", "--workers", "1"], tmp_path, WINDOWS)
    run(["verify", "mesh", "samples"], tmp_path, WINDOWS)


def test_windows_locks_out_a_second_writer_and_says_who_writes(tmp_path):
    write_scene(tmp_path, "hex8")
    holds = """
from pathlib import Path
from cfem.core.artefact.files import locked
with locked(Path("mesh")):
    print("locked", flush=True)
    input()
"""
    code = BLOCK.format(names=set(), also=WINDOWS) + holds
    words = [sys.executable, "-c", code]
    with subprocess.Popen(words, cwd=tmp_path, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as holder:
        assert holder.stdout.readline() == "locked\n"
        done = cfem_without(set(), ["mesh", "scene.yaml"], tmp_path, WINDOWS)
        assert done.returncode == 6 and f"(process {holder.pid} on " in done.stderr
        holder.communicate("\n")
    assert "mesh: done" in run(["mesh", "scene.yaml"], tmp_path, WINDOWS)


def test_macos_counts_its_cores(tmp_path):
    assert int(run(["--version"], tmp_path, MACOS).count(".")) >= 1
    code = f"{MACOS}\nfrom cfem.core.system import cores\nassert cores() == os.cpu_count()"
    subprocess.run([sys.executable, "-c", code], check=True)
