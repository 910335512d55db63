"""A condensed model that moves, learned from a bar with one cable in this process: no meshing, no files."""

from functools import cache
from types import SimpleNamespace

import numpy as np
from fe_motion.moving import moving_bar

from cfem.condensed.packing import packed_indices
from cfem.condensed.viscosity import Viscosity
from cfem.equilibrium.solve import Wanted, solve
from cfem.equilibrium.system.actuation import displacement
from cfem.motion.model import MotionModel
from cfem.predict.series.chebyshev import Basis
from cfem.predict.series.domain import Domain
from cfem.predict.series.energy import Splitter
from cfem.surrogate.motion import fit_motion
from cfem.surrogate.series.spectral import fit

TAU = 2e-3
LARGEST = 3.0  # mm of cable


class Static:
    """Of the energy model alone, what motion asks for."""

    form, parameters = "displacement", ()

    def __init__(self, data, rest_e, arrays):
        rows, self.rest_e, self.length = data.rows, rest_e, 60.0
        self.rows, self.domain = rows, Domain.of(data.delta_a, data.lambda_a)
        self._basis, self._series = Basis(arrays["indices"]), arrays["series"].T
        self._to_box, self._offset = arrays["to_box"].T, arrays["offset"]
        self._split = Splitter(rows.n_a, rows.n_e)

    def parts(self, s, q):
        return self._split(self._basis(s @ self._to_box + self._offset) @ self._series)

    def gradient_and_hessian(self, s):
        part = self.parts(s, s[:0])
        return part["gradient"], part["hessian"]


class States(SimpleNamespace):
    def __len__(self):
        return len(self.delta_a)


@cache
def problem():
    return moving_bar([Viscosity(TAU)], element="tet4", divisions=(6, 1, 1), cables=1)


@cache
def states():
    full, found, start = problem(), [], None
    for delta in np.linspace(0.0, LARGEST, 13):
        solved = solve(full, displacement([delta]), start, slack=False, wanted=Wanted(mass=full.mass, loads=True))
        assert solved.converged
        found.append(solved)
        start = solved.state
    return found


def dataset():
    found, robot = states(), problem().robot
    names = ("delta_a", "delta_e", "lambda_a", "energy")
    stacked = {name: np.array([getattr(one, name) for one in found]) for name in names}
    W = np.array([one.condensed.W for one in found])
    own = {name: np.array([getattr(one.inertia, name) for one in found]) for name in ("V", "V2", "V3", "loss")}
    viscosity = [{"relaxation": TAU, "prony": []}]
    moving = SimpleNamespace(rows=robot.rows, W=W, dV=None, viscosity=viscosity, inner_M=None, **own)
    none = dict.fromkeys(("dW", "d2C", "dpsi_dp", "dlambda_dp", "ddelta_e_dp"))
    none["dC"] = np.array([one.dC[*packed_indices(one.dC.shape[-1], 3)] for one in found])
    p = np.zeros((len(found), 0))
    return States(rows=robot.rows, W=W, moving=moving, p=p, n_c=0, meta={"parameters": []}, **stacked, **none)


@cache
def model(viscous=True):
    data = dataset()
    arrays, _ = fit_motion(data, max_degree=8, folds=3)
    static = Static(data, problem().robot.rest_e, fit(data, max_degree=8, folds=3).arrays)
    viscosity = data.moving.viscosity if viscous else [{"relaxation": 0.0, "prony": []}]
    return MotionModel(static, arrays, viscosity)
