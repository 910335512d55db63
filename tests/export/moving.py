"""A robot of two cables that moves, made by hand on the synthetic one, and its predictive controllers, C and Python."""

from functools import cache
from pathlib import Path

import numpy as np
from export.embedded import export, spectral
from export.pages import skin_of

from cfem.condensed.model import under_force
from cfem.control.motion.horizon import Bounds, HalfSpace, HorizonCost
from cfem.control.motion.mpc import Mpc, Plan
from cfem.control.motion.observer import Doubt
from cfem.export.compiled.mpc import CompiledMpc
from cfem.export.firmware.embedding import Embedding
from cfem.export.firmware.motion import write_c_motion
from cfem.export.firmware.mpc import mpc_constants, write_c_mpc
from cfem.export.firmware.single import write_single
from cfem.export.page.page import page
from cfem.export.spec import CSpec
from cfem.motion.clocked import Clocked
from cfem.motion.model import MotionModel, layout
from cfem.predict.load import build

RATE, N_Q, N_E = 50.0, 4, 3
CURVE = 2.0  # mm, of the arcs of the tip
VISCOSITY = [{"relaxation": 4e-3, "prony": [[0.3, 0.02]]}]


@cache
def robot(n_a: int = 2) -> tuple[dict, dict, dict]:
    """model.json, its arrays, and those of its motion: inner motions, a mass that changes with the place, one viscous
    material with a Prony term. With two cables its first frequency is 2.3 Hz."""
    meta, arrays = spectral(n_a=n_a)
    rng = np.random.default_rng(7)
    indices = np.array([[0, 0], [1, 0], [0, 1], [2, 0], [1, 1]] if n_a == 2 else [[0], [1], [2], [3]])
    where = layout(N_Q, N_Q - n_a, N_E, 1)
    series = 0.04 * rng.normal(size=(where["F0"].stop, len(indices)))
    diagonal = np.flatnonzero(np.eye(N_Q)[np.triu_indices(N_Q)])
    series[where["M"]][diagonal, 0] += 1.0
    series[where["F0"]][diagonal, 0] += 1.0
    series[where["H"]] *= 20.0
    moving = {
        "to_box": 0.1 * np.eye(n_a),
        "offset": -np.ones(n_a),
        "indices": indices,
        "series": series,
        "scale": np.array([20.0, 15.0, 25.0, 12.0]),
        "stiffness": np.array(8.0),
        "curve": CURVE * rng.normal(size=(N_E * (N_Q - n_a) * (N_Q - n_a + 1) // 2, len(indices))),
    }
    return {**meta, "motion": {"viscosity": VISCOSITY}}, arrays, moving


@cache
def model(n_a: int = 2) -> MotionModel:
    meta, arrays, moving = robot(n_a)
    return MotionModel(build(meta, arrays), moving, VISCOSITY)


def spec(kind: str = "force", mpc: dict | None = None, n_a: int = 2, **control) -> CSpec:
    start = model(n_a).static.domain.delta_a.mean(axis=0)
    control = {"command": kind, "start": {"mm": start.tolist()}, **control}
    return CSpec(controller=control, mpc={"ticks": f"{RATE} Hz", "horizon": 8, **(mpc or {})})


def folder_of(folder: Path, chosen: CSpec) -> Path:
    meta, arrays, moving = robot(len(chosen.controller.start))
    export(folder, (meta, arrays), controller=chosen.controller, arithmetic=chosen.arithmetic, vectors=20)
    write_c_motion(folder, meta, arrays, moving)
    write_c_mpc(folder, chosen, meta, arrays, moving)
    if chosen.arithmetic == "float":
        write_single(folder)
    return folder


def predictive(chosen: CSpec, start: np.ndarray) -> Mpc:
    """That of Python with the numbers of the export, from rest at start (2,) mm."""
    sizes, numbers, constants = mpc_constants(chosen, *robot())
    moves, kind = model(), chosen.controller.command
    normals, levels = constants["normal"], constants["level"] + constants["normal"] @ moves.rest_e
    planes = tuple(HalfSpace(*one) for one in zip(normals, levels, strict=True)) if sizes["PLANES"] else ()
    cost = HorizonCost(*(constants[name] for name in ("weight", "smooth", "effort")))
    bounds = Bounds(*(constants[name] for name in ("command", "rate", "course")), planes)
    names = ("noise", "stiffness", "viscosity", "wander", "offset", "push")
    doubt = {name: numbers[f"DOUBT_{name.upper()}"] for name in names} | {"gate": chosen.mpc.gate}
    doubt = Doubt(**doubt) if sizes["SENSED"] else None
    plan = Plan(sizes["TICKS"], cost, bounds, moves=chosen.mpc.moves)
    home = np.asarray(chosen.controller.start, float)  # where its steps are made right
    return Mpc(
        Clocked(moves, kind, numbers["DT"], home), plan, moves.rest_e, moves.static.at_displacement(start), doubt
    )


def both(folder: Path, chosen: CSpec) -> tuple[CompiledMpc, Mpc]:
    """The controller in C, and that of Python with the same numbers."""
    python = predictive(chosen, np.asarray(chosen.controller.start, float))
    return CompiledMpc(folder_of(folder, chosen)), python


def goals(ticks: int, share: float = 0.15, speeds: tuple[float, float] = (12, 20)) -> np.ndarray:
    """(ticks, 3) mm: where the tip would rest under forces that swing about their middle; speeds: rad/s, the second
    twice the first for a figure-eight."""
    moves, found = model(), []
    static, middle = moves.static, moves.static.domain.delta_a.mean(axis=0)
    near = static.at_displacement(middle)
    centre = near.lambda_a
    t = np.arange(ticks) / RATE
    for swing in share * np.sin(np.outer(t, speeds)):
        near = under_force(static, centre * (1 + swing), near)
        found.append(moves.rest_e + near.delta_e)
    return np.array(found)


def page_of_moving(chosen: CSpec) -> str:
    """Of the robot, with a tube for a skin."""
    meta, arrays, moving = robot()
    return page(meta, arrays, skin_of(meta, arrays), chosen, Embedding(), moving=moving)
