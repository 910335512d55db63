"""Pages of `cfem init` do not pile up."""

import os

from cfem.cli.init import page_folder


def test_of_all_pages_the_latest_five_stay(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    kept = [tmp_path / "cfem-init-note", tmp_path / "cfem-init-link", tmp_path / "cfem-other"]
    kept[0].write_text("a file")
    kept[2].mkdir()
    kept[1].symlink_to(kept[2])
    folders = []
    for age in range(20, 0, -1):
        folders.append(page_folder())
        (folders[-1] / "own.html").touch()
        os.utime(folders[-1], (1e9 - age, 1e9 - age))
    assert {*tmp_path.iterdir()} == {*kept, *folders[-5:]}
