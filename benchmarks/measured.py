"""What docs/measured.md states of intervals, and of rods against tetrahedra.

python benchmarks/measured.py coverage [--trials 400] [--quick]

    Hundreds of simulated calibrations by markers that are linear in all unknowns: share of coordinates of new cases
    within their 95 % intervals and of markers within their 95 % radius. lacks: what the model lacks, one pattern a
    case, as a multiple of the noise. models: from how many the one was chosen that predicts left-out cases best;
    average: whether all of them are averaged instead; with more than one, a fifth of the trials. grows: share of the
    noise's variance that goes with the square of the displacement, null for any. given, asked: ranges of the forces.
    smooth: what the model lacks, a smooth function of the force, as a multiple of the noise; discrepancy: whether it
    is estimated. Thirteen minutes.

python benchmarks/measured.py rods [--sizes 10 8 6 5] [--quick]

    The tentacle at tensions of its first tendon as a rod and as tetrahedra of smaller and smaller size: how far p1 to
    p4 are apart, mm, and the volume of the tetrahedra by that of the cones. pressed: of a rod whose cable lies further
    out by 0.9 mm times tension times curvature over the modulus, as one that presses into rubber. A minute.

python benchmarks/measured.py cylinder [--quick]

    A straight cylinder with a cable off its axis: curvature (1/m) at its middle by least energy of fibres on an arc,
    with stiff sections and with sections that swell as they are compressed; by the rod; by tetrahedra of two sizes,
    whose cable presses into the rubber as well. arm_mm: how far the cable then is from the axis (5 mm at rest);
    with_that_arm: by fibres on an arc that swell and have this arm. A minute."""

import argparse
import json
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

from cfem.core.spec import load_spec
from cfem.equilibrium.solve import Wanted, solve
from cfem.equilibrium.system.actuation import force
from cfem.equilibrium.system.problem import Problem
from cfem.robot.build import build_robot
from cfem.robot.mesh.meshing import make_mesh
from cfem.robot.spec import SceneSpec

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

SCENE = Path("pipelines/measured-tentacle/scene.yaml")
RADIUS, OFF, YOUNG = 10.0, 5.0, 0.4  # mm, mm, MPa, of the cylinder
TENSIONS, SIZES = (3.077, 6.154), (10.0, 8.0, 6.0, 5.0)
PRESSES = 0.9  # mm: how far a cable presses into rubber, times its modulus over the force on a length
PLACES, RADII = (0.0, 305.0, 360.0), (15.41, 6.42, 4.80)


def coverages(trials: int) -> list[dict]:
    from identify.cases.linear import Sort, coverage

    small, large, rows = (0.25, 0.35), (0.8, 1.0), []
    asked = [(m, Sort(lacks, sd)) for m, sd in ((4, 0.0), (5, 5.0), (8, 5.0)) for lacks in (0.0, 1.0, 3.0)]
    asked += [(5, Sort(grows=grows)) for grows in (1.0, None)]
    asked += [(8, Sort(smooth=smooth, discrepancy=True)) for smooth in (0.0, 3.0)]
    asked += [(12, Sort(smooth=10.0, discrepancy=estimated)) for estimated in (False, True)]
    asked += [(4, Sort(grows=grows, given=small, asked=large)) for grows in (0.0, 1.0, None)]
    chosen = [(m, lacks) for m in (5, 8) for lacks in (1.0, 3.0)]
    asked += [(m, Sort(lacks, 5.0, 12, average=average)) for average in (False, True) for m, lacks in chosen]
    for m, sort in asked:
        count = trials if sort.models == 1 else max(trials // 5, 1)
        coordinates, markers = coverage(count, m, sort)
        row = {"cases": m, **vars(sort), "trials": count}
        rows.append(row | {"coordinates": round(coordinates, 3), "markers": round(markers, 3)})
    return rows


def rods(tensions: tuple[float, ...], sizes: tuple[float, ...]) -> list[dict]:
    rod, _ = _problem([])
    far = {tension: _markers(rod, tension)[0] for tension in tensions}
    pressed = {tension: _pressed(tension) for tension in tensions}
    rows = []
    for size in sizes:
        begin = time.process_time()
        solid, volume = _problem(_as_solid(size))
        for tension in tensions:
            places, _ = _markers(solid, tension)
            moved = float(np.linalg.norm(far[tension][-1] - [PLACES[-1], 0, 0]))
            rows.append({"size_mm": size, "tension_N": tension, "volume": round(volume, 4), "tip_moves_mm": moved})
            for name, of in (("apart_mm", far), ("pressed_apart_mm", pressed)):
                rows[-1][name] = np.linalg.norm(places - of[tension], axis=1).round(2).tolist()
        rows[-1]["cpu_seconds"] = round(time.process_time() - begin, 1)
    return rows


def cylinder(tensions: tuple[float, ...], sizes: tuple[float, ...]) -> list[dict]:
    rod, *solids = (_curved(each) for each in ("10 mm, element: beam", *(f"{size} mm" for size in sizes)))
    rows = []
    for tension in tensions:
        row = {"tension_N": tension, "stiff_sections": _on_arc(tension, 0.0), "swelling": _on_arc(tension, 0.5)}
        row["rod"] = _curvature(rod, tension)[0]
        for size, solid in zip(sizes, solids, strict=True):
            row[f"tetrahedra_{size:g}_mm"], arm = _curvature(solid, tension)
        row |= {"arm_mm": arm, "with_that_arm": _on_arc(tension, 0.5, arm)}
        rows.append({name: round(number, 3) for name, number in row.items()})
    return rows


def _on_arc(tension: float, swells: float, arm: float | None = None) -> float:
    """1/m of least energy: E / 6 (l^2 + 2 / l - 3) of fibres, summed over the disc, and tension times length. Places in
    the section go with (1 + eps)^-swells, and the cable's with them unless its arm (mm) is given."""
    r, phi = (np.arange(100) + 0.5) / 100 * RADIUS, (np.arange(60) + 0.5) / 60 * 2 * np.pi
    z, ring = np.outer(r, np.sin(phi)), 2 * np.pi * r * RADIUS / 100

    def energy(u: np.ndarray) -> float:
        wide = (1 + u[0]) ** -swells
        lam = 1 + u[0] + u[1] * wide * z / RADIUS
        fibres = (ring * (YOUNG / 6 * (lam**2 + 2 / lam - 3)).mean(axis=1)).sum()
        return float(fibres + tension * (1 + u[0] - u[1] * (wide * OFF if arm is None else arm) / RADIUS))

    found = minimize(energy, [-0.02, 0.05], method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-13})
    return float(1e3 * found.x[1] / RADIUS)


def _curved(mesh: str) -> Problem:
    points = ", ".join(f"[{x:g}, 0, {OFF}]" for x in np.arange(0, 201, 2.5))
    rod = "beam" in mesh
    held = "radius: 2 mm, through_air: true, " if not rod else ""
    watched = ", ".join(
        f"{{name: e{x}, point: {{mm: [{x}, 0, 0]}}, orientation: true{'' if rod else ', carrier_radius: 9 mm'}}}"
        for x in (60, 140)
    )
    if not rod:
        watched += ", {name: axis, point: {mm: [100, 0, 0]}, carrier_radius: 9 mm}, "
        watched += f"{{name: cable, point: {{mm: [100, 0, {OFF}]}}, radius: 2 mm}}"
    text = f"""name: cylinder
out: out
length: 200 mm
geometry: {{kind: taper, places: {{mm: [0, 200]}}, radii: {{mm: [{RADIUS}, {RADIUS}]}}}}
mesh: {{size: {mesh}}}
material: {{law: neo-hookean, young: {YOUNG} MPa, poisson: 0.499}}
fixed: [{{kind: plane, point: {{mm: [0, 0, 0]}}, normal: [-1, 0, 0]}}]
{"" if rod else "rigid: [{kind: plane, point: {mm: [200, 0, 0]}, normal: [1, 0, 0]}]"}
actuators: [{{kind: cable, name: c, {held}points: {{mm: [{points}]}}, reach: {{mm: [0, 90]}}}}]
effectors: [{watched}]
"""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scene.yaml"
        path.write_text(text)
        scene = load_spec(path, SceneSpec)
        return Problem(build_robot(scene, make_mesh(scene, path.parent)[0]))


def _curvature(problem: Problem, tension: float) -> tuple[float, float]:
    """1/m, between the two places; mm from the axis to the cable between them, nan of a rod."""
    found = solve(problem, force(np.array([tension])), wanted=Wanted(condense=False))
    if not found.converged:
        raise SystemExit(f"no equilibrium at {tension:g} N: {found.status.value}")
    turn, rest = np.split(found.delta_e, [12])
    turn, rest = turn.reshape(2, 6)[:, 4], (rest + problem.robot.rest_e[12:]).reshape(-1, 3)
    arm = float(np.linalg.norm(rest[1] - rest[0])) if len(rest) else np.nan
    return float(1e3 * abs(turn[1] - turn[0]) / 80), arm


def _problem(overrides: list[str]) -> tuple[Problem, float]:
    """And the volume of the cells by that of the body."""
    scene = load_spec(SCENE, SceneSpec, overrides)
    with tempfile.TemporaryDirectory() as folder:
        mesh, volume = make_mesh(scene, Path(folder))
    return Problem(build_robot(scene, mesh)), float(mesh.volumes.sum()) / volume if volume else 1.0


def _as_solid(size: float) -> list[str]:
    """Overrides: tendons through points of their channels, markers on the tetrahedra around the axis."""
    made = [f"mesh={{size: {size} mm}}"]
    x = np.linspace(0, 305, 62)
    for i, side in ((0, 1), (1, -1)):
        y, z = side * np.interp(x, [0, 305], [9.8727, 2.0806]), np.interp(x, [0, 305], [5.7, 1.2012])
        points = ", ".join(f"[{a:.3f}, {b:.4f}, {c:.4f}]" for a, b, c in zip(x, y, z, strict=True))
        made += [f"actuators.{i}.points={{mm: [{points}]}}", f"actuators.{i}.radius=2 mm"]
        made += [f"actuators.{i}.through_air=true", f"actuators.{i}.reach={{mm: [0, 150]}}"]
    for i, place in enumerate((129.1, 219.5, 280, 360)):
        made.append(f"effectors.{i}.carrier_radius={0.9 * np.interp(place, PLACES, RADII):.3f} mm")
    return made


def _pressed(tension: float) -> np.ndarray:
    """(4, 3) mm of markers: of a rod whose first cable lies further out by PRESSES tension curvature / E, in turns."""
    x, out = np.linspace(0, 305, 62), np.zeros(62)
    side = np.array([np.cos(np.pi / 6), np.sin(np.pi / 6)])
    for _ in range(6):
        off = np.interp(x, [0, 305], [11.4, 2.4025]) + out
        points = ", ".join(f"[{a:.3f}, {b:.5f}, {c:.5f}]" for a, (b, c) in zip(x, off[:, None] * side, strict=True))
        problem, _ = _problem([f"actuators.0.points={{mm: [{points}]}}"])
        places, nodes = _markers(problem, tension)
        beam = problem.body.rod
        bent = np.linalg.norm(problem.evaluate(nodes, np.empty(0)).response.rod.strain.e[:, 4:], axis=1) / beam.length
        middle = np.cumsum(beam.length) - beam.length / 2
        out = np.interp(x, middle, PRESSES * tension * bent / 0.35)
    return places


def _markers(problem: Problem, tension: float) -> tuple[np.ndarray, np.ndarray]:
    """(4, 3) mm, and (n, 3) mm of the nodes."""
    state = None
    for share in (0.5, 1.0):
        found = solve(problem, force(np.array([share * tension, 0.0])), state, wanted=Wanted(condense=False))
        if not found.converged:
            raise SystemExit(f"no equilibrium at {share * tension:g} N: {found.status.value}")
        state = found.state
    return (found.delta_e + problem.robot.rest_e).reshape(-1, 6)[:, :3], found.state.x


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["coverage", "rods", "cylinder"])
    parser.add_argument("--trials", type=int, default=400)
    parser.add_argument("--sizes", type=float, nargs="+", default=SIZES)
    parser.add_argument("--quick", action="store_true")
    given = parser.parse_args()
    if given.what == "coverage":
        rows = coverages(4 if given.quick else given.trials)
    elif given.what == "cylinder":
        rows = cylinder((1.0,), (12.0,)) if given.quick else cylinder((4.0, 8.0), (6.0, 4.0))
    else:
        rows = rods((0.5,), (14.0,)) if given.quick else rods(TENSIONS, tuple(given.sizes))
    print(json.dumps(rows, indent=2))


if __name__ == "__main__":
    main()
