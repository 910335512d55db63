"""The C sources that are the same for every robot, by part, and their way into a folder."""

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
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


def target_files(folder: Path) -> tuple[str, ...]:
    """Names of the C sources and headers of a folder that belong on a target: neither programs nor their vectors."""
    headers = (path.name for path in folder.glob("cfem*.h") if not path.name.endswith("_vectors.h"))
    return (*library_files(folder), *sorted(headers))


@contextmanager
def lasting_or_not(folder: Path, lasts: bool) -> Iterator[Path]:
    """The folder, or one of the same name beside it that goes when the context ends."""
    if lasts:
        yield folder
        return
    with tempfile.TemporaryDirectory(dir=folder.parent, ignore_cleanup_errors=True) as place:
        yield Path(place) / folder.name
