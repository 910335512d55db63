"""Blocked force of the PneuNet: its tip presses a table, by learned models against finite elements that touch at nodes.

python benchmarks/blocked_force.py [--pressures KPA ...] [--table MM] [--figure FILE]

Needs `cfem run pipelines/pneunet` and `cfem run pipelines/pneunet/train-blocked.yaml`. The table is a plane below the
tip, without friction. A row has the force on it at a pressure

    FE        of finite elements that touch at every node of the surface, on the mesh of the samples
    stop      of the model that was trained with what stops the tip as a second actuator
    contact   of the model of the free robot, in contact at every node

with the errors of both models, and the error that the latter estimates (`ContactState.error`; above 0.035 it says that
it is not to be trusted)."""

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from scipy.optimize import root_scalar

from cfem.constraint.surface import outer_surface
from cfem.constraint.surface_points import at_nodes
from cfem.contact.obstacle import Plane
from cfem.contact.obstacle_set import ObstacleSet
from cfem.equilibrium.contact.skinned_robot import SkinnedRobot
from cfem.equilibrium.contact.surfaces import SurfaceScene
from cfem.equilibrium.system.robot import Robot
from cfem.predict.contact.kept_patches import node_model_of
from cfem.predict.contact.scene import contact_step
from cfem.predict.contact.surface_model import SurfaceModel
from cfem.predict.load import load_model
from cfem.predict.protocol import Predictor
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh, made_from

ROOT = Path(__file__).parents[1]
SCENE, MESH = ROOT / "pipelines" / "pneunet" / "scene.yaml", ROOT / "data" / "pneunet" / "mesh"
FREE, BLOCKED = (ROOT / "models" / "pneunet" / name for name in ("spectral", "blocked"))
STEPS = 15  # of the volume, from which a search for a pressure begins

Answers = Callable[[float], np.ndarray]  # at a volume mm^3: pressure kPa, force N, and more


def by_finite_elements(robot: Robot, table: Plane) -> Answers:
    surface = outer_surface(robot.X, robot.body.mesh.facets)
    points = at_nodes(robot.X, robot.body.mesh.facets, surface)
    skinned = SkinnedRobot(robot, surface.nodes, surface.triangles, points, itself=False)
    scene, states = SurfaceScene([skinned], ObstacleSet((table,))), [None]

    def answers(volume: float) -> np.ndarray:
        state = scene.go([np.array([volume])], states[-1])
        assert state.converged, state.status
        states.append(state)
        return np.array([1e3 * state.solved[0].lambda_a[0], state.forces.sum(axis=0)[2]])

    return answers


def by_contact(model: SurfaceModel, table: Plane) -> Answers:
    def answers(volume: float) -> np.ndarray:
        state = None
        for step in np.linspace(0.0, volume, STEPS)[1:]:
            state = contact_step(model, [step], [table], before=state)
        assert state is not None and state.converged
        return np.array([1e3 * state.lambda_a[0][0], state.forces.sum(axis=0)[2], state.error])

    return answers


def by_stop(model: Predictor, way: float) -> Answers:
    def answers(volume: float) -> np.ndarray:
        state = model.at_displacement([volume, way])
        return np.array([1e3 * state.lambda_a[0], state.lambda_a[1], model.inside(state)])

    return answers


def at_pressures(answers: Answers, pressures: Sequence[float], largest: float) -> np.ndarray:
    """Answers (k, ...) at pressures kPa, NaN where the pressure takes more than the largest volume mm^3."""
    volumes = np.linspace(0.0, largest, STEPS)[1:]
    known = np.array([answers(volume) for volume in volumes])
    rows = []
    for pressure in pressures:
        beyond = np.flatnonzero(known[:, 0] >= pressure)
        if not len(beyond):
            rows.append(np.full(known.shape[1], np.nan))
            continue
        start, step = volumes[beyond[0]], volumes[0] / 4
        found = root_scalar(
            lambda volume, wanted=pressure: answers(volume)[0] - wanted, x0=start, x1=start - step, xtol=1e-4 * largest
        )
        rows.append(answers(found.root))
    return np.array(rows)


def draw(file: Path, pressures: Sequence[float], curves: dict[str, np.ndarray]) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6, 4), layout="constrained")
    axes = figure.subplots()
    for (name, forces), style in zip(curves.items(), ("k-", "C0o", "C3x--"), strict=True):
        axes.plot(pressures, forces, style, label=name)
    axes.set(xlabel="pressure (kPa)", ylabel="force on the table (N)", xlim=(0, None), ylim=(0, None))
    axes.legend()
    figure.savefig(file, dpi=120)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pressures", type=float, nargs="+", default=[5.0, 10.0, 20.0, 30.0, 40.0])
    parser.add_argument("--table", type=float, default=1.0, help="mm below the edge of the free end")
    parser.add_argument("--figure", type=Path)
    given = parser.parse_args()
    scene, mesh = load_scene_and_mesh(SCENE, MESH)
    robot, table = build_robot(scene, mesh), Plane(t=np.array([0.0, 0.0, -given.table]))
    touched = node_model_of(load_model(FREE), FREE, robot, made_from(SCENE, MESH) | {"loads": {}})
    largest = scene.actuators[0].reach[1]
    exact, stop, contact = (
        at_pressures(answers, given.pressures, largest)
        for answers in (
            by_finite_elements(robot, table),
            by_stop(load_model(BLOCKED), -given.table),
            by_contact(touched, table),
        )
    )
    print("| pressure (kPa) | FE (N) | stop (N) | off (%) | contact (N) | off (%) | its estimate |")
    print("|---|---|---|---|---|---|---|")
    for pressure, fe, by_two, free in zip(given.pressures, exact, stop, contact, strict=True):
        off = [100 * (each[1] / fe[1] - 1) for each in (by_two, free)]
        outside = "" if by_two[2] else " OUTSIDE"
        print(
            f"| {pressure:g} | {fe[1]:.4f} | {by_two[1]:.4f}{outside} | {off[0]:.2g} | {free[1]:.4f} | {off[1]:.2g} | "
            f"{free[2]:.2f} |"
        )
    if given.figure:
        curves = {"finite elements, at nodes": exact, "model with a stop": stop, "contact of the free model": contact}
        draw(given.figure, given.pressures, {name: values[:, 1] for name, values in curves.items()})


if __name__ == "__main__":
    main()
