"""How the patches of a model's skin yield, kept beside the model, as finite elements take a while to say it.

A file `patches-<key>.npz` in the folder that the model's folder is in; its key is the content hash of all that it
depends on, so that it is never stale, and models of the same samples share it. It may be deleted at any time."""

from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from cfem.core.errors import DiskError, InputError
from cfem.core.files import confined, content_sha256, write_npz
from cfem.core.progress import doing
from cfem.core.reading import read_npz
from cfem.equilibrium.patch_compliance import PatchResponse, patch_response
from cfem.equilibrium.robot import Robot
from cfem.predict.protocol import Predictor
from cfem.predict.touchable import Touchable, patches_of, touch_states

VERSION = 4  # raised when the same inputs yield otherwise


def touchable_of(
    model: Predictor, folder: Path, robot: Robot, made_of: Mapping[str, Any], apart: float | None
) -> Touchable:
    """A model, of `folder`, that may be touched at patches about `apart` mm from each other. made_of: plain data from
    which the robot was made. Finite elements are solved where nothing is kept."""
    patches, own = patches_of(model, apart), model.skin
    states = touch_states(model.domain, robot.rows.n_a)
    asked = {"nodes": own.nodes, "of": patches.of, "shares": patches.shares, "states": states, "modes": own.modes}
    key = content_sha256({"version": VERSION, "robot": dict(made_of), **asked})[:16]
    path = folder.parent / f"patches-{key}.npz"
    found = _kept(path)
    if found is None:
        doing(f"solving how {len(patches)} patches of the surface yield, at {len(states)} states")
        found = patch_response(robot, own.watched, patches, states)
        with suppress(OSError, DiskError), confined(path.parent):  # else it is solved again next time
            write_npz(path, vars(found))
    return Touchable(model, patches, found)


def _kept(path: Path) -> PatchResponse | None:
    """None where there is no file, or a damaged one."""
    if not path.is_file():
        return None
    try:
        arrays = read_npz(path)
    except InputError:
        return None
    names = PatchResponse.__dataclass_fields__
    return PatchResponse(**{name: arrays[name] for name in names}) if names.keys() == arrays.keys() else None
