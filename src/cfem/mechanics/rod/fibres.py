"""The fibres of a rod of rubber: each is stretched along the rod and contracts sideways as it likes.

A fibre at (y, z) of a section has the stretch lam = 1 + eps + kappa_y z - kappa_z y, and as incompressible neo-Hookean
rubber the energy W = E / 6 (lam^2 + 2 / lam - 3) a volume, E / 2 eps^2 where it is small. Over a disc of radius R the
sum depends on eps and k = |kappa| alone,

    w(eps, k) = A 2 / pi int_-1^1 W(1 + eps + k R t) sqrt(1 - t^2) dt,

found by Gauss's rule for that weight (Chebyshev of the second kind)."""

from dataclasses import dataclass

import numpy as np

_COUNT = 9
_ANGLE = np.arange(1, _COUNT + 1) * np.pi / (_COUNT + 1)
_T, _WEIGHT = np.cos(_ANGLE), 2 / (_COUNT + 1) * np.sin(_ANGLE) ** 2
_STRAIGHT = 1e-7  # bending strain below which the limit is used
_SHORTEST = 0.05  # stretch below which a fibre is taken further by its tangent


@dataclass(frozen=True)
class NonlinearResponse:
    """Response of fibres of rubber beyond the linear law, at strains (eps, kappa_y, kappa_z).

    energy: (m,) N
    force: (m, 3) N, N mm
    tangent: (m, 3, 3)"""

    energy: np.ndarray
    force: np.ndarray
    tangent: np.ndarray


def beyond_linear(
    eps: np.ndarray, kappa: np.ndarray, young: np.ndarray, area: np.ndarray, radius: np.ndarray
) -> NonlinearResponse:
    """Response of fibres at eps (m,), kappa (m, 2) 1/mm; young (m,) MPa; area (m,) mm^2 and radius (m,) mm of the
    section."""
    k = np.linalg.norm(kappa, axis=1)
    arm = radius[:, None] * _T
    W, first, second = (young[:, None] * part for part in _law(1 + eps[:, None] + k[:, None] * arm))
    scale = area[:, None] * _WEIGHT
    bending = area * radius**2 / 4
    straight = k * radius < _STRAIGHT
    safe = np.where(straight, 1.0, k)
    direction = kappa / safe[:, None]
    by_eps, by_k = (scale * first).sum(axis=1), (scale * first * arm).sum(axis=1)
    eps_eps, eps_k, k_k = ((scale * second * arm**power).sum(axis=1) for power in (0, 1, 2))
    over_k = np.where(straight, k_k, by_k / safe)
    energy = (scale * W).sum(axis=1) - young / 2 * (area * eps**2 + bending * k**2)
    force = np.empty((len(eps), 3))
    force[:, 0], force[:, 1:] = by_eps - young * area * eps, (over_k - young * bending)[:, None] * kappa
    tangent = np.zeros((len(eps), 3, 3))
    tangent[:, 0, 0] = eps_eps - young * area
    tangent[:, 0, 1:] = tangent[:, 1:, 0] = eps_k[:, None] * direction
    tangent[:, 1:, 1:] = (over_k - young * bending)[:, None, None] * np.eye(2)
    tangent[:, 1:, 1:] += (
        np.where(straight, 0.0, k_k - over_k)[:, None, None] * direction[:, :, None] * direction[:, None]
    )
    return NonlinearResponse(energy, force, tangent)


def _law(lam: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """W / E and its two derivatives; below the shortest stretch as the parabola that continues it there."""
    lam_held = np.maximum(lam, _SHORTEST)
    W, first, second = (lam_held**2 + 2 / lam_held - 3) / 6, (lam_held - lam_held**-2) / 3, (1 + 2 * lam_held**-3) / 3
    past = lam - lam_held
    return W + first * past + second * past**2 / 2, first + second * past, second
