"""The C controller of one robot: of a model's reference, or of the design that `parameters` name."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cfem.condensed.parameters import from_json, vector
from cfem.core.artefact.files import write_json
from cfem.core.errors import InputError
from cfem.export.spec import CSpec
from cfem.predict.load import build
from cfem.robot.spec import SceneSpec


@dataclass(frozen=True)
class Embedding:
    """What the scene says of the robot: pressures (n_a, 2) MPa, the smallest and largest of each actuator, None for
    cables; rest_e (n_e,) mm, where its effectors rest, None for where the model's own do."""

    pressures: np.ndarray | None = None
    rest_e: np.ndarray | None = None

    def at_rest(self, meta: dict) -> dict:
        """The model's meta, its effectors at rest where the robot has them."""
        return meta if self.rest_e is None else {**meta, "rest_e": self.rest_e.tolist()}


def embedding(meta: dict, spec: CSpec, scene: SceneSpec | None) -> Embedding:
    """InputError where the scene is of other actuators than the model (meta), or is needed and not there."""
    pressures = None if scene is None else stated_pressures(scene, meta["rows"]["actuators"])
    parameters = from_json(meta["parameters"])
    if not spec.parameters:
        return Embedding(pressures)
    from cfem.sample.rest import Rest, moves_effectors

    if not moves_effectors(parameters):
        return Embedding(pressures)
    if scene is None:
        what = "the model is of several shapes, and does not say where the effectors of this one rest"
        raise InputError(what, where="c.parameters", do="name its scene under `scene`")
    p = vector(parameters, spec.parameters, "c.parameters")
    return Embedding(pressures, Rest(scene, parameters, np.array(meta["rest_e"]))(p[None])[0])


def stated_pressures(scene: SceneSpec, names: list[str]) -> np.ndarray | None:
    """Pressures (n_a, 2) MPa that the scene states, None where no actuator has any. InputError where they are not those
    of the model (names)."""
    actuators = [item.name for item in scene.actuators]
    if actuators != names:
        raise InputError(
            f"its actuators are {', '.join(actuators)}, and those of the model {', '.join(names)}",
            where=f"scene '{scene.name}'",
        )
    stated = [getattr(item, "pressure", None) for item in scene.actuators]
    if all(each is None for each in stated):
        return None
    if any(each is None for each in stated):
        raise InputError(
            "not every actuator states its pressures", where=f"scene '{scene.name}'", do="leave out `scene`"
        )
    return np.array(stated)


def write_embedded(
    folder: Path, spec: CSpec, meta: dict, arrays: dict[str, np.ndarray], s: np.ndarray, robot: Embedding
) -> dict:
    """Fills the folder; what its report.json says, and parity: of the blocks that control uses, in the compiled code,
    with the trained model at the states s (m, n_a); None without a compiler."""
    from cfem.export.compiled.build import compiler, sizes
    from cfem.export.compiled.controller import CompiledController
    from cfem.export.firmware.folder import at_robot, write_c

    meta = robot.at_rest(meta)
    report = write_c(folder, meta, arrays, spec, s, robot.pressures)
    report["bytes"] = sizes(folder)
    write_json(folder / "report.json", report)
    if not compiler():
        return {**report, "parity": None}
    model, controller = build(meta, arrays), CompiledController(folder)
    p, s = at_robot(model, spec, s)
    e, a = model.rows.e, model.rows.a
    expected = [model.at(state, p) for state in s]
    W, free, delta = (
        np.array([getattr(condensed, name) for condensed in expected]) for name in ("W", "delta_free", "delta")
    )
    compiled = [controller.model(state) for state in s]
    # delta_free is a part of delta, whose size it takes: of a robot as linear as a rod it is rounding alone.
    blocks = {
        "W_aa": (W[:, a, a], W[:, a, a]),
        "W_ea": (W[:, e, a], W[:, e, a]),
        "free_a": (free[:, a], delta[:, a]),
        "free_e": (free[:, e], delta[:, e]),
    }
    differences = [
        np.abs(np.reshape([members[name] for members in compiled], block.shape) - block).max() / np.abs(size).max()
        for name, (block, size) in blocks.items()
    ]
    return {**report, "parity": float(max(differences))}
