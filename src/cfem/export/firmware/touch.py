"""Contact anywhere in C: cfem_touch.c, the same for every robot, and its numbers, cfem_touch_data.c."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from cfem.condensed.packing import packed_indices
from cfem.contact.obstacle import Obstacle, Rounded
from cfem.core.errors import InputError
from cfem.export.firmware import c_text
from cfem.export.firmware.copying import copy_sources
from cfem.predict.contact.surface.patched_model import PatchedModel

UPPER = np.triu_indices(3)
MOST = 30  # patches that may touch at once


def write_c_touch(
    folder: Path,
    patched: PatchedModel,
    obstacles: Sequence[Obstacle],
    friction: float,
    unilateral: np.ndarray,
    robots: int = 0,
    most: int = MOST,
) -> int:
    """Adds contact to the C folder of a model; the bytes of its constants. unilateral (n_a,) bool: actuators that only
    pull; robots: that meet, 0 where only obstacles do; most: patches that may touch at once. InputError where an
    obstacle is a mesh."""
    copy_sources(folder, "touch")
    constants = touch_constants(patched) | {"unilateral": np.asarray(unilateral, np.uint8)}
    sizes = {
        "CFEM_PATCHES": len(patched.patches),
        "CFEM_TOUCH_MOST": most,
        "CFEM_TOUCH_ROBOTS": max(robots, 1),
        "CFEM_TOUCH_SOFT": int(robots > 0),
        "CFEM_PATCH_ROWS": len(patched.model.skin),
        "CFEM_PATCH_TERMS": len(constants["degrees"]),
        "CFEM_PATCH_COMPLIANCE_TERMS": len(constants["compliance_degrees"]),
        "CFEM_PATCH_LOCAL_TERMS": len(constants["local_degrees"]),
        "CFEM_PATCH_BENDS": constants["bends"].shape[1],
        "CFEM_PATCH_BENT": constants["bent"].shape[1],
        "CFEM_PATCH_DEGREE": int(max(constants[name].max(initial=1) for name in ("degrees", "compliance_degrees"))),
        "CFEM_PATCH_MISSING": repr(patched.missing),
        "CFEM_PATCH_LENGTH": repr(float(patched.model.length)),
        "CFEM_TOUCH_OBSTACLES": len(obstacles),
        "CFEM_TOUCH_FRICTION": repr(float(friction)),
    }
    heading = "/* The robot's surface and what it touches: by cfem export. Units: mm, N. */"
    declared = '#include "cfem.h"\n#include "cfem_obstacle.h"\n\n'
    declared += f"extern const cfem_obstacle cfem_obstacles[{max(len(obstacles), 1)}];\n"
    rows = ",\n".join(map(_obstacle, obstacles))
    rows = rows or "{{{0}}, {0}, {0}, 0.0, 0}"  # C has no empty arrays
    defined = '#include "cfem_touch.h"\n\nconst unsigned long cfem_touch_room_size = sizeof(cfem_touch_room);\n'
    defined += f"const cfem_obstacle cfem_obstacles[] = {{{rows}}};\n"
    file = folder / "cfem_touch_data"
    return c_text.write_constants(file, heading, sizes, "cfem_patch_", constants, declared, defined)


def touch_constants(patched: PatchedModel) -> dict[str, np.ndarray]:
    """Arrays that the patches need of the skin, and series of what its modes leave: of pairs p <= q, row by row."""
    skin, N = patched.model.skin, len(patched.patches)
    arrays, (spread, by_row) = skin.arrays, patched.spread
    p, q = np.triu_indices(N)
    local = patched.local[p, q].reshape(len(p), len(patched.degrees), 9)
    (a, b, c), padding = packed_indices(3, 3), -patched.bent.shape[1] % 4  # vectors of a processor
    return {
        "to_box": np.asarray(arrays["to_box"], float),
        "offset": np.asarray(arrays["offset"], float),
        "degrees": arrays["indices"].astype(np.uint8),
        "series": np.ascontiguousarray(arrays["series"].T, dtype=float),
        "compliance_degrees": arrays["compliance_indices"].astype(np.uint8),
        "compliance": np.ascontiguousarray(arrays["compliance"].T, dtype=float),
        "local_degrees": patched.degrees.astype(np.uint8),
        "local": local.astype(np.float32),
        "dented": np.ascontiguousarray(patched.dented[:, :, a, b, c].swapaxes(0, 1), dtype=np.float32),
        "dented_tip": np.ascontiguousarray(
            patched.dented[:, :, UPPER[0], UPPER[1], 3:].transpose(1, 0, 3, 2), dtype=np.float32
        ),
        "local_tip": np.ascontiguousarray(patched.local_tip.transpose(2, 0, 1, 3)),
        "bent": np.pad(patched.bent, [(0, 0), (0, padding)]).astype(np.float32),
        "bends": patched.bends,
        "bending": patched.U @ patched.bends,
        "held": patched.held_still.astype(np.uint8),
        "box": np.asarray(patched.model.domain.delta_a, float),
        "reach": np.abs(patched.model.reach).max(axis=1),
        "rest": patched.patches.rest,
        "modes": patched.U,
        "spread": spread.reshape(N, 9),
        "spread_by_row": np.ascontiguousarray(by_row.reshape(-1, N, 9).transpose(1, 2, 0)),
    }


def _obstacle(obstacle: Obstacle) -> str:
    if not isinstance(obstacle, Rounded):
        what = "closed meshes have no C code"
        raise InputError(what, where="c.obstacles", do="take planes, spheres, boxes and capsules")
    R, t, core = (c_text.braces(np.asarray(values, float)) for values in (obstacle.R, obstacle.t, obstacle.core))
    return f"{{{R}, {t}, {core}, {c_text.number(obstacle.rounding, 'double')}, {int(np.isinf(obstacle.core[0]))}}}"
