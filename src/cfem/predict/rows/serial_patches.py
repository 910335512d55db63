"""Forces on patches of modules in a row: which module bears each, and where in the frame at its base."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cfem.constraint.patch import PatchLoad
from cfem.predict.protocol import Predictor
from cfem.predict.rows.patches import RowPatches
from cfem.predict.rows.serial import SerialPredictor, module_arrays
from cfem.predict.series.skin import LearnedSkin


def row_patches(row: SerialPredictor, patches: Sequence[PatchLoad]) -> RowPatches | None:
    """Patches of a row, each borne by the module whose surface is nearest; None without any. InputError where a module
    has no skin, SpecError where a patch is not on it."""
    k = len(row.which)
    if not patches:
        return None
    surface, bases = row.surface, np.cumsum([np.zeros(3), *row.rests[:-1, :3]], axis=0)
    each: list[list[PatchLoad]] = [[] for _ in range(k)]
    for patch in patches:
        owner = int(surface.owner[np.argmin(np.linalg.norm(surface.rest - patch.at, axis=1))])
        each[owner].append(replace(patch, at=patch.at - bases[owner]))
    places = max(map(len, each))
    rests, forces = np.zeros((k, 3 * places)), np.zeros((k, 3 * places))
    for i, (mine, skin) in enumerate(zip(each, surface.modules, strict=True)):
        for j, patch in enumerate(mine):
            skin.modes_over([patch])  # it is on the surface, and free
            shares = patch.shares(skin.rest, skin.triangles, skin.weights)
            rests[i, 3 * j : 3 * j + 3], forces[i, 3 * j : 3 * j + 3] = shares @ skin.rest, patch.force
    return RowPatches(tuple(map(tuple, each)), surface.modules, places, rests, forces)


def with_skins(arrays: dict[str, np.ndarray], skins: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The arrays of a row, and those of its models' skins, for `skins_within`."""
    return arrays | {name.replace(".", ".skin.", 1): array for name, array in skins.items()}


def skins_within(models: Sequence[Predictor], arrays: dict[str, np.ndarray]) -> list[LearnedSkin]:
    skins = []
    for number, model in enumerate(models):
        mine = {
            name.removeprefix("skin."): a for name, a in module_arrays(arrays, number).items() if name[:5] == "skin."
        }
        skins.append(LearnedSkin(model.form, model.rows.n_e, model.rows.n_a, model.n_inputs, mine))
    return skins
