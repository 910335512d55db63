"""What docs/figures/measured.md states of the beam's damping.

python benchmarks/measured_motion.py [--young 277.4] [--quick]

    The beam's free oscillation about its own weight (pipelines/measured-beam/oscillation-gravity-a.csv), and what laws
    fitted to it say of the beam with a weight of 102 g, a heavy slice of 3 mm at its end. A few seconds.

    still_Hz:  natural frequency at the modulus (kPa) of the static cases, without viscosity: unloaded, loaded
    measured:  frequency and damping in windows of three periods, beside a vibration of the stand
    laws:      Prony series fitted from an amplitude of 1.2 mm on, by their times (s), with the static modulus kept;
               from_statics: 1, and 0.98 for 1 g of markers at the end, which nobody states. Their residual (mm),
               frequency and damping, and the same with the weight
    judges:    the law of four times with markers of 1 g, with the weight: in finite elements; in finite elements of
               the straight beam, and the pole that their frequency without viscosity has; on a slender beam, whose
               frequency is a closed form
    growths:   damping = a + b (amplitude)^n through the windows: a, b, misfit (chi-squared, sd of 0.1 % at least)
    air:       damping by drag of the air at the largest amplitude
    at_rest:   mm, standard deviation of the height in the last second of six, with the weight: by damping laws from
               an amplitude of 20 mm at the release, and as measured, creep included
    least:     the mean damping with the weight that leaves no more than what was measured, from 20 and from 10 mm"""

import argparse
import csv
import json
import tempfile
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from cfem.condensed.viscosity import Viscosity
from cfem.core.spec import load_spec
from cfem.equilibrium.solve import Wanted, rest_state, solve
from cfem.equilibrium.system.actuation import force
from cfem.fe_motion.modes import natural_modes
from cfem.fe_motion.problem import MovingProblem
from cfem.identify.oscillation.law import fit_viscosity, free_vibration
from cfem.identify.oscillation.ring_down import ring_down
from cfem.robot.build import build_robot
from cfem.robot.mesh.meshing import make_mesh
from cfem.robot.spec import SceneSpec

BEAM = Path("pipelines/measured-beam")
STAND = [(9.9, 0.022)]  # Hz, damping: what is left of the oscillation after 1.5 s
GUESS, TROUGH, SMALL, PERIODS = 7.8, 0.78, 1.29, 3  # Hz; s of the first trough, and of an amplitude of 1.2 mm
TIMES = {
    "one": [0.002],
    "two": [0.002, 2.0],
    "three": [0.01, 0.3, 10.0],
    "four": [0.005, 0.05, 0.5, 5.0],
    "eight": [0.002, 0.006, 0.02, 0.06, 0.2, 0.6, 2.0, 6.0],
}
DENSITY, LENGTH, SIDE, WEIGHT = 1.07e-9, 100.0, 30.0, 1.02e-4  # t/mm^3, mm, mm, t
AIR, DRAG, CUBES = 1.2e-12, 2.0, 0.70  # t/mm^3, of a square bar, integrals of shape^3 over shape^2
ACROSS = 3.0 / 3.516  # strain a mm of the tip, of a load at the tip over that of the free beam


def report(young: float, size: float) -> dict:
    t, x = recording()
    still = [oscillation(young, size, weight, None)[0] for weight in (False, True)]
    windows = measured(t, x)
    laws, four = fitted(t, x, still)
    return {
        "still_Hz": still,
        "measured": windows,
        "laws": laws,
        "judges": judges(young, size, *four),
        "growths": growths(windows),
        "air": AIR * DRAG * SIDE * windows[0]["amplitude_mm"] * CUBES * 2 / (3 * np.pi) / (DENSITY * SIDE**2),
        "at_rest_mm": at_rest(still[1], laws, windows),
        "least": {f"from {first:g} mm": least(still[1], first) for first in (20.0, 10.0)},
    }


def recording() -> tuple[np.ndarray, np.ndarray]:
    """s, and mm of the mean height of the tip's markers."""
    with open(BEAM / "oscillation-gravity-a.csv", newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    heights = [[float(row[f"tip{i}_z_mm"]) for i in (1, 2, 3)] for row in rows]
    return np.array([float(row["t_s"]) for row in rows]), np.mean(heights, axis=1)


def measured(t: np.ndarray, x: np.ndarray) -> list[dict]:
    rows, length = [], PERIODS / GUESS
    for start in TROUGH + length * np.arange(6):
        found = ring_down(t, x, start, start + length, GUESS, STAND)
        row = {"amplitude_mm": found.amplitude, "Hz": found.frequency, "sd_Hz": found.sd_frequency}
        rows.append(row | {"damping": found.damping, "sd_damping": found.sd_damping})
    return rows


def fitted(t: np.ndarray, x: np.ndarray, still: list[float]) -> tuple[list[dict], tuple[Viscosity, float]]:
    """A row for each set of times and static frequency; and the law of four times with markers of 1 g, with its modulus
    after a long time over the static one."""
    rows = []
    for name, times in TIMES.items():
        for share in (1.0, 0.98):
            found = fit_viscosity(t, x, SMALL, times, GUESS, share * still[0], STAND)
            row = {"times": name, "from_statics": share, "prony": found.viscosity.prony, "residual_mm": found.residual}
            row |= {"Hz": found.frequency, "damping": found.damping}
            softer = found.elastic / (share * still[0])
            loaded = free_vibration(softer * still[1], found.viscosity)
            rows.append(row | {"loaded_Hz": loaded[0], "loaded_damping": loaded[1]})
            if (name, share) == ("four", 0.98):
                four = found.viscosity, softer**2
    return rows, four


def judges(young: float, size: float, law: Viscosity, softer: float) -> dict:
    k = brentq(lambda k: _clamped_with_mass(k, WEIGHT / (DENSITY * SIDE**2 * LENGTH)), 0.5, 1.87)
    bending = softer * young * 1e-3 * SIDE**4 / 12
    slender = k**2 / (2 * np.pi * LENGTH**2) * np.sqrt(bending / (DENSITY * SIDE**2))
    straight = oscillation(softer * young, size, True, None, sags=False)[0]
    vibrations = {
        "finite_elements": oscillation(softer * young, size, True, law),
        "straight": oscillation(softer * young, size, True, law, sags=False),
        "straight_by_pole": free_vibration(straight, law),
        "slender_beam": free_vibration(slender, law),
    }
    return {name: {"Hz": frequency, "damping": damping} for name, (frequency, damping) in vibrations.items()}


def _clamped_with_mass(k: float, mu: float) -> float:
    """0 at the wave number k of a clamped beam with mu times its own mass at the end."""
    return 1 + np.cos(k) * np.cosh(k) + mu * k * (np.cos(k) * np.sinh(k) - np.sin(k) * np.cosh(k))


def growths(windows: list[dict]) -> list[dict]:
    """Each window's amplitude^n is its mean over the decay."""
    zeta, sd, first = (np.array([row[key] for row in windows]) for key in ("damping", "sd_damping", "amplitude_mm"))
    sd, rows = np.hypot(sd, 1e-3), []
    for what, n in (("none", 0), ("friction in the clamp", -1), ("drag", 1), ("square of the strain", 2)):
        spent = 2 * np.pi * PERIODS * zeta * n
        mean = first**n * (-np.expm1(-spent) / spent if n else 1.0)
        A = np.stack([np.ones(len(zeta)), mean][: 1 + (n != 0)], axis=1) / sd[:, None]
        c, *_ = np.linalg.lstsq(A, zeta / sd, rcond=None)
        rows.append({"what": what, "n": n, "a": c[0], "b": c[1] if n else 0.0})
        rows[-1]["misfit"] = float(((zeta / sd - A @ c) ** 2).sum())
    return rows


def at_rest(frequency: float, laws: list[dict], windows: list[dict]) -> dict:
    """mm of each law with the weight."""
    linear = next(row["loaded_damping"] for row in laws if (row["times"], row["from_statics"]) == ("four", 0.98))
    square = growths(windows)[-1]
    grows = max(square["b"], 0.0) * ACROSS**2
    rows = {
        "Prony": _left(frequency, linear, 0.0, 20.0),
        "Prony, and grows with the square": _left(frequency, linear, grows, 20.0),
        "loss factor as without the weight": _left(frequency, square["a"], 0.0, 20.0),
        "the same, and grows with the square": _left(frequency, square["a"], grows, 20.0),
        "damping of the last by amplitude": {f"{A} mm": square["a"] + grows * A**2 for A in (1, 2, 5, 10, 15)},
    }
    with open(BEAM / "static.csv", newline="", encoding="utf-8") as file:
        ends = [row for row in csv.DictReader(file) if row["marker"].startswith("tip") and float(row["load_N"]) > 0]
    for repeat in ("a", "b"):
        rows[f"measured, {repeat}"] = float(np.mean([float(r["sd_z_mm"]) for r in ends if r["repeat"] == repeat]))
    return rows


def _left(frequency: float, zeta: float, grows: float, first: float) -> float:
    """mm, sd of a vibration over the sixth second of a recording, released after 0.6 s from an amplitude of `first`:
    dA/dt = -omega (zeta + grows A^2) A."""
    omega, t = 2 * np.pi * frequency, np.linspace(4.4, 5.4, 101)
    span = (0.0, t[-1])
    found = solve_ivp(lambda _, log: -omega * (zeta + grows * np.exp(2 * log)), span, [np.log(first)], t_eval=t)
    return float(np.sqrt(np.mean(np.exp(2 * found.y[0])) / 2))


def least(frequency: float, first: float) -> dict:
    rows = {}
    for repeat, sd in (("a", 0.013), ("b", 0.028)):
        rows[repeat] = brentq(lambda zeta, sd=sd: np.log(_left(frequency, zeta, 0.0, first) / sd), 0.01, 0.2)
    return rows


def oscillation(
    young: float, size: float, weight: bool, law: Viscosity | None, sags: bool = True
) -> tuple[float, float]:
    """Frequency (Hz) and damping of the lowest mode in the vertical plane."""
    material = f"young: {young} kPa, poisson: 0.499, "
    if law is not None:
        terms = ", ".join(f"{{share: {g}, time: {tau} s}}" for g, tau in law.prony)
        material += f"viscosity: {{prony: [{terms}]}}, "
    heavy = DENSITY * 1e12 + (WEIGHT * 1e12 / (3 * SIDE**2) if weight else 0.0)
    slices = [("[[0, -15, -15], [4, 15, 15]]", 1070.0), ("[[97, -15, -15], [100, 15, 15]]", heavy)]
    regions = ", ".join(
        f"{{region: {{kind: box, corners: {{mm: {box}}}}}, material: {{{material}density: {density:.0f} kg/m^3}}}}"
        for box, density in slices
    )
    overrides = [f"material={{{material}density: 1070 kg/m^3}}", f"materials=[{regions}]"]
    scene = load_spec(BEAM / "scene.yaml", SceneSpec, [*overrides, f"mesh={{size: {size} mm, mirror: y}}"])
    with tempfile.TemporaryDirectory() as folder:
        mesh, _ = make_mesh(scene, Path(folder))
    problem = MovingProblem(build_robot(scene, mesh))
    free = force(np.zeros(1))
    found = solve(problem, free, wanted=Wanted(condense=False))
    if not found.converged:
        raise SystemExit(f"no equilibrium under its weight: {found.status.value}")
    modes = natural_modes(problem, found.state if sags else rest_state(problem), 2, held=free)
    upright = int(np.argmax(np.abs(modes.shapes[:, 2]).sum(axis=0)))
    return float(modes.frequency[upright]), float(modes.damping[upright])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--young", type=float, default=277.4)
    parser.add_argument("--quick", action="store_true")
    given = parser.parse_args()
    print(json.dumps(report(given.young, 15.0 if given.quick else 7.5), indent=2))


if __name__ == "__main__":
    main()
