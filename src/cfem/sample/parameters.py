"""Which numbers of a scene vary from row to row: from the keys and ranges that the user writes to Parameters, and
from values to scenes."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from cfem.condensed.parameters import Coordinate, Parameter
from cfem.core.errors import SpecError
from cfem.core.origin import key_path
from cfem.core.spec import Spec, load_spec
from cfem.core.units import unit_of
from cfem.robot.spec import SceneSpec
from cfem.sample.spec import ParameterSpec

# The rest of a scene makes the mesh, or names things.
_FREE = (
    "geometry", "shape", "material", "materials", "layers", "gravity", "loads", "actuators", "contacts", "effectors",
)  # fmt: skip
_PLACES = ("region", "faces")  # of what is on the mesh
Key = tuple[str | int, ...]


def scene_parameters(specs: Mapping[str, ParameterSpec], path: Path) -> tuple[Parameter, ...]:
    """Parameters as the scene at `path` has them. Raises SpecError, naming the parameter, where its key is none of a
    number that leaves the mesh alone, or its range none of values that the scene accepts there."""
    scene = load_spec(path, SceneSpec)
    layer = next((name for name, spec in specs.items() if spec.key.startswith("layers")), None)
    if layer and any(spec.key.startswith("geometry") for spec in specs.values()):
        what = "a layer cannot vary beside the geometry yet"
        raise SpecError(what, where=f"parameters.{layer}", do="vary one of them")
    return tuple(_parameter(name, spec, scene, path) for name, spec in specs.items())


def _parameter(name: str, spec: ParameterSpec, scene: SceneSpec, path: Path) -> Parameter:
    """Parameter as the scene has it. SpecError where its key is none of a number that leaves the mesh alone, or its
    range none of values that the scene accepts."""
    key, where = key_path(spec.key), f"parameters.{name}"
    if key[0] not in _FREE or any(part in key for part in _PLACES):
        what = f"key: '{spec.key}' changes the mesh, or nothing"
        raise SpecError(what, where=where, do=f"use a number under one of {', '.join(_FREE)}")
    if "reach" in key:
        what = f"key: '{spec.key}' changes no state of the robot, only which ones are asked for"
        raise SpecError(what, where=where, do="set the reach in the scene, once for all samples")
    reference, unit = _number(scene, key, where)
    ends = []
    for text in spec.ends:
        try:
            ends.append(_number(load_spec(path, SceneSpec, [f"{spec.key}={text}"]), key, where)[0])
        except SpecError as error:
            raise SpecError(f"range: {str(error).removeprefix('--set: ')}", where=where) from None
    if not ends[0] < ends[1]:
        raise SpecError("range: expected two different values, the smaller first", where=where)
    exact = spec.key in ("material.young", "material.stiffness") and not _has_other_forces(scene)
    return Parameter(name, spec.key, unit, *ends, reference, _coordinate(key), exact)


def is_of_motion(key: str) -> bool:
    """True of a number that matters to motion and to weight alone."""
    return "viscosity" in key or key.endswith("density")


def _has_other_forces(scene: SceneSpec) -> bool:
    """True where forces of the robot do not scale with the modulus of its body alone."""
    return bool(scene.materials or scene.layers or scene.loads or scene.gravity or scene.discrepancy)


def _coordinate(key: Key) -> Coordinate:
    return {"poisson": "log(1-2p)", "young": "log", "stiffness": "log"}.get(str(key[-1]), "linear")


def _number(scene: SceneSpec, key: Key, where: str) -> tuple[float, str]:
    """Value and unit of the number at `key`."""
    node, unit = scene, "1"
    for part in key:
        if isinstance(node, Spec) and part in type(node).model_fields:
            unit, node = unit_of(type(node).model_fields[part]), getattr(node, part)
        elif isinstance(node, list | np.ndarray) and isinstance(part, int) and part < len(node):
            node = node[part]
        else:
            node = None
    if not isinstance(node, int | float | np.floating) or isinstance(node, bool):
        text = ".".join(str(part) for part in key)
        raise SpecError(f"key: the scene has no number at '{text}'", where=where, do="give the path of a number")
    return float(node), unit


def with_values(scene: SceneSpec, keys: Sequence[str], p: np.ndarray) -> SceneSpec:
    """The scene with other numbers at `keys`."""
    for key, value in zip(keys, p, strict=True):
        scene = _replaced(scene, key_path(key), float(value))
    return scene


def _replaced(node, key: Key, value: float):
    """Copy of a node with `value` at a key path."""
    if not key:
        return value
    part, rest = key[0], key[1:]
    if isinstance(node, np.ndarray):
        changed = node.copy()
        changed[tuple(key)] = value
        return changed
    if isinstance(node, list):
        return [_replaced(item, rest, value) if index == part else item for index, item in enumerate(node)]
    return node.model_copy(update={part: _replaced(getattr(node, part), rest, value)})
