"""Compiled code is kept where it can be: beside the package, in the user's caches, or in a private temporary folder."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import cfem
from cfem.core.cache import cache_folder

NOWHERE = "/proc/nothing"


def test_the_users_cache_folder_comes_first(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_folder() == tmp_path / "cfem"


def test_without_one_a_private_temporary_folder_serves(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", NOWHERE)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    folder = cache_folder()
    assert folder.parent == tmp_path and folder.stat().st_mode & 0o777 == 0o700


def test_a_temporary_folder_that_others_may_write_to_does_not_serve(tmp_path, monkeypatch):
    """Whoever writes there has their code run."""
    monkeypatch.setenv("XDG_CACHE_HOME", NOWHERE)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    folder = tmp_path / f"cfem-{os.getuid()}"
    folder.mkdir()
    folder.chmod(0o777)
    assert cache_folder() is None
    folder.rmdir()
    (tmp_path / "other").mkdir(mode=0o700)
    folder.symlink_to(tmp_path / "other")
    assert cache_folder() is None


def test_kernels_compile_where_neither_package_nor_home_can_be_written_to(tmp_path):
    """Files where numba would make folders: what root is refused too."""
    source = Path(cfem.__file__).parent
    for part in ("core", "mechanics"):
        shutil.copytree(source / part, tmp_path / "cfem" / part)
    shutil.copy(source / "__init__.py", tmp_path / "cfem")
    for folder in (tmp_path / "cfem" / "mechanics", tmp_path / "cfem" / "mechanics" / "material"):
        shutil.rmtree(folder / "__pycache__", ignore_errors=True)
        (folder / "__pycache__").touch()
    (tmp_path / "temporary").mkdir()
    environment = {key: value for key, value in os.environ.items() if key != "NUMBA_CACHE_DIR"}
    environment |= {"HOME": NOWHERE, "XDG_CACHE_HOME": NOWHERE, "TMPDIR": str(tmp_path / "temporary")}
    environment |= {"PYTHONPATH": str(tmp_path), "PYTHONDONTWRITEBYTECODE": "1"}
    code = "import cfem, cfem.mechanics.material.tensor; print(cfem.__file__)"
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "") and done.stdout.startswith(str(tmp_path))


def test_machine_code_of_other_sources_is_not_run(tmp_path):
    """A function whose own file is as it was, and that calls one whose file has changed."""
    package = tmp_path / "kernels"
    package.mkdir()
    (package / "__init__.py").write_text(
        "from pathlib import Path\nfrom cfem.core.cache import place_compiled_code\n"
        "place_compiled_code(Path(__file__).parent)\n"
    )
    (package / "outer.py").write_text(
        "from numba import njit\nfrom kernels.inner import inner\n\n"
        "@njit(cache=True)\ndef outer():\n    return inner()\n"
    )
    environment = {key: value for key, value in os.environ.items() if key != "NUMBA_CACHE_DIR"}
    environment["PYTHONPATH"] = str(tmp_path)
    code = "from kernels.outer import outer; print(outer(), sum(outer.stats.cache_hits.values()))"
    said = []
    for value in (1, 1, 22):
        (package / "inner.py").write_text(f"from numba import njit\n\n@njit\ndef inner():\n    return {value}\n")
        done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
        said.append(done.stdout.strip())
    assert said == ["1 0", "1 1", "22 0"]
