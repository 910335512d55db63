"""The calibrated error of a model's contact, kept beside the model, as finite elements take a while to say it.

A file `contact-<key>.json` in the folder that the model's folder is in; its key is the content hash of all that it
depends on, as that of patches (`kept_patches`). It may be deleted at any time."""

from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cfem.condensed.model_error import ContactError
from cfem.core.artefact.content import artefact_content
from cfem.core.artefact.files import confined, content_sha256, read_json, write_json
from cfem.core.errors import DiskError, InputError
from cfem.core.reading import Data, checked

if TYPE_CHECKING:
    from cfem.predict.contact.surface.surface_model import SurfaceModel

VERSION = 5  # raised when the same inputs make another error


class KeptContactError(Data):
    """What a file holds: error of the model whose content this is, and whether the robot carried loads; none where no
    place told one."""

    model: str
    loaded: bool
    error: ContactError | None


def kept_contact_error(
    touched: "SurfaceModel",
    folder: Path,
    made_of: Mapping[str, Any],
    mu: float,
    places: int,
    solve: Callable[[], ContactError | None],
) -> ContactError | None:
    """Error of the contact of a model of `folder`, solved where nothing is kept; made_of: plain data from which its
    robot was made. None where no place told one."""
    model, patches = artefact_content(folder), touched.patches
    asked = {"model": model, "friction": mu, "places": places, "kind": type(touched).__name__}
    asked |= {"of": patches.of, "shares": patches.shares}
    key = content_sha256({"version": VERSION, "robot": dict(made_of), **asked})[:16]
    path = folder.parent / f"contact-{key}.json"
    kept = _read(path)
    if kept is None:
        kept = KeptContactError(model=model, loaded=bool(made_of.get("loads")), error=solve())
        with suppress(OSError, DiskError), confined(path.parent):  # else it is solved again next time
            write_json(path, kept.model_dump(mode="json"))
    return kept.error


def contact_errors(folder: Path) -> tuple[ContactError, ...]:
    """Errors of the contact of the model of a folder, without loads, that are kept beside it."""
    model = artefact_content(folder)
    kept = [_read(path) for path in sorted(folder.resolve().parent.glob("contact-*.json"))]
    return tuple(each.error for each in kept if each and each.error and each.model == model and not each.loaded)


def _read(path: Path) -> KeptContactError | None:
    """Content of the file, None where it is missing, damaged or of other fields."""
    if not path.is_file():
        return None
    try:
        return checked(KeptContactError, read_json(path), str(path), "delete it")
    except InputError:
        return None
