"""What any robot must stand: the cases that fit a scene, on its own mesh. A user's robot may buckle or reach its end
anywhere beyond its stated reach, so there a named cause is as good as an equilibrium."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from cfem.constraint.attachment import attach
from cfem.constraint.cavity import Cavity, make_cavity
from cfem.core.errors import InputError, SpecError
from cfem.equilibrium.system.actuation import Actuation, displacement, force, pull
from cfem.equilibrium.system.robot import Robot
from cfem.mechanics.body import make_body
from cfem.mechanics.element import ELEMENTS
from cfem.mechanics.mass import gravity
from cfem.mechanics.material import LAWS
from cfem.mechanics.material.law import Material
from cfem.mechanics.mesh import Mesh
from cfem.robot.build import as_material, build_robot
from cfem.robot.selection import select_cells
from cfem.robot.spec import SceneSpec
from cfem.stability.bodies import cells_where, in_element
from cfem.stability.case import AWAY, Case, Expectation, converges, either, named, refuses
from cfem.stability.examine import attempt

POISSON = (0.3, 0.4, 0.45, 0.49, 0.499, 0.4999)
STIFFER = (1e-3, 1e-1, 1e1, 1e3)
GENTLE = 0.3  # of the reach
NAN = float("nan")


def cases(scene: SceneSpec, mesh: Mesh) -> list[Case]:
    """Names begin with 'scene/'."""
    return [
        *_materials(scene, mesh),
        *_actuations(scene, mesh),
        *_loads(scene, mesh),
        *_faults(scene, mesh),
    ]


def _materials(scene: SceneSpec, mesh: Mesh) -> list[Case]:
    """Cases of the scene in other materials, elements and contrasts."""
    changes: dict[str, tuple[Expectation, Callable[[], Robot]]] = {
        "as it is": (converges(), partial(remade, scene, mesh))
    }
    for poisson in POISSON:
        changes[f"poisson {poisson}"] = converges(), partial(remade, scene, mesh, {"poisson": poisson})
    for factor in STIFFER:
        changes[f"{factor:g} times as stiff"] = converges(), partial(remade, scene, mesh, factor=factor)
    for name, law in LAWS.items():
        changes[f"law {name}"] = converges(), partial(remade, scene, mesh, {"law": law, "shape": None})
    for name in ELEMENTS:
        if (ELEMENTS[name].n_nodes == 8) == (mesh.cells.shape[1] == 8):
            changes[f"element {name}"] = converges(), partial(remade, scene, mesh, element=name)
    for contrast in (1e-3, 1e3, 1e4, 1e6):
        expect = converges() if contrast > 1 else either(*AWAY)
        changes[f"middle third {contrast:g} times as stiff"] = expect, partial(remade, scene, mesh, contrast=contrast)
    return [Case(f"scene/{label}", expect, attempt(make, _gentle)) for label, (expect, make) in changes.items()]


def _actuations(scene: SceneSpec, mesh: Mesh) -> list[Case]:
    """Cases of the scene under actuations from nothing to absurd."""
    make = partial(remade, scene, mesh)
    n = len(scene.actuators)
    loose, beyond = either(*AWAY), named(*AWAY)
    actuations: dict[str, tuple[Expectation, Callable[[Robot], Actuation]]] = {
        "at rest": (converges(), lambda robot: force(np.zeros(n))),
        "to the reach of all": (loose, lambda robot: displacement(_reach(robot))),
        "to ten times the reach of all": (loose, lambda robot: displacement(10 * _reach(robot))),
        "absurdly far": (beyond, lambda robot: displacement(np.full(n, 1e6 * robot.body.mesh.size**2))),
        "forces next to nothing": (converges(), lambda robot: force(np.full(n, 1e-9 * _strength(robot)))),
        "forces a million times too large": (loose, lambda robot: force(np.full(n, 1e6 * _strength(robot)))),
        "displacement of NaN": (named("NOT_FINITE"), lambda robot: displacement(np.full(n, NAN))),
        "force of NaN": (named("NOT_FINITE"), lambda robot: force(np.full(n, NAN))),
    }
    for index, actuator in enumerate(scene.actuators):
        alone = np.arange(n) == index
        actuations[f"{actuator.name} alone"] = loose, partial(_alone, alone)
    if all(actuator.unilateral for actuator in scene.actuators):
        actuations["all slack"] = converges(), lambda robot: displacement(-_reach(robot))
    return [Case(f"scene/{label}", expect, attempt(make, actuate)) for label, (expect, actuate) in actuations.items()]


def _loads(scene: SceneSpec, mesh: Mesh) -> list[Case]:
    """Weight as a share of the force that would shear the whole body by its size."""
    return [
        Case(
            f"scene/weight of {share:g} of its strength",
            converges() if share < 1e-6 else either(*AWAY),
            attempt(partial(_weighed, scene, mesh, share), lambda robot: force(np.zeros(robot.rows.n_a))),
        )
        for share in (1e-12, 1e-8, 1e-4, 1.0, 1e6)
    ]


def _faults(scene: SceneSpec, mesh: Mesh) -> list[Case]:
    """Cases of the scene with a fault put in."""
    far = mesh.X.max(axis=0) + 10 * mesh.size
    listed = [
        Case(
            "scene/held by nothing",
            named("SINGULAR"),
            attempt(partial(_freed, scene, mesh), lambda robot: force(np.zeros(robot.rows.n_a))),
        ),
        Case("scene/inverted cell", refuses(InputError, "inverted"), partial(_inverted, scene, mesh)),
        Case(
            "scene/point outside the body",
            refuses(SpecError, "outside the body"),
            partial(attach, mesh, far, 2.0, "cable point"),
        ),
    ]
    if any(actuator.kind == "cavity" for actuator in scene.actuators):
        listed.append(Case("scene/open cavity", refuses(SpecError, "not closed"), partial(_opened, scene, mesh)))
    return listed


def remade(
    scene: SceneSpec,
    mesh: Mesh,
    change: Mapping[str, object] | None = None,
    factor: float = 1.0,
    element: str | None = None,
    contrast: float = 1.0,
) -> Robot:
    """The scene's robot with another element, all its materials changed (fields of Material) and `factor` times as
    stiff, and the middle third of the body, along its longest side, `contrast` times as stiff as the main material."""
    if element is not None:
        mesh = in_element(mesh, element)
        scene = scene.model_copy(update={"mesh": scene.mesh.model_copy(update={"element": element})})
    robot = build_robot(scene, mesh)

    def changed(spec) -> Material:
        material = as_material(spec)
        return replace(material, young=factor * material.young, **(change or {}))

    regions = [
        (select_cells(mesh, item.region, f"materials.{index}.region"), changed(item.material))
        for index, item in enumerate(scene.materials)
    ]
    main = changed(scene.material)
    if contrast != 1.0:
        axis = int(np.ptp(mesh.X, axis=0).argmax())
        low, high = mesh.X[:, axis].min() + np.ptp(mesh.X[:, axis]) * np.array([1 / 3, 2 / 3])
        middle = cells_where(mesh, lambda c: (c[:, axis] > low) & (c[:, axis] < high))
        regions.append((middle, replace(main, young=contrast * main.young)))
    return replace(robot, body=make_body(mesh, ELEMENTS[scene.mesh.element], main, regions))


def _reach(robot: Robot) -> np.ndarray:
    return np.abs(robot.reach).max(axis=1)


def _strength(robot: Robot) -> float:
    """Force N that would shear the whole body by its size; for chambers the same number of MPa is absurd too."""
    return min(part.shear for part in robot.body.solids) * robot.body.mesh.size**2


def _gentle(robot: Robot) -> Actuation:
    """Actuation of all actuators by the same share of their reach, by forces in proportion: within reach of any
    robot."""
    return pull(np.full(robot.rows.n_a, GENTLE), _reach(robot))


def _alone(driven: np.ndarray, robot: Robot) -> Actuation:
    return pull(driven.astype(float), _reach(robot))


def _weighed(scene: SceneSpec, mesh: Mesh, share: float) -> Robot:
    robot = remade(scene, mesh)
    down = np.array([0.0, 0.0, -share * _strength(robot) / float(mesh.volumes.sum())])
    return replace(robot, loads=gravity(robot.body, 1.0, down))


def _freed(scene: SceneSpec, mesh: Mesh) -> Robot:
    return replace(remade(scene, mesh), fixed=np.empty(0, dtype=int), loads=None)


def _inverted(scene: SceneSpec, mesh: Mesh) -> Robot:
    cells = mesh.cells.copy()
    swapped = (
        [4, 5, 6, 7, 0, 1, 2, 3] if cells.shape[1] == 8 else [1, 0, 2, 3, *([4, 6, 5, 8, 7, 9][: cells.shape[1] - 4])]
    )
    cells[0] = cells[0, swapped]
    return remade(scene, replace(mesh, cells=cells))


def _opened(scene: SceneSpec, mesh: Mesh) -> Cavity:
    chambers = [actuator for actuator in build_robot(scene, mesh).actuators if isinstance(actuator, Cavity)]
    return make_cavity(mesh.X, chambers[0].cliques[0][1:], "chamber")
