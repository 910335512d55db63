"""A rod with one cable, measured by three markers: a truth with an offset frame, a stronger drive and noise."""

import csv

import numpy as np
from scipy.spatial.transform import Rotation

from cfem.core.spec import load_spec
from cfem.core.stage import Options
from cfem.equilibrium.solve import Wanted, solve
from cfem.equilibrium.system.actuation import force
from cfem.equilibrium.system.problem import Problem
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh
from cfem.robot.spec import SceneSpec
from cfem.robot.stage import run as make_mesh

QUIET = Options(quiet=True)
SCENE = """
name: rod
out: mesh
length: 100 mm
geometry: {kind: taper, places: {mm: [0, 100]}, radii: {mm: [8, 4]}}
mesh: {size: 12.5 mm, element: beam}
material: {young: 400 kPa, poisson: 0.48, density: 1100 kg/m^3}
gravity: {acceleration: {m/s^2: [0, 0, -9.81]}}
fixed:
  - {kind: plane, point: {mm: [0, 0, 0]}, normal: [-1, 0, 0]}
actuators:
  - {kind: cable, name: tendon, points: {mm: [[0, 0, 5], [100, 0, 2]]}, shift: {outward: 0 mm}, reach: {mm: [0, 30]}}
effectors:
  - {name: middle, point: {mm: [50, 0, 0]}, orientation: true}
  - {name: tip, point: {mm: [100, 0, 0]}, orientation: true}
"""
CASES = """
scene: scene.yaml
mesh: mesh
measurements: given.csv
out: calibrated
layout:
  case: [case]
  session: [session]
  position: [x_mm, y_mm, z_mm]
  forces:
    tendon: {column: tension_N, unit: N}
markers:
  m: {effector: middle, stand_off: {mm: [0, 0, 15]}}
  n: {effector: middle, stand_off: {mm: [0, 12, -5]}}
  t: {effector: tip, stand_off: {mm: [5, 0, 0]}}
parameters:
  young: {key: material.young, range: {kPa: [150, 900]}}
  roll: {key: frame.turn.x, range: {deg: [-10, 10]}, sd: 4 deg}
  friction: {key: actuators.0.friction, range: [0, 0.5], sd: 0.2}
find: [young, roll]
scatter: 0.5 mm
figure: false
"""
YOUNG, ROLL, NOISE = 0.3, np.radians(3.0), 0.2
STAND_OFF = {"m": (0, [0, 0, 15]), "n": (0, [0, 12, -5]), "t": (1, [5, 0, 0])}


def lab(folder):
    """Writes scene, mesh, cases.yaml and given.csv of four cases; other.csv has four more."""
    (folder / "scene.yaml").write_text(SCENE)
    (folder / "cases.yaml").write_text(CASES)
    (folder / "predict.yaml").write_text(
        "cases: cases.yaml\ncalibrated: calibrated\ntable: other.csv\nout: predicted\nfigure: false\n"
    )
    make_mesh(folder / "scene.yaml", [], None, QUIET)
    rng = np.random.default_rng(3)
    write(folder / "given.csv", rows(folder, [0.3, 0.6, 0.9, 1.2], rng))
    write(folder / "other.csv", rows(folder, [0.45, 0.75, 1.05, 1.15], rng, "other"))
    return folder


def rows(folder, tensions, rng, name="given"):
    _, mesh = load_scene_and_mesh(folder / "scene.yaml")
    problem = Problem(build_robot(load_spec(folder / "scene.yaml", SceneSpec, [f"material.young={YOUNG} MPa"]), mesh))
    turn, found = Rotation.from_rotvec([ROLL, 0, 0]).as_matrix(), []
    for number, tension in enumerate(tensions):
        at = solve(problem, force(np.array([tension])), wanted=Wanted(condense=False))
        rows = (at.delta_e + problem.robot.rest_e).reshape(2, 6)
        for marker, (which, off) in STAND_OFF.items():
            place = rows[which, :3] + Rotation.from_rotvec(rows[which, 3:]).as_matrix() @ off
            x, y, z = turn @ place + NOISE * rng.standard_normal(3)
            found.append([f"{name}-{number}", "a", tension, marker, x, y, z])
    return found


def write(path, rows, header=("case", "session", "tension_N", "marker", "x_mm", "y_mm", "z_mm")):
    with open(path, "w", newline="") as file:
        csv.writer(file).writerows([header, *rows])
