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
    """gradient (n_a,): mm a mm, or a mm^3, of the distance by the displacements of the actuators."""

    gradient: np.ndarray


def clearance(
    model: Predictor,
    delta_a: ArrayLike,
    obstacle: Obstacle,
    p: ArrayLike | None = None,
    tolerance: float = TOLERANCE,
) -> Clearance:
    """The smallest signed distance of the surface, with the actuators at delta_a (n_a,) mm, to an obstacle in the frame
    of the scene, to `tolerance` mm (`nearest_of_surface`). InputError as `Predictor.shape`."""
    delta_a = np.asarray(delta_a, float)
    found = nearest_of_surface(model.shape(delta_a, p), model.facets, obstacle, tolerance)
    moved = surface_gradient(model, delta_a, model.facets[found.triangle], p)
    return Clearance(**vars(found), gradient=np.einsum("c,cin,i->n", found.shares, moved, found.normal))


def surface_gradient(
    model: Predictor, delta_a: np.ndarray, nodes: np.ndarray, p: ArrayLike | None = None
) -> np.ndarray:
    """(c, 3, n_a): how surface nodes (c,) move with the displacements of the actuators, no contact held."""
    if isinstance(model, SerialPredictor):
        return model.surface_gradient(delta_a, nodes)
    return np.einsum("kci,kn->cin", model.skin.modes[:, nodes], row_gradient(model, delta_a, p))


def row_gradient(model: Predictor, delta_a: np.ndarray, p: ArrayLike | None = None) -> np.ndarray:
    """(k, n_a): how the rows of the skin change with the displacements of the actuators, no contact held."""
    if model.form == "displacement":
        return model.skin.gradient(*model.learned_inputs(delta_a, p))
    whole = model.whole(delta_a, p)
    return np.linalg.solve(whole.W[whole.rows.a, whole.rows.a], whole.W[whole.rows.a, whole.rows.s]).T
