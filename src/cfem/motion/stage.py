"""`cfem simulate`: a model that moves under commands over time, and full finite elements beside it where asked."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cfem.core.actuator_units import CABLE
from cfem.core.console.shown import counted
from cfem.core.errors import InputError, SpecError
from cfem.core.spec import load_spec
from cfem.core.stage import Command
from cfem.motion.spec import SimulateSpec

TABLE, FULL = "motion.parquet", "full.parquet"
_STEPS_A_PERIOD = 50


def _mesh(spec: SimulateSpec, base: Path) -> Path:
    """Mesh of the full finite elements."""
    from cfem.robot.spec import SceneSpec

    scene = base / spec.full.scene
    return base / spec.full.mesh if spec.full.mesh else scene.parent / load_spec(scene, SceneSpec).out


def _extra(spec: SimulateSpec, base: Path) -> dict[str, Any]:
    from cfem.robot.spec import scene_meaning

    return {"full": spec.full is not None} | ({"scene": scene_meaning(base / spec.full.scene)} if spec.full else {})


def _work(folder: Path, spec: SimulateSpec, base: Path) -> dict[str, Any]:
    """Results: steps, travel of each effector, largest forces, slack cables, when the motion left what the model has
    learned from, and the distance from full finite elements."""
    from cfem.core.artefact.judgement import KEY, poor
    from cfem.core.console.progress import doing
    from cfem.motion.commands import read_commands, starting
    from cfem.motion.load import load_motion
    from cfem.motion.modes import natural_modes
    from cfem.motion.simulate import simulate
    from cfem.motion.step import MotionCommand
    from cfem.robot.checks.plausible import gravity_doubts

    model = load_motion(base / spec.model)
    commands = read_commands(base / spec.commands, model)
    until = float(commands.t[-1]) if spec.until is None else spec.until
    if not until > commands.t[0]:
        raise SpecError(
            f"the motion ends at {until:g} s, and its commands begin at {commands.t[0]:g} s",
            where="until",
            do="raise it",
        )
    payload, unilateral = _payload(spec, model), _unilateral(spec, model)
    doubts = gravity_doubts(payload.gravity, "payload.gravity") if payload else []
    start = starting(model, commands, payload)
    held = commands.kind == "displacement"
    first = natural_modes(model, start.q[: model.n_a], held, 1, payload).frequency[0]
    dt = 1 / (_STEPS_A_PERIOD * float(first)) if spec.step is None else spec.step

    def command_at(t: float) -> MotionCommand:
        return MotionCommand(displacement=commands.at(t)) if held else MotionCommand(force=commands.at(t - dt / 2))

    doing("simulating")
    run = simulate(model, start, command_at, until, dt, payload, unilateral)
    columns = run.arrays()
    _write(folder / TABLE, model, columns)
    results: dict[str, Any] = {
        "steps": len(run.t) - 1,
        "step_s": dt,
        "first_frequency_Hz": float(first),
        "commanded": commands.kind,
        "travel_mm": _travel(columns["delta_e"]),
        "largest_force": np.abs(columns["lam"]).max(axis=0).tolist(),
        "slack_steps": columns["slack"].sum(axis=0).tolist(),
        "shortened": len(run.shortened),
        "left_s": run.left,
    }
    if spec.full is not None:
        motion = (model, commands, payload, unilateral)
        results["full"] = _beside(folder, spec, base, motion, columns, dt, until)
    headline = _headline(results, run, model.rows.actuators, until)
    return {"headline": headline, KEY: [poor(sentence) for sentence in doubts], **results}


def _headline(results: dict[str, Any], run: Any, actuators: Sequence[str], until: float) -> list[str]:
    """Lines about a motion for people; run: `SimulatedMotion`; until: s."""
    milliseconds, first = 1000 * results["step_s"], results["first_frequency_Hz"]
    headline = [
        f"{results['steps']} steps of {milliseconds:.3g} ms to {until:g} s; first natural frequency {first:.3g} Hz",
        f"the effectors travel {max(results['travel_mm']):.3g} mm; {TABLE}",
    ]
    if run.left is not None:
        headline.insert(0, f"from {run.left:.4g} s on the motion leaves the training states: its error is unknown")
    if run.shortened:
        t, length, why = run.shortened[0]
        halved = counted(len(run.shortened), "step was", "steps were")
        headline.append(f"{halved} halved; the first, of {length:.3g} s at {t:.4g} s: {why}")
    slack = [name for name, count in zip(actuators, results["slack_steps"], strict=True) if count]
    if slack:
        headline.append(f"cables that were slack for a while: {', '.join(slack)}")
    full = results.get("full")
    if full is not None:
        headline.append(
            f"full finite elements: the effectors differ by {full['largest_mm']:.3g} mm at most, "
            f"{full['percent_of_travel']:.2g} % of their travel"
        )
        if full["why"]:
            headline.insert(0, f"full finite elements ended early: {full['why']}")
    return headline


def _payload(spec: SimulateSpec, model: Any) -> Any:
    """Payload of the spec, None without one. SpecError where its effector is none of the model's."""
    from cfem.motion.payload import Payload

    if spec.payload is None:
        return None
    names = [row.removesuffix(".x") for row in model.rows.effectors if row.endswith(".x")]
    wanted = spec.payload.effector or names[0]
    if wanted not in names:
        raise SpecError(f"no effector '{wanted}'", where="payload.effector", do=f"name one of {', '.join(names)}")
    first = model.rows.effectors.index(f"{wanted}.x")
    gravity = (0.0, 0.0, 0.0) if spec.payload.gravity is None else tuple(map(float, spec.payload.gravity))
    return Payload(spec.payload.mass, (first, first + 1, first + 2), gravity)


def _unilateral(spec: SimulateSpec, model: Any) -> np.ndarray:
    if spec.unilateral is not None:
        return np.full(model.n_a, spec.unilateral)
    return np.array([units == CABLE for units in model.static.actuator_units])


def _travel(delta_e: np.ndarray) -> list[float]:
    """Travel mm of each effector's point: the diagonal of the box that it stays in."""
    ranges = np.ptp(delta_e, axis=0)
    return [float(np.linalg.norm(ranges[k : k + 3])) for k in range(0, len(ranges) - 2, 3)]


def _write(path: Path, model: Any, motion: dict[str, np.ndarray]) -> None:
    """Writes the motion as a table with its units."""
    from cfem.dataset.writer import write_columns

    table, units = {"time": motion["t"]}, {"time": "s"}
    for i, (name, pair) in enumerate(zip(model.rows.actuators, model.static.actuator_units, strict=True)):
        table |= {f"{name}.displacement": motion["delta_a"][:, i], f"{name}.force": motion["lam"][:, i]}
        table[f"{name}.slack"] = motion["slack"][:, i]
        units |= {f"{name}.displacement": pair[0], f"{name}.force": pair[1]}
    for i, (name, unit) in enumerate(zip(model.rows.effectors, model.rows.effector_units, strict=True)):
        table[name], units[name] = motion["delta_e"][:, i], unit[0]
    write_columns(path, table, {"units": units, "scene": model.static.meta["scene"]})


def _beside(
    folder: Path, spec: SimulateSpec, base: Path, motion: tuple, columns: dict, dt: float, until: float
) -> dict[str, Any]:
    """Comparison with full finite elements under the same commands."""
    from cfem.motion.finite_elements import simulate_full
    from cfem.robot.build import build_robot
    from cfem.robot.load import load_scene_and_mesh
    from cfem.robot.same_robot import demand_robot

    model, commands, payload, unilateral = motion
    scene, read = load_scene_and_mesh(base / spec.full.scene, _mesh(spec, base))
    demand_robot(
        scene, model.static.meta.get("robot"), base / spec.model, "name the scene that the model was trained of"
    )
    run = simulate_full(build_robot(scene, read), commands, until, 2 * dt, payload, unilateral)
    arrays = {"t": run.t, "delta_a": run.of("delta")[:, : model.n_a], "delta_e": run.of("delta_e")}
    arrays |= {"lam": run.of("lam")[:, : model.n_a], "slack": run.of("slack")}
    _write(folder / FULL, model, arrays)
    if len(run.t) < 2:
        raise InputError(f"full finite elements did not move: {run.why}", where=str(spec.full.scene))
    learned = np.stack([np.interp(run.t, columns["t"], column) for column in columns["delta_e"].T], axis=1)
    points = (learned - arrays["delta_e"])[:, : 3 * (learned.shape[1] // 3)].reshape(len(learned), -1, 3)
    largest = float(np.linalg.norm(points, axis=2).max())
    return {
        "steps": len(run.t) - 1,
        "refused": len(run.refused),
        "largest_mm": largest,
        "percent_of_travel": 100 * largest / max(max(_travel(arrays["delta_e"])), 1e-12),
        "why": run.why,
    }


COMMAND = Command(
    "simulate",
    1,
    SimulateSpec,
    _work,
    ("model", "commands"),
    outside=("full",),
    reads=lambda spec, base: {"mesh": _mesh(spec, base)} if spec.full else {},
    extra=_extra,
)
run, stage = COMMAND.run, COMMAND.stage
