"""Commands of a calibrated robot against those that were measured (docs/figures/measured.md).

python benchmarks/calibrated_commands.py [--first 5] [--quick]

    The tentacle is calibrated by its first cases, with and without what the model lacks (`discrepancy`). Each other
    case was measured at known tensions. tip_mm: how far the end is from where the model has it at these tensions.
    tension_N: how far the tensions with which the model brings the end closest to where it was measured are from those
    that were told, the largest of a case; mean and largest over the cases. Seven minutes of CPU time."""

import argparse
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from cfem.core.spec import load_spec
from cfem.core.stage import Options
from cfem.identify.cases.discrepancy import discrepancy_of
from cfem.identify.cases.fit import CaseFit, fit_with_discrepancy
from cfem.identify.cases.load import load_lab
from cfem.identify.cases.rig import Rig
from cfem.identify.cases.scatter import Scatter
from cfem.identify.cases.spec import CasesSpec
from cfem.identify.cases.table import Cases
from cfem.robot.stage import run as mesh

CASES = Path("pipelines/measured-tentacle/cases.yaml")
END = "p4"
STEP = 0.01  # N, of differences


def commands(first: int, find: list[str], lacks: bool) -> dict[str, float | list[float] | bool]:
    """Errors of the end and of the tensions at the cases that had no part in the calibration."""
    spec = load_spec(CASES, CasesSpec)
    lab = load_lab(spec, CASES.parent)
    cases = lab.read(CASES.parent / spec.measurements)
    given, others = cases.only(np.arange(first)), cases.only(np.arange(first, len(cases)))
    prior = discrepancy_of(given) if lacks else None
    rig = lab.rig(find, tuple(dict.fromkeys(cases.sessions)), prior)
    rig, fitted = fit_with_discrepancy(rig, given, Scatter(spec.scatter))
    end, tips, tensions = lab.markers.index(END), [], []
    for i in range(len(others)):
        case = others.only(np.array([i]))
        tips.append(float(np.linalg.norm(_end(rig, fitted, case, case.forces[0], end) - case.target[0, end])))
        tensions.append(float(np.abs(_commanded(rig, fitted, case, end) - case.forces[0]).max()))
    return {
        "discrepancy": lacks,
        "tip_mm": [float(np.mean(tips)), max(tips)],
        "tension_N": [float(np.mean(tensions)), max(tensions)],
        "tensions_N": tensions,
    }


def _end(rig: Rig, fitted: CaseFit, case: Cases, forces: np.ndarray, end: int) -> np.ndarray:
    """Place (3,) mm of the end at forces (n_a,)."""
    return rig.see(replace(case, forces=forces[None]), fitted.z, fitted.d, slopes=False).y[0, end]


def _commanded(rig: Rig, fitted: CaseFit, case: Cases, end: int) -> np.ndarray:
    """Forces (n_a,) at least 0 with which the end comes closest to where it was measured."""

    def miss(forces: np.ndarray) -> np.ndarray:
        return _end(rig, fitted, case, forces, end) - case.target[0, end]

    bounds = (0.0, 1.5 * np.abs(case.forces).max())
    start = np.clip(case.forces[0], 0.1, bounds[1])
    return least_squares(miss, start, bounds=bounds, diff_step=STEP, xtol=1e-4).x


def main() -> None:
    """Prints the errors of both models as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--first", type=int, default=5)
    parser.add_argument("--quick", action="store_true", help="one parameter, eleven cases")
    given = parser.parse_args()
    mesh(CASES.with_name("scene.yaml"), [], None, Options(quiet=True))
    find = ["young"] if given.quick else load_spec(CASES, CasesSpec).find
    rows = [commands(11 if given.quick else given.first, find, lacks) for lacks in (False, True)]
    print(json.dumps(rows, indent=2))


if __name__ == "__main__":
    main()
