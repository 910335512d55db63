"""Contact anywhere beside the C controller: written, and compared with Python."""

from pathlib import Path
from typing import Any

import numpy as np

from cfem.core.errors import InputError
from cfem.export.c_touch import write_c_touch
from cfem.export.compiled import compiler
from cfem.export.compiled_touch import CompiledTouch
from cfem.export.spec import CSpec
from cfem.predict.kept_patches import touchable_of
from cfem.predict.load import load_model
from cfem.predict.touching import touch_step
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh, made_from

STEPS = 10  # from rest to each of a few states, at which C is compared
STATES = 3


def write_touch(folder: Path, spec: CSpec, scene: Path, model_folder: Path, s: np.ndarray) -> dict[str, Any]:
    """Adds contact with the obstacles of `spec` to the C folder of a model; the bytes of its constants, and parity: the
    largest relative difference of forces, tip and actuators from Python on ways to states s (m, n_a), None without a
    compiler. InputError where the model cannot be touched."""
    model = load_model(model_folder)
    robot_scene, mesh = load_scene_and_mesh(scene)
    made_of = made_from(scene, scene.parent / robot_scene.out) | {"loads": {}}
    robot = build_robot(robot_scene, mesh)
    try:
        touchable = touchable_of(model, model_folder, robot, made_of, spec.contact.patches)
    except InputError as error:
        raise InputError(error.what, where=error.where or str(model_folder), do=error.do) from None
    obstacles = [one.made(scene.parent) for one in spec.obstacles.values()]
    size = write_c_touch(folder, touchable, obstacles, spec.contact.friction)
    found: dict[str, Any] = {"patches": len(touchable.patches), "bytes": size, "parity": None}
    if not compiler():
        return found
    compiled, worst, mu = CompiledTouch(folder), 0.0, spec.contact.friction
    for end in s[:STATES]:
        before = None
        compiled.reset()
        for share in np.arange(1, STEPS + 1) / STEPS:
            before = touch_step(touchable, share * end, obstacles, mu=mu, before=before)
            here = compiled(share * end, obstacles, mu)
            if not before.converged or here.status:
                break
            forces = [np.zeros((len(touchable.patches), 3)) for _ in range(2)]
            for one, state in zip(forces, (before, here), strict=True):
                one[state.patches] = state.forces
            pairs = [forces, (before.delta_e, here.delta_e), (before.lambda_a, here.lambda_a)]
            worst = max([worst, *(np.abs(a - b).max() / max(np.abs(a).max(), 1e-9) for a, b in pairs)])
    return {**found, "parity": float(worst)}
