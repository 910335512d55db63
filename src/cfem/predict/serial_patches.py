"""Forces on patches of modules in a row: which module bears each, and where in the frame at its base."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cfem.constraint.patch import PatchLoad
from cfem.predict.loaded_rows import on_modes
from cfem.predict.protocol import Predictor
from cfem.predict.serial import SerialPredictor, module_arrays
from cfem.predict.skin import LearnedSkin


@dataclass(frozen=True)
class RowPatches:
    """each (k,): patches of each module, in the frame at its base, and its skin in skins (k,); places: most of any
    module. rests (k, 3 places) mm in that frame, forces (k, 3 places) N in that of the whole, 0 where a module has
    fewer."""

    each: tuple[tuple[PatchLoad, ...], ...]
    skins: tuple[LearnedSkin, ...]
    places: int
    rests: np.ndarray
    forces: np.ndarray

    @classmethod
    def none(cls, k: int) -> "RowPatches":
        return cls(((),) * k, (), 0, np.zeros((k, 0)), np.zeros((k, 0)))


def row_patches(row: SerialPredictor, patches: Sequence[PatchLoad]) -> RowPatches | None:
    """A patch is borne by the module whose surface is nearest; None without any. InputError where a module has no
    skin, SpecError where a patch is not on it."""
    k = len(row.which)
    if not patches:
        return None
    whole, bases = row.surface, np.cumsum([np.zeros(3), *row.rests[:-1, :3]], axis=0)
    each: list[list[PatchLoad]] = [[] for _ in range(k)]
    for one in patches:
        owner = int(whole.owner[np.argmin(np.linalg.norm(whole.rest - one.at, axis=1))])
        each[owner].append(replace(one, at=one.at - bases[owner]))
    places = max(map(len, each))
    rests, forces = np.zeros((k, 3 * places)), np.zeros((k, 3 * places))
    for i, (mine, skin) in enumerate(zip(each, whole.modules, strict=True)):
        for j, one in enumerate(mine):
            on_modes(skin, [one])  # it is on the surface, and free
            shares = one.shares(skin.rest, skin.triangles, skin.weights)
            rests[i, 3 * j : 3 * j + 3], forces[i, 3 * j : 3 * j + 3] = shares @ skin.rest, one.force
    return RowPatches(tuple(map(tuple, each)), whole.modules, places, rests, forces)


def with_skins(arrays: dict[str, np.ndarray], skins: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The arrays of a row, and those of its models' skins, for `skins_within`."""
    return arrays | {name.replace(".", ".skin.", 1): one for name, one in skins.items()}


def skins_within(models: Sequence[Predictor], arrays: dict[str, np.ndarray]) -> list[LearnedSkin]:
    found = []
    for number, one in enumerate(models):
        mine = {
            name.removeprefix("skin."): a for name, a in module_arrays(arrays, number).items() if name[:5] == "skin."
        }
        found.append(LearnedSkin(one.form, one.rows.n_e, one.rows.n_a, one.n_inputs, mine))
    return found
