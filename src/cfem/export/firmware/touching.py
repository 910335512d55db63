"""Contact anywhere beside the C controller: written, and compared with Python."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cfem.contact.obstacle import Obstacle
from cfem.contact.obstacle_set import ObstacleSet
from cfem.contact.prescribed_motion import ActuatedRobot
from cfem.core.errors import InputError, NumericalError
from cfem.export.compiled.build import compiler
from cfem.export.compiled.meet import CompiledMeet
from cfem.export.compiled.touch import CompiledTouch
from cfem.export.firmware import meet as c_meet
from cfem.export.firmware.touch import write_c_touch
from cfem.export.spec import CSpec
from cfem.predict.contact.step.bodies import PlacedModel
from cfem.predict.contact.step.scene import ContactScene, contact_step
from cfem.predict.contact.step.state import ContactState
from cfem.predict.contact.surface.kept_patches import patched_model_of
from cfem.predict.contact.surface.patched_model import PatchedModel
from cfem.predict.load import load_model
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh, made_from

STEPS, FINE = 10, 20  # from rest to each of a few states, at which C is compared; of robots that meet
STATES = 3
MANY = 3  # CFEM_TOUCH_MANY


def write_touch(folder: Path, spec: CSpec, scene: Path, model_folder: Path, s: np.ndarray) -> dict[str, Any]:
    """Adds contact with the obstacles of `spec` to the C folder of a model; the bytes of its constants, and parity: the
    largest relative difference of forces, tip and actuators from Python on ways to states s (m, n_a), None without a
    compiler. InputError where the model cannot be touched, or robots overlap."""
    model = load_model(model_folder)
    robot_scene, mesh = load_scene_and_mesh(scene)
    made_of = made_from(scene, scene.parent / robot_scene.out) | {"loads": {}}
    robot = build_robot(robot_scene, mesh)
    met = [obstacle for obstacle in spec.obstacles.values() if obstacle.kind == "robot"]
    try:
        patched = patched_model_of(model, model_folder, robot, made_of, *spec.contact.cut)
        courses = [obstacle.actuated(model) for obstacle in met]
    except InputError as error:
        raise InputError(error.what, where=error.where or str(model_folder), do=error.do) from None
    itself = any(obstacle.kind == "itself" for obstacle in spec.obstacles.values())
    solid = [
        obstacle.made(scene.parent) for obstacle in spec.obstacles.values() if obstacle.kind not in ("robot", "itself")
    ]
    mu, soft = spec.contact.friction, bool(met or itself)
    more = {"robots": 1 + len(met), "most": c_meet.MOST} if soft else {}
    size = write_c_touch(folder, patched, solid, mu, robot.unilateral, **more)
    report: dict[str, Any] = {"patches": len(patched.patches), "bytes": size, "parity": None}
    if not soft:
        return report | (
            {"parity": touch_parity(folder, patched, robot.unilateral, solid, mu, s[:STATES])} if compiler() else {}
        )
    places = [(np.eye(3), np.zeros(3), itself), *((course.R, course.t, False) for course in courses)]
    robots = [PlacedModel(patched, *place, robot.unilateral) for place in places]
    report["bytes"] += c_meet.write_c_meet(folder, robots)
    meeting = ContactScene(robots, ObstacleSet.of(solid), mu)
    try:
        sequences = [states_to(meeting, courses, end) for end in s[:STATES]]
    except InputError as error:
        raise InputError(error.what, where=error.where or "c.obstacles", do=error.do) from None
    c_meet.write_states(folder, max(sequences, key=lambda states: states[-1].pressed))
    return report | {"robots": len(robots), "parity": meet_parity(folder, meeting, sequences) if compiler() else None}


def touch_parity(
    folder: Path, patched: PatchedModel, unilateral: np.ndarray, solid: Sequence[Obstacle], mu: float, s: np.ndarray
) -> float:
    """Largest relative difference of C from Python on ways from rest to states s (m, n_a), among rigid obstacles."""
    compiled, worst = CompiledTouch(folder), 0.0
    for end in s:
        before = None
        compiled.reset()
        for share in np.arange(1, STEPS + 1) / STEPS:
            before = contact_step(patched, share * end, solid, mu=mu, before=before, unilateral=unilateral)
            computed = compiled(share * end, solid, mu, slack=True)
            if not before.converged:
                break
            _demand_state(computed.status)
            forces = np.zeros((len(patched.patches), 3))
            forces[computed.patches] = computed.forces
            pairs = [
                (before.forces, forces),
                (before.delta_e[0], computed.delta_e),
                (before.lambda_a[0], computed.lambda_a),
            ]
            worst = max([worst, *(np.abs(a - b).max() / max(np.abs(a).max(), 1e-9) for a, b in pairs)])
    return float(worst)


def states_to(meeting: ContactScene, courses: Sequence[ActuatedRobot], end: np.ndarray) -> list[ContactState]:
    """States of the first robot from rest to end (n_a,) mm, while the others go along their courses, up to one that
    does not converge. InputError where robots overlap at the begin."""
    states = [meeting.start([0 * end, *(course.deltas(0.0) for course in courses)])]
    for share in np.arange(1, FINE + 1) / FINE:
        state = meeting.step([share * end, *(course.deltas(share) for course in courses)], states[-1])
        if not state.converged:
            break
        states.append(state)
    return states


def meet_parity(folder: Path, meeting: ContactScene, sequences: Sequence[Sequence[ContactState]]) -> float:
    """Largest relative difference of C from Python on ways of robots that meet."""
    compiled, worst, solid = CompiledMeet(folder), 0.0, meeting.obstacles.obstacles
    for states in sequences:
        compiled.reset()
        for state in states:
            computed = compiled(state.deltas, solid, meeting.mu)
            _demand_state(computed.status)
            for name in ("forces", "delta_e", "lambda_a"):
                error = np.abs(np.concatenate(getattr(state, name)) - np.concatenate(getattr(computed, name))).max()
                worst = max(worst, float(error) / max(c_meet.scale(states, name), 1e-9))
    return worst


def _demand_state(status: int) -> None:
    """NumericalError where C ends with a status of cfem_touch.h at a state that Python has found."""
    if status == MANY:
        what = "more patches touch at once than C has room for, where it is compared with Python"
        raise NumericalError(what, where="c.contact.patches", do="take larger patches")
    if status:
        what = f"C finds no state where Python has one: status {status} of cfem_touch.h"
        raise NumericalError(what, where="c.contact", do="take larger patches, or please report it")
