"""How the patches of a model's skin yield, kept beside the model, as finite elements take a while to say it.

A file `patches-<key>.npz` in the folder that the model's folder is in; its key is the content hash of all that it
depends on, so that it is never stale, and models of the same samples share it. It may be deleted at any time."""

from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from cfem.condensed.patches import Patches
from cfem.core.errors import DiskError, InputError
from cfem.core.files import confined, content_sha256, write_npz
from cfem.core.progress import doing
from cfem.core.reading import read_npz, take
from cfem.equilibrium.patch_compliance import patch_compliance
from cfem.equilibrium.robot import Robot
from cfem.predict.protocol import Predictor
from cfem.predict.touchable import Touchable, patches_of, touch_states

VERSION = 1  # raised when the same inputs yield otherwise


def touchable_of(
    model: Predictor, folder: Path, robot: Robot, made_of: Mapping[str, Any], apart: float | None
) -> Touchable:
    """A model, of `folder`, that may be touched at patches about `apart` mm from each other. made_of: plain data from
    which the robot was made. Finite elements are solved where nothing is kept."""
    patches, nodes = patches_of(model, apart), model.skin.nodes
    states = touch_states(model.domain, robot.rows.n_a)
    asked = {"nodes": nodes, "of": patches.of, "shares": patches.shares, "states": states}
    key = content_sha256({"version": VERSION, "robot": dict(made_of), **asked})[:16]
    path = folder.parent / f"patches-{key}.npz"
    own = _kept(path, patches, states)
    if own is None:
        doing(f"solving how {len(patches)} patches of the surface yield, at {len(states)} states")
        own = patch_compliance(robot, nodes, patches, states)
        with suppress(OSError, DiskError), confined(path.parent):  # else it is solved again next time
            write_npz(path, {"own": own})
    return Touchable(model, patches, states, own)


def _kept(path: Path, patches: Patches, states: np.ndarray) -> np.ndarray | None:
    """(J, 3 N, 3 N) mm/N, None where there is no file, or a damaged one."""
    if not path.is_file():
        return None
    n = 3 * len(patches)
    try:
        own = take(read_npz(path), "own", (len(states), n, n))
    except InputError:
        return None
    return own if np.isfinite(own).all() else None
