"""Points that rigid sections of a body carry: a point in the plane of a section is an affine combination of its nodes,
and one between two sections lies on the line between the points that they carry."""

import numpy as np

from cfem.constraint.attachment import Attachment, show
from cfem.constraint.carrier import Carrier
from cfem.constraint.effector import CombinedEffector, PointEffector, RotationEffector
from cfem.constraint.protocol import Watched
from cfem.core.errors import SpecError


def attach_to_sections(X: np.ndarray, sections: list[np.ndarray], point: np.ndarray, name: str) -> Attachment:
    """Attachment of `point` (3,) mm, within the section's outline or not; sections: nodes (k,) in planes across x, from
    the base on. SpecError where it lies before the first section or beyond the last."""
    point = np.asarray(point, dtype=float)
    places = np.array([X[nodes, 0].mean() for nodes in sections])
    slack = 1e-9 * np.ptp(places)
    if not places[0] - slack <= point[0] <= places[-1] + slack:
        raise SpecError(
            f"{name} at {show(point)} mm lies outside the sections, x from {places[0]:g} to {places[-1]:g} mm",
            do="move it between the base and the tip",
        )
    high = int(np.clip(np.searchsorted(places, point[0] - slack), 1, len(places) - 1))
    share = float(np.clip((point[0] - places[high - 1]) / (places[high] - places[high - 1]), 0.0, 1.0))
    carriers = [(sections[high - 1], 1 - share), (sections[high], share)]
    parts = [(nodes, weight * _affine(X[nodes], point)) for nodes, weight in carriers if weight > slack]
    nodes, weights = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    return Attachment(nodes, weights, point)


def make_section_effector(
    X: np.ndarray, sections: list[np.ndarray], points: np.ndarray, name: str, orientation: bool = False
) -> Watched:
    """Effector of points that sections carry, as `cfem.constraint.effector.make_effector` makes it of others; the
    orientation is that of the section nearest to their mean."""
    points = np.atleast_2d(np.asarray(points, dtype=float))
    label = f"effector '{name}'"
    parts: list[Watched] = [PointEffector(attach_to_sections(X, sections, point, label)) for point in points]
    matrix = np.tile(np.eye(3), len(points)) / len(points)
    if orientation:
        nearest = min(sections, key=lambda nodes: abs(X[nodes, 0].mean() - points[:, 0].mean()))
        centre = X[nearest].mean(axis=0)
        parts.append(
            RotationEffector(Carrier(nearest, np.full(len(nearest), 1 / len(nearest)), centre, X[nearest] - centre))
        )
        matrix = np.block([[matrix, np.zeros((3, 3))], [np.zeros_like(matrix), np.eye(3)]])
    if len(parts) == 1:
        return parts[0]
    return CombinedEffector(tuple(parts), matrix, np.unique(np.concatenate([part.nodes for part in parts])))


def _affine(nodes: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Weights (k,) of nodes (k, 3) of a plane x = constant, of sum 1, that give the y and z of `point`."""
    arm = nodes[:, 1:] - nodes[:, 1:].mean(axis=0)
    return 1 / len(nodes) + arm @ np.linalg.solve(arm.T @ arm, point[1:] - nodes[:, 1:].mean(axis=0))
