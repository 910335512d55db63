"""The volume of a design: that of its CAD model, exact, as a polynomial in between."""

from collections.abc import Sequence
from functools import cached_property
from itertools import combinations_with_replacement
from typing import Any

import numpy as np
from scipy.stats import qmc

from cfem.condensed.parameters import Parameter, from_shares, references, shares
from cfem.core.errors import SpecError
from cfem.robot.catalogue.solids import CATALOGUE
from cfem.robot.mesh.meshing import measure
from cfem.sample.parameters import with_values

_DEGREE, _SPARE = 3, 3


class Volume:
    """Volume of the designs of a catalogue robot, fitted to as many CAD models as a polynomial of degree 3 has
    coefficients and a few more. error: mm^3, the largest on those CAD models that were left out of the fit."""

    def __init__(self, scene: Any, parameters: Sequence[Parameter]):
        if scene.shape is not None:
            raise SpecError("a robot with a free form has no CAD model to tell its volume", where="constraints")
        if type(scene.geometry) not in CATALOGUE:
            what = f"a geometry of kind {scene.geometry.kind} cannot be varied, and all designs have one volume"
            raise SpecError(what, where="volume", do="leave it out of objectives and constraints")
        self._scene, self._parameters = scene, tuple(parameters)
        self._shape = [i for i, parameter in enumerate(parameters) if parameter.key.startswith("geometry")]

    def __call__(self, p: np.ndarray) -> np.ndarray:
        """Volumes (m,) mm^3 of designs p (m, n_p)."""
        return self._powers(shares(self._parameters, p)[:, self._shape]) @ self._fit[0]

    @property
    def error(self) -> float:
        return self._fit[1]

    @cached_property
    def _fit(self) -> tuple[np.ndarray, float]:
        """Coefficients and error, found when first asked for: a CAD model takes a process of its own."""
        count = len(self._powers(np.zeros((1, len(self._shape))))[0])
        z = qmc.Halton(max(len(self._shape), 1), scramble=False).random(count + 2 * _SPARE)[:, : len(self._shape)]
        exact = np.array([self.exact(self._p(shares)) for shares in z])
        coefficients = np.linalg.lstsq(self._powers(z[_SPARE:]), exact[_SPARE:], rcond=None)[0]
        return coefficients, float(np.abs(self._powers(z) @ coefficients - exact)[:_SPARE].max())

    def exact(self, p: np.ndarray) -> float:
        """Volume in mm^3 of p (n_p,), by its CAD model."""
        keys = [parameter.key for parameter in self._parameters]
        geometry = with_values(self._scene, keys, p).geometry
        return measure(CATALOGUE[type(geometry)](geometry))[0]

    def _p(self, z: np.ndarray) -> np.ndarray:
        full = shares(self._parameters, references(self._parameters))
        full[self._shape] = z
        return from_shares(self._parameters, full)

    def _powers(self, z: np.ndarray) -> np.ndarray:
        """Monomials (m, M) of total degree up to 3 of z (m, n)."""
        n = z.shape[1]
        terms = [c for degree in range(_DEGREE + 1) for c in combinations_with_replacement(range(n), degree)]
        return np.stack([z[:, list(term)].prod(axis=1) for term in terms], axis=1)
