"""No damage of an artefact goes unseen, whichever byte it hits."""

import json
import os

import numpy as np
import pytest
from typer.testing import CliRunner

from cfem.cli.app import app
from cfem.core.artefact.content import artefact_file
from cfem.core.artefact.files import write_whole
from cfem.core.artefact.manifest import MANIFEST, is_inside, read_manifest, write_manifest
from cfem.core.artefact.stage_run import Stage
from cfem.core.artefact.verify import judge, verify
from cfem.core.errors import InputError
from cfem.core.spec import Spec
from cfem.core.stage import Options, run_stage


class Empty(Spec):
    pass


def fill(folder):
    write_whole(folder / "numbers.bin", np.arange(50.0).tobytes())
    write_whole(folder / "deep" / "text.txt", b"two words")
    return {"least": 1e-05}


@pytest.fixture
def artefact(tmp_path):
    out = tmp_path / "data" / "robot" / "numbers"
    run_stage(Stage("count", 1, Empty(), {}, out), fill, Options())
    return out


def only(artefact):
    (verdict,) = verify([artefact.parents[1]])
    return verdict.damage


def test_a_whole_artefact_has_no_damage_and_work_under_way_is_none(artefact):
    (artefact.parent / ".other.partial").mkdir()
    (artefact.parent / ".other.partial" / "half").write_text("x")
    (artefact.parent / "notes.txt").write_text("mine")
    (verdict,) = verify([artefact.parents[1]])
    assert verdict.damage == () and verdict.files == 2 and verdict.format == 1 and verdict.stage == "count"


def cut(artefact):
    os.truncate(artefact / "numbers.bin", 399)


def flip(artefact):
    data = bytearray((artefact / "numbers.bin").read_bytes())
    data[200] ^= 1
    (artefact / "numbers.bin").write_bytes(data)


DAMAGE = {
    "cut": (cut, "numbers.bin: is damaged"),
    "flipped": (flip, "numbers.bin: is damaged"),
    "missing": (lambda folder: (folder / "deep" / "text.txt").unlink(), "deep/text.txt: is missing"),
    "foreign": (lambda folder: (folder / "deep" / "more.txt").write_text("?"), "deep/more.txt: is foreign"),
    "a link": (lambda folder: (folder / "link").symlink_to("nowhere"), "link: is foreign"),
    "no manifest": (lambda folder: (folder / MANIFEST).unlink(), "holds no manifest.json: no command of cfem made it"),
    "empty manifest": (lambda folder: (folder / MANIFEST).write_bytes(b""), "manifest.json: is damaged"),
}


@pytest.mark.parametrize("harm, sentence", DAMAGE.values(), ids=DAMAGE.keys())
def test_damage_is_named_by_its_file(artefact, harm, sentence):
    harm(artefact)
    (found,) = only(artefact)
    assert sentence in found and str(artefact) in found


@pytest.mark.parametrize("every", [61, pytest.param(1, marks=pytest.mark.slow)])
def test_every_flipped_bit_and_every_cut_of_a_manifest_is_seen(artefact, every):
    path = artefact / MANIFEST
    data = path.read_bytes()
    for bit in range(0, 8 * len(data), every):
        changed = bytearray(data)
        changed[bit // 8] ^= 1 << bit % 8
        path.write_bytes(changed)
        assert judge(artefact).damage, bit
    for length in range(0, len(data), every):
        path.write_bytes(data[:length])
        assert judge(artefact).damage, length
    path.write_bytes(data)
    assert not judge(artefact).damage


def test_a_manifest_without_format_is_read_and_a_newer_one_is_not(artefact):
    manifest = read_manifest(artefact)
    old = {key: value for key, value in manifest.items() if key not in ("format", "checksum")}
    (artefact / MANIFEST).write_text(json.dumps(old))
    assert read_manifest(artefact) == old and judge(artefact).format is None
    write_manifest(artefact, old)
    assert read_manifest(artefact) == manifest


def test_names_outside_the_folder_are_refused(artefact, tmp_path):
    (tmp_path / "data" / "robot" / "secret").write_text("x")
    with pytest.raises(InputError, match=r"holds no \.\./secret: cfem \w+ made .+ there"):
        artefact_file(artefact, "../secret")
    manifest = read_manifest(artefact)
    write_manifest(artefact, {**manifest, "files": {"../secret": "0" * 64}})
    with pytest.raises(InputError, match="outside its folder"):
        read_manifest(artefact)
    assert [is_inside(name) for name in ("a", "a/b", "/a", "a/../b", "", "..")] == [True, True, *[False] * 4]


def test_a_folder_of_many_files_names_three_of_them(artefact):
    write_manifest(artefact, {**read_manifest(artefact), "files": {f"{k}.c": "0" * 64 for k in range(5)}})
    with pytest.raises(InputError, match=r"holds no a: cfem \w+ made 0\.c, 1\.c, 2\.c and 2 more there"):
        artefact_file(artefact, "a")


def test_the_command_ends_with_3_where_anything_is_damaged(artefact):
    def run(*words):
        return CliRunner().invoke(app, ["verify", str(artefact), *words])

    assert run().exit_code == 0 and "whole" in run().stdout
    cut(artefact)
    assert run().exit_code == 3 and "numbers.bin" in run().stdout and "1 of 1" in run().stderr
    assert json.loads(run("--json").stdout)["damaged"] == 1
    assert CliRunner().invoke(app, ["verify", str(artefact / "none")]).exit_code == 3
