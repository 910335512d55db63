"""What an interrupted run leaves: it goes on, is kept, or is deleted where it is cheap; what others left stays."""

import os

import pytest

from cfem.core.artefact.stage_run import Stage
from cfem.core.artefact.unfinished import partial_folder
from cfem.core.errors import OutputError
from cfem.core.spec import Spec
from cfem.core.stage import Options, run_stage


class Empty(Spec):
    pass


def made(tmp_path, value, precious=True, name="out"):
    return Stage("count", 1, Empty(), {}, tmp_path / name, precious=precious, extra={"value": value})


def interrupt(tmp_path, value, seconds=0.0, precious=True, name="out"):
    """Work that ends `seconds` after it began."""

    def work(folder):
        (folder / "shard").write_text(str(value))
        later = os.stat(folder / "shard").st_mtime + seconds
        os.utime(folder / "shard", (later, later))
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_stage(made(tmp_path, value, precious, name), work, Options())


def finish(tmp_path, value, precious=True, name="out"):
    """What the work found in its folder."""
    seen = []

    def work(folder):
        seen.extend(path.read_text() for path in folder.iterdir())
        return {}

    run_stage(made(tmp_path, value, precious, name), work, Options(force=True))
    return seen


def test_unfinished_precious_work_of_other_inputs_is_moved_aside(tmp_path):
    for name, precious in (("dear", True), ("cheap", False)):
        interrupt(tmp_path, 1, 3600.0, precious, name)
        assert finish(tmp_path, 2, precious, name) == []
    assert [path.parent.name for path in tmp_path.glob("*/shard")] == ["dear.partial.old-1"]


def test_seconds_of_work_are_not_kept(tmp_path):
    for value in range(5):
        interrupt(tmp_path, value)
    assert [path.name for path in tmp_path.iterdir() if "old" in path.name] == []
    assert (partial_folder(tmp_path / "out") / "shard").read_text() == "4"


def test_work_that_was_moved_aside_goes_on_when_its_inputs_are_back(tmp_path, capsys):
    for value in (1, 2, 1, 2, 1):
        interrupt(tmp_path, value, 3600.0)
    aside = [path.name for path in tmp_path.iterdir() if ".partial.old" in path.name and path.is_dir()]
    assert len(aside) == 1
    assert "of the same inputs it goes on" in capsys.readouterr().err
    assert finish(tmp_path, 2) == ["2"] and finish(tmp_path, 1) == ["1"]
    assert {path.name for path in tmp_path.iterdir()} <= {"out", "out.old-1", ".out.lock"}


@pytest.mark.parametrize("mark", [None, "a note of somebody else"])
@pytest.mark.parametrize("force", [False, True])
def test_a_folder_of_others_at_the_place_of_the_work_is_not_deleted(tmp_path, mark, force):
    other = partial_folder(tmp_path / "out")
    other.mkdir()
    (other / "thesis.tex").write_text("years")
    if mark:
        (tmp_path / ".out.made_from").write_text(mark)
    with pytest.raises(OutputError, match=r"\.out\.partial: holds files that cfem did not make"):
        run_stage(made(tmp_path, 1), lambda folder: {}, Options(force=force))
    assert (other / "thesis.tex").read_text() == "years"
