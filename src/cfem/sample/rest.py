"""Rest of each design's effectors, from the scene alone."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from cfem.condensed.parameters import Parameter, references
from cfem.core.errors import SpecError
from cfem.robot.places import effector_points
from cfem.robot.shape.deform import displacement
from cfem.sample.parameters import with_values


def moves_effectors(parameters: Sequence[Parameter]) -> bool:
    """True if robots that differ in these parameters rest elsewhere."""
    return any(parameter.moves_body or parameter.key.startswith("effectors") for parameter in parameters)


class Rest:
    """Positions rest_e (n_e,) mm of the effectors of the scene's own robot; parameters: those that p (m, n_p) has
    values of.

    Every effector is a point of the scene, fixed or where the geometry has it; orientations rest at 0."""

    def __init__(self, scene: Any, parameters: Sequence[Parameter], rest_e: np.ndarray):
        """Rest positions at the ends of the parameters' ranges; scene, rest_e: of the reference."""
        self._scene, self._keys = scene, [parameter.key for parameter in parameters]
        self._moves = moves_effectors(parameters)
        self._rest_e = rest_e
        if not self._moves:
            return
        reference = references(parameters)
        ends = (
            np.array([parameter.high for parameter in parameters]),
            np.array([parameter.low for parameter in parameters]),
        )
        base = self._at(reference)
        self._slope = np.stack(
            [
                (self._at(np.where(i == np.arange(len(reference)), ends[0], reference)) - base)
                / (ends[0] - reference)[i]
                for i in range(len(reference))
            ],
            axis=1,
        )
        self._base, self._reference = base, reference
        # places that are no sums of the parameters are looked up one by one
        self._affine = np.allclose(self._line(ends[1]), self._at(ends[1]), rtol=0, atol=1e-9)

    def __call__(self, p: np.ndarray) -> np.ndarray:
        """Rest positions (m, n_e) of robots p (m, n_p)."""
        if not self._moves:
            return np.broadcast_to(self._rest_e, (len(p), len(self._rest_e)))
        return self._line(p) if self._affine else np.array([self._at(row) for row in p])

    def _line(self, p: np.ndarray) -> np.ndarray:
        return self._base + (p - self._reference) @ self._slope.T

    def _at(self, p: np.ndarray) -> np.ndarray:
        """Positions of the effectors at rest of the scene with p (n_p,)."""
        scene = with_values(self._scene, self._keys, p)
        places = []
        for item in scene.effectors:
            point = np.asarray(effector_points(scene, item), float)
            if point.ndim != 1:
                do = "watch one point"
                raise SpecError(f"effector '{item.name}' of several points cannot follow a varied geometry", do=do)
            if scene.shape is not None:
                point = point + displacement(scene.shape.controls, point[None])[0]
            axes = dict(zip("xyz", point, strict=True))
            places += [axes.get(axis, 0.0) for axis in item.axes]
        return np.array(places)
