"""What was set aside is told with its size; what is dear stays, and what cfem did not make alone stays always."""

import json
import os

import pytest
from typer.testing import CliRunner

from cfem.cli.app import app
from cfem.core.artefact.files import locked
from cfem.core.artefact.stage_run import Stage
from cfem.core.spec import Spec
from cfem.core.stage import Options, run_stage


class Empty(Spec):
    pass


def make(out, value, force=True, precious=True, seconds=0.0):
    def work(folder):
        (folder / "rows.txt").write_text(value * 1000)
        if seconds:
            later = os.stat(folder / "rows.txt").st_mtime + seconds
            os.utime(folder / "rows.txt", (later, later))
            raise KeyboardInterrupt
        return {}

    stage = Stage("sample", 1, Empty(), {}, out, precious=precious, extra={"value": value})
    run_stage(stage, work, Options(force=force))


@pytest.fixture
def data(tmp_path):
    """A dataset that was made anew twice, the last time as at first; one that a person wrote into; unfinished work."""
    samples = tmp_path / "data" / "bar" / "samples"
    for value in "aba":
        make(samples, value)
    noted = tmp_path / "data" / "noted" / "samples"
    make(noted, "a")
    (noted / "notes.txt").write_text("mine")
    make(noted, "b")
    begun = tmp_path / "data" / "begun" / "samples"
    with pytest.raises(KeyboardInterrupt):
        make(begun, "a", seconds=100.0)
    make(begun, "b")
    return tmp_path / "data"


def run(data, *words):
    result = CliRunner().invoke(app, ["clean", str(data), *words])
    assert result.exit_code == 0, result.output
    return result.output


def left(data):
    return sorted(path.relative_to(data).as_posix() for path in data.rglob("*.old-*") if not path.name.startswith("."))


ALL = ["bar/samples.old-1", "bar/samples.old-2", "begun/samples.partial.old-1", "noted/samples.old-1"]


def test_it_tells_and_deletes_nothing(data):
    said = run(data)
    assert left(data) == ALL
    assert "would delete: the same is in samples" in said and "notes.txt" in said
    assert "goes on when its spec is back" in said and "sample took" in said
    told = json.loads(run(data, "--json"))
    assert [each["worth"] for each in told["set_aside"]] == ["copy", "costly", "costly", "yours"]
    assert told["bytes"] == sum(each["bytes"] for each in told["set_aside"]) > 3000
    assert not any(each["deleted"] for each in told["set_aside"])


def test_a_copy_is_deleted_and_what_is_dear_only_on_demand(data):
    assert "deleted: the same is in samples" in run(data, "--delete")
    assert left(data) == ALL[1:]
    run(data, "--delete", "--dear")
    assert left(data) == ALL[3:]
    assert not list(data.rglob(".*.made_from"))
    assert (data / "noted" / "samples.old-1" / "notes.txt").read_text() == "mine"


def test_unfinished_work_that_no_command_works_on_is_told_and_dear(tmp_path):
    out = tmp_path / "data" / "killed" / "samples"
    with pytest.raises(KeyboardInterrupt):
        make(out, "a", seconds=1.0)
    own, foreign = out.with_name(".samples.partial"), out.with_name(".thesis.partial")
    foreign.mkdir()
    (foreign / "chapter.tex").write_text("years")
    with locked(out):
        assert run(tmp_path).strip() == "nothing is set aside"
    said = run(tmp_path, "--delete")
    assert "keeps: unfinished work" in said and "1 kB more with --delete --dear" in said and own.is_dir()
    run(tmp_path, "--delete", "--dear")
    assert not own.exists() and not out.with_name(".samples.made_from").exists() and foreign.is_dir()


def test_a_copy_of_what_is_damaged_stays(data):
    (data / "bar" / "samples" / "rows.txt").write_text("damaged")
    run(data, "--delete")
    assert left(data) == ALL


def test_a_folder_whose_name_only_looks_alike_stays(tmp_path):
    (tmp_path / "thesis.old-1").mkdir()
    (tmp_path / "thesis.old-1" / "chapter.tex").write_text("years")
    assert "keeps: cfem did not make it" in run(tmp_path, "--delete", "--dear")
    assert (tmp_path / "thesis.old-1" / "chapter.tex").is_file()


def test_nothing_is_set_aside(tmp_path):
    assert run(tmp_path).strip() == "nothing is set aside"
    assert CliRunner().invoke(app, ["clean", str(tmp_path / "none")]).exit_code == 3
