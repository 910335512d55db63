"""Robots of all designs of a scene: on its mesh while that stretches to the design, else on a mesh of the design's own.

A mesh of a design's own serves the designs near to it as the scene's mesh does: it is stretched to them, so that a
search there, and its gradients, stay on one mesh. Where a path of designs goes over from one mesh to another, W jumps
by the difference of two discretisations. `jumps` measures that at the edge of what the scene's mesh stretches to. A
free form that folds the body folds it on every mesh: it is refused."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cfem.condensed.parameters import Parameter, references, sampled
from cfem.core.console.progress import doing
from cfem.core.errors import NumericalError, SpecError
from cfem.robot.mesh.accuracy import scene_mesh
from cfem.robot.shape.morph import Unreachable
from cfem.sample.family import RobotFamily
from cfem.sample.parameters import with_values

_HALVINGS = 8  # of the way to a design, to find the edge of what a mesh stretches to
MOST = 8  # meshes of designs' own


@dataclass(frozen=True)
class OwnMesh:
    """A mesh of a design's own: p (n_p,) of the design; cells: how many."""

    p: np.ndarray
    family: RobotFamily
    cells: int


class Meshes:
    """Meshes of a scene's designs. folder: that of the scene; None: a design to which the scene's mesh does not stretch
    is refused."""

    def __init__(self, scene: Any, mesh: Any, parameters: Sequence[Parameter], folder: Path | None = None):
        self._scene, self._folder = scene, folder
        self.parameters = sampled(parameters)
        self.main = RobotFamily(scene, mesh, self.parameters)
        self.own: list[OwnMesh] = []

    def of(self, p: np.ndarray) -> tuple[RobotFamily, Any]:
        """The family whose mesh serves p (n_p,), and its robot. NumericalError where none does."""
        try:
            return self.main, self.main.at(p)
        except Unreachable:
            if self._folder is None:
                raise
        for remeshed in sorted(self.own, key=lambda candidate: self._distance(candidate.p, p)):
            try:
                return remeshed.family, remeshed.family.at(p)
            except Unreachable:
                continue
        if len(self.own) >= MOST:
            raise NumericalError(
                f"{MOST} designs have meshes of their own already, and the search asks for another",
                do="narrow the ranges, or make the mesh of a scene in their middle",
            )
        added = self._meshed(p)
        self.own.append(added)
        return added.family, added.family.at(p)

    def edge(self, remeshed: OwnMesh) -> np.ndarray:
        """Last design (n_p,) on the straight way from the scene's own to that of `remeshed` to which the scene's mesh
        stretches."""
        begin = references(self.parameters)
        low, high = 0.0, 1.0
        for _ in range(_HALVINGS):
            middle = (low + high) / 2
            try:
                self.main.at(begin + middle * (remeshed.p - begin))
                low = middle
            except NumericalError:
                high = middle
        return begin + low * (remeshed.p - begin)

    def _meshed(self, p: np.ndarray) -> OwnMesh:
        """A mesh of the design p (n_p,). NumericalError where its geometry cannot be meshed."""
        scene = with_values(self._scene, [parameter.key for parameter in self.parameters], p)
        doing("meshing a design again")
        try:
            mesh, *_ = scene_mesh(scene, self._folder)
            return OwnMesh(p.copy(), RobotFamily(scene, mesh, self.parameters), len(mesh.cells))
        except SpecError as error:  # a geometry that is no body, or whose surfaces are others than the scene's
            named = ", ".join(
                f"{parameter.name} {value:.4g}" for parameter, value in zip(self.parameters, p, strict=True)
            )
            raise NumericalError(f"cannot be meshed again: {error}", where=f"design {named}") from None

    def _distance(self, p: np.ndarray, q: np.ndarray) -> float:
        width = np.array([parameter.high - parameter.low for parameter in self.parameters])
        return float((np.abs(p - q) / width).max())
