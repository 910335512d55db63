"""What is no artefact, or none of this version, is said in one sentence; an error not of the disk stays itself."""

import errno
import hashlib
import json
import os

import pytest

from cfem.core.artefact import files
from cfem.core.artefact.files import disk_errors, file_sha256, locked, read_json, write_json, write_whole
from cfem.core.artefact.manifest import MANIFEST, read_manifest, write_manifest
from cfem.core.artefact.replace import replace_folder
from cfem.core.artefact.verify import judge, verify
from cfem.core.errors import DiskError, InputError


def test_what_is_no_file_has_no_hash(tmp_path):
    write_whole(tmp_path / "file", b"1")
    assert file_sha256(tmp_path / "file") == hashlib.sha256(b"1").hexdigest()
    for path, why in (("", "is not a file"), ("none", "no such file"), ("file/below", "cannot be read")):
        with pytest.raises(InputError, match=why):
            file_sha256(tmp_path / path)


@pytest.mark.parametrize("text, why", [("{", "is damaged"), ("[1]", "not a JSON object"), ("\xff", "is damaged")])
def test_what_is_no_json_object_is_said(tmp_path, text, why):
    (tmp_path / "x.json").write_bytes(text.encode("latin-1"))
    with pytest.raises(InputError, match=f"x.json: .*{why}"):
        read_json(tmp_path / "x.json")


def test_a_json_object_is_read_as_it_was_written(tmp_path):
    write_json(tmp_path / "x.json", {"a": 0.1, "b": (1, None)})
    assert read_json(tmp_path / "x.json") == {"a": 0.1, "b": [1, None]}
    with pytest.raises(InputError, match="no such file"):
        read_json(tmp_path / "y.json")


def test_only_the_disk_s_errors_become_its_errors(tmp_path):
    for code, kind in ((errno.ENOSPC, DiskError), (errno.ENOENT, FileNotFoundError)):
        with pytest.raises(kind), disk_errors(tmp_path):
            raise OSError(code, os.strerror(code))


def test_a_file_system_without_locks_is_said(tmp_path, monkeypatch):
    def refuse(handle, how):
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr("fcntl.flock", refuse)
    with pytest.raises(DiskError, match="cannot be locked: No locks available"), locked(tmp_path / "out"):
        pass


def test_a_first_artefact_that_cannot_be_put_in_place_leaves_none(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "sync_tree", lambda folder: None)
    with pytest.raises(FileNotFoundError):
        replace_folder(tmp_path / "none", tmp_path / "out")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "data, why",
    [
        ([1], "not a JSON object"),
        ({"files": {}}, "has no content hash"),
        ({"content": "x", "files": []}, "has no content hash"),
        ({"content": "x", "files": {"../y": "0"}}, "names a file outside its folder"),
    ],
)
def test_what_is_no_manifest_is_said(tmp_path, data, why):
    (tmp_path / MANIFEST).write_text(json.dumps(data))
    with pytest.raises(InputError, match=why):
        read_manifest(tmp_path)


def test_a_manifest_of_a_newer_format_is_not_guessed_at(tmp_path, monkeypatch):
    monkeypatch.setattr("cfem.core.artefact.manifest.FORMAT", 2)
    write_manifest(tmp_path, {"content": "x", "files": {}})
    monkeypatch.undo()
    with pytest.raises(InputError, match="has manifest format 2; this cfem reads 1"):
        read_manifest(tmp_path)
    with pytest.raises(InputError, match="no such artefact"):
        read_manifest(tmp_path / "none")


def test_a_folder_in_the_place_of_a_file_is_damage(tmp_path):
    (tmp_path / "numbers.bin").mkdir()
    write_manifest(tmp_path, {"content": "x", "files": {"numbers.bin": "0"}})
    (sentence,) = judge(tmp_path).damage
    assert "numbers.bin: is not a file" in sentence
    with pytest.raises(InputError, match="no such folder"):
        verify([tmp_path / "none"])
