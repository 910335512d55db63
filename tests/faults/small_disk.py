"""Run as a program in a mount namespace of its own (`unshare --map-root-user --mount`): commands on a disk with so and
so many pages free, up to the first that suffice. Prints a line of JSON each: pages, exit code, what was said, whether
the artefact was the old one or the new one, whether the next run, with space again, ended it.

    small_disk.py FOLDER PAGES... -- COMMAND SPEC OVERRIDE"""

import json
import os
import subprocess
import sys
from pathlib import Path

from typer.testing import CliRunner

from cfem.cli.app import app
from cfem.core.artefact.manifest import read_manifest
from cfem.core.artefact.verify import judge

PAGE = 4096


def main(disk: Path, pages: list[int], words: list[str], other: str) -> None:
    subprocess.run(["mount", "-t", "tmpfs", "-o", "size=16m", "tmpfs", str(disk)], check=True)
    out = disk / "out"

    def run(*more):
        result = CliRunner().invoke(app, [*words, "--out", str(out), "--quiet", *more])
        return result.exit_code, result.stderr

    def content():
        return read_manifest(out)["content"] if not judge(out).damage else None

    assert run("--set", other)[0] == 0
    new = content()
    for free in pages:
        assert run("--force")[0] == 0
        old = content()
        fill(disk / "filler", free)
        code, said = run("--set", other)
        whole = content() == (new if code == 0 else old)
        (disk / "filler").unlink()
        ended = run("--set", other)[0] == 0 and content() == new
        print(json.dumps({"pages": free, "code": code, "said": said, "whole": whole, "ended": ended}), flush=True)
        if code == 0:
            break


def fill(path: Path, free: int) -> None:
    """All but `free` pages."""
    space = os.statvfs(path.parent)
    with open(path, "wb") as file:
        os.posix_fallocate(file.fileno(), 0, space.f_bavail * space.f_frsize - free * PAGE)


if __name__ == "__main__":
    sign = sys.argv.index("--")
    *command, change = sys.argv[sign + 1 :]
    main(Path(sys.argv[1]), [int(word) for word in sys.argv[2:sign]], command, change)
