"""Soft obstacles in C: cfem_meet.c, robots of the exported model that touch each other and themselves, and its numbers,
cfem_meet_data.c."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.sparse import coo_array

from cfem.contact.detection import may_meet
from cfem.contact.pairs import APART
from cfem.core.artefact.files import write_whole
from cfem.export.firmware import c_text
from cfem.export.firmware.copying import copy_sources
from cfem.predict.contact.step.bodies import PlacedModel
from cfem.predict.contact.step.scene import ContactScene
from cfem.predict.contact.step.state import ContactState
from cfem.predict.contact.surface.patched_model import PatchedModel

MOST = 48  # patches of one robot that may touch at once, and be touched
TOLERANCE = 1e-8  # of the largest number of effectors, and of actuators, of the way in meet.c


def write_c_meet(folder: Path, robots: Sequence[PlacedModel]) -> int:
    """Adds the meeting of robots, all of one model, to a C folder that holds contact; the bytes of its constants."""
    copy_sources(folder, "meet")
    patched = robots[0].patched
    sizes = {"CFEM_MEET_ROBOTS": len(robots), "CFEM_MEET_SPACING": repr(float(patched.patches.spacing))}
    rows = ",\n".join(
        f"{{{c_text.braces(robot.R)}, {c_text.braces(robot.t)}, {int(robot.itself)}, {c_text.braces(np.uint8(pulls))}}}"
        for robot, pulls in zip(robots, np.split(ContactScene(robots).unilateral, len(robots)), strict=True)
    )
    defined = f'#include "cfem_meet.h"\n\nconst cfem_placed cfem_robots[] = {{{rows}}};\n'
    sizes_of = "sizeof(cfem_met), sizeof(cfem_meet_room), CFEM_MEET_ROBOTS"
    defined += f"const unsigned long cfem_meet_sizes[] = {{{sizes_of}}};\n"
    heading = "/* Robots that meet: by cfem export. Units: mm, N. */"
    constants = {"area": areas(patched), "itself": self_pairs(patched)}
    return c_text.write_constants(folder / "cfem_meet_data", heading, sizes, "cfem_meet_", constants, "", defined)


def write_states(folder: Path, states: Sequence[ContactState]) -> None:
    """cfem_meet_vectors.h: states one after the other, for meet.c."""
    names = ("deltas", "delta_e", "lambda_a")
    arrays = [[np.concatenate(getattr(state, name)) for name in names] for state in states]
    sizes = zip(("delta_a", *names[1:]), arrays[0], strict=True)
    fields = "".join(f" double {name}[{len(values)}];" for name, values in sizes)
    rows = ",\n".join("{" + ", ".join(map(c_text.braces, row)) + "}" for row in arrays)
    words = {"CFEM_MEET_VECTORS": len(states), "CFEM_MEET_TOLERANCE": TOLERANCE}
    words |= {f"CFEM_MEET_{name.upper()}": repr(float(scale(states, name))) for name in names[1:]}
    heading = "/* Robots that meet in Python, step by step: by cfem export. */\n"
    text = f'{heading}#include "cfem_meet.h"\n\n{c_text.defines(words)}\n'
    text += f"typedef struct {{{fields} }} cfem_meet_vector;\n\nstatic const cfem_meet_vector vectors[] = {{{rows}}};\n"
    write_whole(folder / "cfem_meet_vectors.h", text.encode())


def scale(states: Sequence[ContactState], name: str) -> float:
    """The largest number of an array, or of a list of arrays, of states."""
    return max(float(np.abs(np.concatenate(getattr(state, name))).max()) for state in states)


def self_pairs(patched: PatchedModel) -> np.ndarray:
    """Codes (N, N) of the patches of one robot that may meet: see `cfem.contact.detection.may_meet`."""
    region, along = patched.regions
    return may_meet([along], [APART * patched.model.length])[np.ix_(region, region)].astype(np.uint8)


def areas(patched: PatchedModel) -> np.ndarray:
    """Area forms (N, 3, (k + 1) (k + 2) / 2) mm^2: twice the area of each patch as a vector, a quadratic form of (1,
    rows), whose entries i <= j stand row by row; see `cfem.contact.surface.triangles.mean_normals`."""
    skin, patch_of = patched.model.skin, patched.patches.of
    a, b, c = (np.concatenate([skin.rest[None], skin.modes])[:, corner] for corner in skin.triangles.T)
    count, each = len(skin.triangles), np.arange(3 * len(skin.triangles)) % len(skin.triangles)
    belongs = coo_array(
        (np.ones(3 * count), (patch_of[skin.triangles.T].ravel(), each)), shape=(len(patched.patches), count)
    )
    first, second = b - a, c - a
    pairs = [(i, j) for i in range(len(a)) for j in range(i, len(a))]
    products = [np.cross(first[i], second[j]) + (np.cross(first[j], second[i]) if i != j else 0.0) for i, j in pairs]
    return np.stack([belongs.tocsr() @ product for product in products], axis=2)
