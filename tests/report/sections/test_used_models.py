"""A page does not show a control run beside models that it did not use."""

import json

import pytest

from cfem.core.errors import InputError
from cfem.report.sections.used_models import demand_used


def artefact(folder, stage, content, inputs=None):
    folder.mkdir()
    inputs = inputs or {}
    paths = {name: f"../{path}" for name, (path, _) in inputs.items()}
    hashes = {name: content for name, (_, content) in inputs.items()}
    manifest = {"format": 1, "stage": stage, "content": content, "inputs": paths, "files": {}, "results": {}}
    (folder / "manifest.json").write_text(json.dumps({**manifest, "origin": {"inputs": hashes}}))
    return {**manifest, "origin": {"inputs": hashes}}


@pytest.fixture
def run(tmp_path, monkeypatch):
    """A run by the export of model 'trained', and its manifest."""
    monkeypatch.setattr("cfem.report.sections.used_models.read_manifest", lambda path: json.loads(manifest_of(path)))
    artefact(tmp_path / "exported", "export", "e1", {"model": ("trained", "t1")})
    return tmp_path / "run", artefact(tmp_path / "run", "control", "c1", {"model spectral": ("exported", "e1")})


def manifest_of(path):
    file = path / "manifest.json"
    if not file.exists():
        raise InputError("missing", where=str(path), do="")
    return file.read_text()


def test_the_export_of_a_shown_model_is_that_model(run):
    demand_used(*run, {"spectral": "t1"})
    demand_used(*run, {"other": "t9", "spectral": "t1"})
    demand_used(*run, {"spectral": "e1"})


def test_another_model_is_refused(run):
    with pytest.raises(InputError, match=r"used a model spectral that is not the one shown \(spectral\)"):
        demand_used(*run, {"spectral": "t2"})


def test_what_is_no_longer_there_says_nothing(run, tmp_path):
    (tmp_path / "exported" / "manifest.json").unlink()
    demand_used(*run, {"spectral": "t2"})
