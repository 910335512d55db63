"""The C sources that are the same for every robot, by part, and their way into a folder."""

import shutil
from pathlib import Path

from cfem.core.artefact.files import disk_errors

SOURCES = Path(__file__).parent / "sources"


def copy_sources(folder: Path, *parts: str) -> None:
    """Copies parts of `sources/`, folders or single files, into a folder, which is made if need be. Later parts replace
    files of the same name."""
    with disk_errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
        for part in parts:
            place = SOURCES / part
            for path in place.iterdir() if place.is_dir() else (place,):
                shutil.copyfile(path, folder / path.name)


def library_files(folder: Path) -> tuple[str, ...]:
    """Names of the C sources of a folder that belong on a target: all but programs."""
    return tuple(sorted(path.name for path in folder.glob("cfem_*.c")))
