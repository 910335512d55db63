"""Walls of a body that face each other across a gap and push each other once it has closed, without friction.

Points of each face are paired at rest with the point of another face that lies straight before them, and keep this
partner. With p the place of the point, y that of its partner and n the normal of the partner's face as it is deformed,

    g = n . (p - y),        pressure = touching c^3,    c = (onset - g) / onset where g < onset, else none

touching: the pressure at which the gap is 0; then it grows in proportion, as 3 c - 2, so that Newton's method leaves
deep overlaps at once. Half of the energy comes from the points of either side. It is a function of the positions alone,
three times continuously differentiable but where walls overlap: forces are its exact gradient, and compliance and its
slope are continuous.
A point that slides along its partner meets the plane that touches the wall there (the "small sliding" of finite-element
codes): of a wall of curvature k, a slide by s is wrong by k s^2 / 2."""

from dataclasses import dataclass, replace

import numpy as np

from cfem.condensed.rotation import cross_matrix
from cfem.contact.surface.triangles import normals_of
from cfem.mechanics.assembly import add_blocks
from cfem.mechanics.element import triangle_slopes, triangle_values

_QUARTERS = (
    np.array(
        [
            [[2, 0, 0], [1, 1, 0], [1, 0, 1]],
            [[0, 2, 0], [0, 1, 1], [1, 1, 0]],
            [[0, 0, 2], [1, 0, 1], [0, 1, 1]],
            [[1, 1, 0], [0, 1, 1], [1, 0, 1]],
        ]
    )
    / 2
)
# Of the points of a face (12, 3): barycentric, of equal weight, three in each quarter. On a PneuNet with two cells
# across its wall, three points leave 0.2 mm of overlap and 12 leave 0.07 mm, which cost the same.
POINTS = (np.array([[4, 1, 1], [1, 4, 1], [1, 1, 4]]) / 6 @ _QUARTERS).reshape(-1, 3)

DEEP = 2.0  # closing c up to which a step of Newton's method may push walls that were less deep
LEAST = 0.1  # of a step: the smallest part that is taken


@dataclass(frozen=True)
class SelfContact:
    """Pairs of a point and its partner.

    nodes: (k, m) of the two faces, those of the point first
    shares: (k, 3, m) with which their places make p - y and the two tangents of the partner's face
    weights: (k,) mm^2 of half of the surface at rest that the point stands for
    onset: (k,) mm, the gap from which on they push each other
    closing: the onset's share of the gap at rest
    touching: MPa, pressure where the gap is 0"""

    nodes: np.ndarray
    shares: np.ndarray
    weights: np.ndarray
    onset: np.ndarray
    closing: float
    touching: float


@dataclass(frozen=True)
class SelfContactResponse:
    """Response at positions, of the pairs that push.

    energy: N mm
    gap: (k,) mm of all pairs
    pairs: (p,) numbers of those that push
    frames: (p, 3, 3) mm: p - y and the two tangents
    push: (p,) N; stiffness: (p,) N/mm"""

    energy: float
    gap: np.ndarray
    pairs: np.ndarray
    frames: np.ndarray
    push: np.ndarray
    stiffness: np.ndarray


def make_self_contact(
    X: np.ndarray,
    facets: np.ndarray,
    pairs: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray],
    closing: float,
    shear: float,
) -> SelfContact:
    """Self-contact of faces (f, 3 | 6) at X (n, 3) mm. pairs: the faces (k,) and barycentric places (k, 3) of POINTS of
    each face, and those of their partners (`cfem.contact.surface.facing`); closing: the onset's share of the gap at
    rest; shear: MPa, modulus of the softest wall."""
    face, place, partner, partner_place = pairs
    count = facets.shape[1]
    values, slopes = triangle_values(count, partner_place), triangle_slopes(count, partner_place)
    shares = np.zeros((len(face), 3, 2 * count))
    shares[:, 0, :count] = triangle_values(count, place)
    shares[:, 0, count:] = -values
    shares[:, 1, count:], shares[:, 2, count:] = slopes[..., 1] - slopes[..., 0], slopes[..., 2] - slopes[..., 0]
    nodes, unknown = np.concatenate([facets[face], facets[partner]], axis=1), np.ones(len(face))
    return at_rest(SelfContact(nodes, shares, unknown, unknown, closing, touching_pressure(shear)), X)


def at_rest(contact: SelfContact, X: np.ndarray) -> SelfContact:
    """Self-contact of the same pairs where the nodes rest at X (n, 3) mm."""
    areas = np.linalg.norm(normals_of(X[contact.nodes[:, :3]]), axis=1) / 2
    gap = _gaps(_frames(contact, X))[0]
    return replace(contact, weights=areas / len(POINTS) / 2, onset=contact.closing * gap)


def touching_pressure(shear: float) -> float:
    """Pressure, MPa, at which walls touch: a tenth of Young's modulus of an incompressible one of that shear modulus,
    which a wall of several times its thickness hardly ever bears."""
    return 0.1 * 3 * shear


def step_until_deep(contact: SelfContact, gap: np.ndarray, to: np.ndarray) -> float:
    """Part of a step from gaps (k,) mm to others at which the deepest pair has the closing DEEP; 1 where none comes to
    it, or one was there before.

    A linear step knows nothing of walls that are still apart. It would push them through each other, where forces are
    far from those of the state that is sought."""
    first, last = _closing(contact, gap), _closing(contact, to)
    return 1.0 if last <= DEEP or first >= DEEP else max(LEAST, (DEEP - first) / (last - first))


def is_deep(contact: SelfContact, x: np.ndarray) -> bool:
    """True where walls at positions x (n, 3) mm are deeper in each other than the closing DEEP."""
    return _closing(contact, _gaps(_frames(contact, x))[0]) > DEEP


def _closing(contact: SelfContact, gap: np.ndarray) -> float:
    """Closing c of the deepest pair at gaps (k,) mm."""
    return float(((contact.onset - gap) / contact.onset).max())


def response(contact: SelfContact, x: np.ndarray, force: np.ndarray) -> SelfContactResponse:
    """Response at positions x (n, 3) mm, the internal force added to `force` (n, 3) N."""
    frames = _frames(contact, x)
    gap = _gaps(frames)[0]
    (pairs,) = np.nonzero(gap < contact.onset)
    frames, onset, weights = frames[pairs], contact.onset[pairs], contact.weights[pairs]
    closing = (onset - gap[pairs]) / onset
    soft, beyond = np.minimum(closing, 1.0), np.maximum(closing - 1.0, 0.0)
    force_unit = contact.touching * weights
    push, stiffness = force_unit * (soft**3 + 3 * beyond), 3 * force_unit * soft**2 / onset
    energy = force_unit * onset @ (soft**4 / 4 + beyond + 1.5 * beyond**2)
    by_frame = -push[:, None, None] * _gradient(frames)
    np.add.at(force, contact.nodes[pairs], contact.shares[pairs].swapaxes(1, 2) @ by_frame)
    return SelfContactResponse(float(energy), gap, pairs, frames, push, stiffness)


def tangent(contact: SelfContact, state: SelfContactResponse, slots: np.ndarray, data: np.ndarray) -> None:
    """Adds the tangent stiffness (N/mm) to `data`, slots (k, m, m, 3) of the pairs' nodes."""
    shares, H = contact.shares[state.pairs], _curvature(state).reshape(-1, 3, 3, 3, 3)
    blocks = np.einsum("pam,paibj,pbn->pminj", shares, H, shares, optimize=True)
    size = 3 * contact.nodes.shape[1]
    add_blocks(blocks.reshape(-1, size, size), slots[state.pairs], data)


def tangent_form(contact: SelfContact, state: SelfContactResponse, motions: np.ndarray) -> np.ndarray:
    """Form M^T A M (k, k) N mm of the tangent stiffness A and motions M (n, 3, k) mm."""
    moved = np.einsum("pam,pmik->paik", contact.shares[state.pairs], motions[contact.nodes[state.pairs]], optimize=True)
    moved = moved.reshape(len(moved), 9, motions.shape[2])
    return np.tensordot(moved, _curvature(state) @ moved, axes=((0, 1), (0, 1)))


def _frames(contact: SelfContact, x: np.ndarray) -> np.ndarray:
    """Frames (k, 3, 3) mm: p - y and the two tangents."""
    return contact.shares @ x[contact.nodes]


def _gaps(frames: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Gaps (k,) mm, unit normals (k, 3), and lengths (k,) of the tangents' product."""
    apart, first, second = frames.swapaxes(0, 1)
    across = np.cross(first, second)
    length = np.linalg.norm(across, axis=1)
    normal = across / length[:, None]
    return (apart * normal).sum(axis=1), normal, length


def _gradient(frames: np.ndarray) -> np.ndarray:
    """Derivatives (p, 3, 3) of the gaps by p - y and the tangents."""
    gap, normal, length = _gaps(frames)
    apart, first, second = frames.swapaxes(0, 1)
    turning = (apart - gap[:, None] * normal) / length[:, None]
    return np.stack([normal, np.cross(second, turning), np.cross(turning, first)], axis=1)


def _curvature(state: SelfContactResponse) -> np.ndarray:
    """Second derivatives (p, 9, 9) N/mm of the energy by p - y and the tangents."""
    gap, normal, length = _gaps(state.frames)
    apart, first, second = state.frames.swapaxes(0, 1)
    turning = (apart - gap[:, None] * normal) / length[:, None]
    along = (np.eye(3) - normal[:, :, None] * normal[:, None]) / length[:, None, None]
    by_product = np.concatenate([np.zeros((len(gap), 3, 3)), -cross_matrix(second), cross_matrix(first)], axis=2)
    mixed = turning[:, :, None] * normal[:, None] / length[:, None, None]
    of_product = -(mixed + mixed.swapaxes(1, 2) + (gap / length)[:, None, None] * along)
    H = by_product.swapaxes(1, 2) @ of_product @ by_product
    straight = along @ by_product
    H[:, :3] += straight
    H[:, :, :3] += straight.swapaxes(1, 2)
    twist = cross_matrix(turning)
    H[:, 3:6, 6:] -= twist
    H[:, 6:, 3:6] += twist
    gradient = _gradient(state.frames).reshape(-1, 9)
    return state.stiffness[:, None, None] * gradient[:, :, None] * gradient[:, None] - state.push[:, None, None] * H
