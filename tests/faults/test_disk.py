"""Whichever operation of the disk fails, and wherever it is full, the command says so and the next run ends it."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from core.artefact.test_files import CODES, Disk, quick
from faults.sampling import make
from surrogate.stored import train_folder

from cfem.core.artefact.verify import judge
from cfem.core.errors import DiskError

__all__ = ["quick"]


@pytest.mark.parametrize("every", [61, pytest.param(1, marks=pytest.mark.slow)])
def test_the_nth_operation_fails(quick, every):
    whole = make(quick / "whole")["content"]
    with pytest.MonkeyPatch.context() as patch:
        counter = Disk(patch)
        make(quick / "counted")
    assert counter.count > 100
    failed = 0
    for n in range(1, counter.count + 1, every):
        out = quick / f"{n}" / "out"
        with pytest.MonkeyPatch.context() as patch:
            Disk(patch, n, dead=n % 2 == 0, code=CODES[n % len(CODES)])
            try:
                make(out)
            except DiskError as error:
                failed += 1
                assert "cannot write" in str(error)
        assert not out.exists() or judge(out).damage == (), n
        assert make(out)["content"] == whole, n
        assert judge(out).damage == ()
    assert failed > 0.8 * counter.count / every


NAMESPACE = ["unshare", "--map-root-user", "--mount"]
SPECS = {
    "train": ("dataset: samples\nout: none\nmodel: {kind: spectral, max_degree: 2}\n", "model.max_degree=3"),
    "export": ("model: model\nout: none\nformats: [arrays]\n", "formats=[arrays, onnx, c]"),
}


@pytest.mark.skipif(
    shutil.which("unshare") is None or subprocess.run([*NAMESPACE, "true"], capture_output=True).returncode != 0,
    reason="needs a mount namespace",
)
@pytest.mark.parametrize(
    "command, pages",
    [("train", [0, 2, 50])] + [pytest.param(one, range(0, 200, 3), marks=pytest.mark.slow) for one in SPECS],
)
def test_the_disk_is_full(tmp_path, command, pages):
    train_folder(tmp_path, "{kind: spectral, max_degree: 2}")
    text, other = SPECS[command]
    spec, disk = tmp_path / f"{command}-small.yaml", tmp_path / "disk"
    spec.write_text(text)
    disk.mkdir()
    program = Path(__file__).with_name("small_disk.py")
    words = [*NAMESPACE, sys.executable, str(program), str(disk), *map(str, pages), "--", command, str(spec), other]
    here = os.environ | {"PYTHONPATH": str(program.parents[1])}
    done = subprocess.run(words, capture_output=True, text=True, env=here)
    assert done.returncode == 0, done.stderr
    *full, last = map(json.loads, done.stdout.splitlines())
    assert len(full) >= 2 and last["code"] == 0
    for one in [*full, last]:
        assert one["whole"] and one["ended"], one
    for one in full:
        assert one["code"] == 7 and "cannot write: No space left on device" in one["said"], one
    print(f"{command}: full with 0 to {full[-1]['pages']} pages free")
