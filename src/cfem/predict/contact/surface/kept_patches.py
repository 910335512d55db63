"""How patches of a model's skin yield, kept beside the model, as finite elements take a while to say it.

A file `patches-<key>.npz` or `nodes-<key>.npz`, of contact, or `loads-<key>.npz` in the folder that the model's folder
is in; its key is the content hash of all that it depends on, so that it is never stale, and models of the same samples
share it. It may be deleted at any time."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from cfem.condensed.patches import Patches, SurfacePoints
from cfem.constraint.patch import PatchLoad
from cfem.constraint.surface import outer_surface
from cfem.constraint.surface_points import at_nodes
from cfem.core.artefact.files import confined, content_sha256, write_npz
from cfem.core.errors import DiskError, InputError
from cfem.core.reading import read_npz
from cfem.equilibrium.contact.node_compliance import NodeResponse, node_response
from cfem.equilibrium.contact.patch_compliance import PatchResponse, patch_response
from cfem.equilibrium.contact.patch_effectors import PatchYield, patch_yield
from cfem.equilibrium.system.robot import Robot
from cfem.predict.contact.surface.node_model import DENTED, MODES, NEAR, NodeModel, node_patches
from cfem.predict.contact.surface.patched_model import PatchedModel, patches_of
from cfem.predict.contact.surface.surface_model import SurfaceModel
from cfem.predict.kinds.spectral import SpectralPredictor
from cfem.predict.protocol import Predictor
from cfem.predict.series.few_states import linear_states, patch_states

VERSION = 5  # raised when the same inputs yield otherwise
T = TypeVar("T")


def patched_model_of(
    model: Predictor,
    folder: Path,
    robot: Robot,
    made_of: Mapping[str, Any],
    apart: float | None,
    sharp_edges: bool = False,
) -> PatchedModel:
    """A model, of `folder`, that may be touched at patches about `apart` mm from each other (`patches_of`). made_of:
    plain data from which the robot was made. Finite elements are solved where nothing is kept."""
    patches, skin = patches_of(model, apart, sharp_edges), model.skin
    states = patch_states(model.domain, robot.rows.n_a)
    asked = {"nodes": skin.nodes, "of": patches.of, "shares": patches.shares, "states": states, "modes": skin.modes}
    solve = partial(patch_response, robot, skin.watched, patches, states)
    return PatchedModel(model, patches, _kept(folder, "patches", made_of, asked, PatchResponse, solve))


def node_model_of(model: Predictor, folder: Path, robot: Robot, made_of: Mapping[str, Any]) -> NodeModel:
    """Model that may be touched at every node of its surface."""
    skin, states = model.skin, patch_states(model.domain, robot.rows.n_a)
    local, near, denting = linear_states(model.domain, states), NEAR * model.length, DENTED * model.length
    asked = {"nodes": skin.nodes, "states": states, "local": local, "skin": skin.modes, "modes": MODES}
    asked |= {"near": near, "denting": denting}

    def solve() -> NodeResponse:
        return node_response(robot, skin.watched, states, local, MODES, near, denting).rounded()

    return NodeModel(model, node_patches(model), _kept(folder, "nodes", made_of, asked, NodeResponse, solve))


def fe_points(touched: SurfaceModel, robot: Robot) -> Patches | SurfacePoints:
    """Points by which the finite elements touch where the model does."""
    if not isinstance(touched, NodeModel):
        return touched.patches
    facets = robot.body.mesh.facets
    return at_nodes(robot.X, facets, outer_surface(robot.X, facets))


def yield_of(
    model: Predictor, folder: Path, robot: Robot, made_of: Mapping[str, Any], patches: Sequence[PatchLoad]
) -> PatchYield | None:
    """Response of the patches to forces by finite elements, whatever the forces are. robot: without loads; None where
    few states do not tell it: the model is of form force or has parameters. SpecError where a patch is not on the
    surface."""
    if not isinstance(model, SpectralPredictor) or model.form != "displacement" or model.parameters:
        return None
    model.skin.modes_over(patches)  # says what is wrong, before finite elements take a while
    states = patch_states(model.domain, robot.rows.n_a)
    regions = [[*patch.at, patch.radius] for patch in patches]
    asked = {"states": states, "where": np.array(regions), "effectors": robot.rows.effectors}
    return _kept(folder, "loads", made_of, asked, PatchYield, partial(patch_yield, robot, patches, states))


def _kept(
    folder: Path, name: str, made_of: Mapping[str, Any], asked: Mapping[str, Any], kind: type[T], solve: Callable[[], T]
) -> T:
    """Content of the file beside the model's folder, solved again where there is none or a damaged one."""
    key = content_sha256({"version": VERSION, "robot": dict(made_of), **asked})[:16]
    path = folder.parent / f"{name}-{key}.npz"
    result = _read(path, kind)
    if result is None:
        result = solve()
        with suppress(OSError, DiskError), confined(path.parent):  # else it is solved again next time
            write_npz(path, vars(result))
    return result


def _read(path: Path, kind: type[T]) -> T | None:
    """Content of the file, None where it is missing, damaged or of other fields."""
    if not path.is_file():
        return None
    try:
        arrays = read_npz(path)
    except InputError:
        return None
    names = kind.__dataclass_fields__
    return kind(**{name: arrays[name] for name in names}) if names.keys() == arrays.keys() else None
