"""The calibrated robot as a scene, for models and controllers: the found numbers in their places, and what finite
elements lack at its effectors."""

import json
import os
import re
from pathlib import Path
from typing import Any

import numpy as np

from cfem.core.spec import set_key
from cfem.core.units import written
from cfem.core.yaml import read_yaml
from cfem.equilibrium.solve import Wanted, solve
from cfem.equilibrium.system.actuation import force
from cfem.equilibrium.system.problem import Problem
from cfem.identify.cases.fit import CaseFit
from cfem.identify.cases.load import Lab
from cfem.identify.cases.rig import Rig
from cfem.mechanics.mesh import Mesh
from cfem.robot.build import build_robot
from cfem.robot.spec import SceneSpec

FILE = "scene.yaml"
_WIDTH = 110  # characters of a line
_WORDS = "true|false|null|yes|no|on|off"  # that YAML takes for something else than text
_QUOTED = re.compile(rf"[^\w .%^/+-]|^[\s+-]|\s$|^$|^[\d.]+(e[+-]?\d+)?$|^({_WORDS})$", re.IGNORECASE)


def calibrated_scene(lab: Lab, rig: Rig, fitted: CaseFit, folder: Path, mesh: Path) -> tuple[str, list[str]]:
    """The scene with the values of a fit, as the text of a file in `folder`, and sentences on what it leaves out.

    mesh: folder of the robot's mesh; another shape gets a mesh of its own beside it"""
    data, lines = read_yaml(lab.scene_path)
    _relocate(data, lab.scene_path.parent, folder)
    moved = any(key.split(".")[0] in ("geometry", "shape") for unknown in rig.unknowns for key in unknown.keys)
    data["out"] = os.path.relpath(mesh.with_name(f"{mesh.name}-calibrated") if moved else mesh, folder)
    for unknown, z in zip(rig.unknowns, fitted.z, strict=True):
        for key in unknown.keys if unknown.of_scene else ():
            value, unit = unknown.value(z), unknown.parameter.unit
            set_key(data, lines, f"{key}={value!r}" if unit == "1" else f"{key}={written(value, unit)}")
    missing = _rig_in_words(rig, fitted)
    if rig.discrepancy is not None:
        scales, why = _scales(rig, fitted)
        if why:
            missing.append(f"{FILE} has no discrepancy: {why}")
        else:
            data["discrepancy"] = _discrepancy(lab, rig, fitted, scales)
            if [effector.pop("orientation") for effector in data["effectors"] if "orientation" in effector]:
                missing.append("orientations of effectors are left out: the discrepancy says nothing about them")
            missing += _within_calibration(data, lab.mesh)
    head = "# The robot as `cfem calibrate-cases` found it. Each run overwrites this file: copy it, then change it.\n"
    return head + "".join(f"# {sentence}\n" for sentence in missing) + _text(data), missing


def _relocate(node: Any, base: Path, folder: Path) -> None:
    """Makes each `path` of a scene in `base` relative to `folder`."""
    for key, value in node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ():
        if key == "path" and isinstance(value, str):
            node[key] = os.path.relpath(base / value, folder)
        else:
            _relocate(value, base, folder)


def _rig_in_words(rig: Rig, fitted: CaseFit) -> list[str]:
    """Sentences on drives that pull with another force than they are told, which a scene does not know."""
    return [
        f"{key} is {unknown.value(z):.4g}; it belongs to the drive, so the scene does not hold it"
        for unknown, z in zip(rig.unknowns, fitted.z, strict=True)
        for key in unknown.keys
        if key.startswith("drive.")
    ]


def _scales(rig: Rig, fitted: CaseFit) -> tuple[np.ndarray, str]:
    """Force of each actuator over what its drive was told (n_a,), and why no such factors exist, '' where they do."""
    scales = np.ones(len(rig.actuators))
    for unknown, z in zip(rig.unknowns, fitted.z, strict=True):
        for key in unknown.keys:
            _, *rest = key.split(".")
            if key.startswith("drive.") and (rest[-1] != "scale" or unknown.session is not None):
                return scales, f"it goes with the commands, and {key} makes these other than multiples of the forces"
            if key.startswith("drive."):
                scales[rig.actuators.index(rest[0])] = unknown.value(z)
    return scales, ""


def _discrepancy(lab: Lab, rig: Rig, fitted: CaseFit, scales: np.ndarray) -> dict[str, Any]:
    """`discrepancy` of a scene: of each effector the mean over its markers."""
    effectors = [marker.effector for marker in lab.spec.markers.values()]
    largest = scales * rig.discrepancy.largest
    terms = []
    for (kind, name), block in zip(rig.blocks, np.split(fitted.d, len(rig.blocks)), strict=True):
        if kind == "force":
            markers = block.reshape(-1, 3)
            means = {}
            for effector in dict.fromkeys(effectors):
                mine = [w for w, carrier in zip(markers, effectors, strict=True) if carrier == effector]
                means[effector] = {"mm": [float(f"{number:.6g}") for number in np.mean(mine, axis=0)]}
            terms.append({"forces": name.split(), "effectors": means})
    forces = {name: written(float(f), lab.units[name]) for name, f in zip(rig.actuators, largest, strict=True)}
    return {"largest": forces, "terms": terms}


def _within_calibration(data: dict[str, Any], mesh: Mesh) -> list[str]:
    """Ends each actuator's reach, in the plain data of a scene, where it alone has the largest force of the
    calibration, as nothing tells what the model lacks beyond; sentences on what was changed."""
    robot = build_robot(SceneSpec.model_validate(data), mesh)
    problem, sentences = Problem(robot), []
    for i, name in enumerate(robot.rows.actuators):
        largest = np.where(np.arange(robot.rows.n_a) == i, robot.discrepancy.largest, 0.0)
        solved = solve(problem, force(largest), wanted=Wanted(condense=False))
        (low, high), unit = robot.reach[i], robot.actuator_units[i][0]
        farthest = float(f"{solved.delta_a[i]:.3g}")
        if solved.converged and low < farthest < high:
            data["actuators"][i]["reach"] = {unit: [float(low), farthest]}
            sentences.append(f"the reach of {name} ends at {farthest:g} {unit}, with the calibration's largest force")
    return sentences


def _text(node: Any, indent: str = "") -> str:
    """YAML of plain data: a mapping or a list in one line where it fits, else an entry a line."""
    lines = []
    for key, value in node.items() if isinstance(node, dict) else ((None, value) for value in node):
        name, flow = "-" if key is None else f"{key}:", _flow(value)
        if len(indent) + len(name) + len(flow) < _WIDTH or not isinstance(value, dict | list) or key is None:
            lines.append(f"{indent}{name} {flow}\n")
        else:
            lines.append(f"{indent}{name}\n{_text(value, indent + '  ')}")
    return "".join(lines)


def _flow(node: Any) -> str:
    """A value in one line."""
    if isinstance(node, dict):
        return "{" + ", ".join(f"{key}: {_flow(value)}" for key, value in node.items()) + "}"
    if isinstance(node, list):
        return "[" + ", ".join(map(_flow, node)) + "]"
    return json.dumps(node) if not isinstance(node, str) or _QUOTED.search(node) else node
