"""How far the body of a learned robot is from an obstacle, and how that changes with its actuators.

No finite elements are asked. The error of the distance is at most that of the shape where it is nearest, as a distance
changes by no more than the way, and the tolerance of the search between the nodes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from cfem.contact.clearance import TOLERANCE, Nearest, nearest_of_surface
from cfem.contact.obstacle import Obstacle
from cfem.predict.protocol import Predictor
from cfem.predict.rows.serial import SerialPredictor


@dataclass(frozen=True)
class Clearance(Nearest):
    """Nearest point of a robot's surface to an obstacle. gradient (n_a,): derivatives of the distance by the
    displacements of the actuators, mm per mm or per mm^3."""

    gradient: np.ndarray


def clearance(
    model: Predictor,
    delta_a: ArrayLike,
    obstacle: Obstacle,
    tolerance: float = TOLERANCE,
) -> Clearance:
    """Smallest signed distance of the surface, with the actuators at delta_a (n_a,) mm, to an obstacle in the frame of
    the scene, to `tolerance` mm (`nearest_of_surface`). InputError as `Predictor.shape`."""
    delta_a = np.asarray(delta_a, float)
    nearest = nearest_of_surface(model.shape(delta_a), model.facets, obstacle, tolerance)
    moved = surface_gradient(model, delta_a, model.facets[nearest.triangle])
    return Clearance(**vars(nearest), gradient=np.einsum("c,cin,i->n", nearest.shares, moved, nearest.normal))


def surface_gradient(model: Predictor, delta_a: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """(c, 3, n_a): how surface nodes (c,) move with the displacements of the actuators, no contact held."""
    if isinstance(model, SerialPredictor):
        return model.surface_gradient(delta_a, nodes)
    return np.einsum("kci,kn->cin", model.skin.modes[:, nodes], row_gradient(model, delta_a))


def row_gradient(model: Predictor, delta_a: np.ndarray) -> np.ndarray:
    """Derivatives (k, n_a) of the rows of the skin by the displacements of the actuators, no contact held."""
    if model.form == "displacement":
        return model.skin.gradient(*model.learned_inputs(delta_a, None))
    with_skin = model.whole(delta_a)
    a, s = with_skin.rows.a, with_skin.rows.s
    return np.linalg.solve(with_skin.W[a, a], with_skin.W[a, s]).T
