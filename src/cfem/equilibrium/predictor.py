"""Where to start a solve: Hermite prediction from solved states nearby.

Every solved state knows x, lambda_a and their derivatives by delta_a: dx/ddelta_a = dx/dlambda_a W_aa^-1 and
dlambda_a/ddelta_a = W_aa^-1. A polynomial in delta_a, fitted to all of them by weighted least squares, errs by the
power degree + 1 of the distance; its degree grows with the number of neighbours, from the tangent of a single one."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations_with_replacement

import numpy as np

from cfem.equilibrium.actuation import Actuation
from cfem.equilibrium.solution import Equilibrium, State

NEIGHBOURS = 20
MAX_DEGREE = 6
# Equations a coefficient: values and gradients at scattered points are not independent of each other.
_EQUATIONS_PER_TERM = 1.5


@dataclass(frozen=True)
class Knot:
    """A solved state.

    place (n_a,): coordinates by which nearness is judged (those of the plan, or delta_a); delta_a (n_a,) mm;
    lambda_a (n_a,) N; stiffness (n_a, n_a) = W_aa^-1 N/mm; x (n, 3) mm; dx (n, 3, n_a) = dx/ddelta_a."""

    place: np.ndarray
    delta_a: np.ndarray
    lambda_a: np.ndarray
    stiffness: np.ndarray
    x: np.ndarray
    dx: np.ndarray


def is_new(knots: Sequence[Knot], candidate: Knot, distance: float) -> bool:
    """Whether no known state is within `distance` of the candidate: states that crowd together add cost, and noise."""
    return all(float(np.linalg.norm(known.place - candidate.place)) > distance for known in knots)


def knot(place: np.ndarray, solved: Equilibrium) -> Knot:
    """Of a converged, condensed equilibrium."""
    stiffness = np.linalg.inv(solved.condensed.W_aa)
    dx = np.einsum("nia,ab->nib", solved.dx_dlambda, stiffness)
    return Knot(place, solved.delta_a, solved.state.lambda_a, stiffness, solved.state.x, dx)


def predict(knots: Sequence[Knot], place: np.ndarray, actuation: Actuation) -> State | None:
    """State near the equilibrium under `actuation`, which is at `place` (n_a,); None where nothing is solved yet.

    The pressure is left to the solver (empty): its derivatives are not among what a solve gives."""
    if not knots:
        return None
    distance = [float(((known.place - place) ** 2).sum()) for known in knots]
    nearest = np.argsort(distance, kind="stable")[:NEIGHBOURS]
    around = [knots[index] for index in nearest]
    for members in (around, around[:1]):
        local = _fit(members)
        place = _match(local, actuation)
        if place is not None:
            delta_a, lambda_a = place
            return State(local.x(delta_a), np.empty(0), lambda_a)
    return State(around[0].x, np.empty(0), around[0].lambda_a)


@dataclass(frozen=True)
class _Local:
    """Polynomial in xi = to_xi (delta_a - centre) as weights of the knots' values and xi-derivatives.

    solution (terms, m (1 + n_a)) takes those to coefficients."""

    knots: Sequence[Knot]
    centre: np.ndarray
    to_xi: np.ndarray
    from_xi: np.ndarray
    exponents: np.ndarray
    solution: np.ndarray

    def weights(self, delta_a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(m,) of the values and (m, n_a) of the derivatives by delta_a, whose sum is the polynomial at delta_a."""
        basis, _ = _monomials((self.to_xi @ (delta_a - self.centre))[None], self.exponents)
        weights = (basis[0] @ self.solution).reshape(len(self.knots), -1)
        return weights[:, 0], weights[:, 1:] @ self.from_xi.T

    def lambda_a(self, delta_a: np.ndarray) -> np.ndarray:
        value, slope = self.weights(delta_a)
        terms = zip(self.knots, value, slope, strict=True)
        return sum(w * known.lambda_a + known.stiffness @ v for known, w, v in terms)

    def x(self, delta_a: np.ndarray) -> np.ndarray:
        value, slope = self.weights(delta_a)
        terms = zip(self.knots, value, slope, strict=True)
        first = self.knots[0].x  # relative to it, so that held nodes do not move by the rounding of the weights
        return first + sum(w * (known.x - first) + known.dx @ v for known, w, v in terms)


def _fit(knots: Sequence[Knot]) -> _Local:
    """Polynomial around knots[0], the nearest. Distances are measured in energy, d^T W_aa^-1 d, which has the same unit
    for cables and chambers and stretches the directions in which the robot is stiff; near knots weigh more."""
    n_a = len(knots[0].delta_a)
    offsets = np.array([known.delta_a - knots[0].delta_a for known in knots])
    root = np.linalg.cholesky(knots[0].stiffness).T
    size = np.sqrt(((offsets @ root.T) ** 2).sum(axis=1).max()) or 1.0
    to_xi = root / size
    from_xi = np.linalg.inv(to_xi)
    exponents = _exponents(n_a, _degree(len(knots), n_a))
    xi = offsets @ to_xi.T
    values, gradients = _monomials(xi, exponents)
    system = np.concatenate([values[:, None], gradients], axis=1)  # (m, 1 + n_a, terms)
    weight = (0.03 + (xi**2).sum(axis=1)) ** -3.0
    weighted = (weight[:, None, None] * system).reshape(-1, len(exponents))
    solution = np.linalg.pinv(weighted, rcond=1e-10) * np.repeat(weight, 1 + n_a)
    return _Local(knots, knots[0].delta_a, to_xi, from_xi, exponents, solution)


def _match(local: _Local, actuation: Actuation) -> tuple[np.ndarray, np.ndarray] | None:
    """delta_a and lambda_a with lambda(delta_a) = offset + C^T mu and C delta_a = target, by Newton's method with the
    nearest knot's derivative throughout; None where it does not converge."""
    C, n_a = actuation.C, actuation.n_a
    first = local.knots[0]
    jacobian = np.block([[first.stiffness, -C.T], [C, np.zeros((len(C), len(C)))]])
    delta_a, mu = first.delta_a, np.linalg.lstsq(C.T, first.lambda_a - actuation.offset, rcond=None)[0]
    smallest = np.inf
    for _ in range(30):
        lambda_a = actuation.offset + C.T @ mu
        residual = np.concatenate([local.lambda_a(delta_a) - lambda_a, C @ delta_a - actuation.target])
        step = np.linalg.solve(jacobian, -residual)
        delta_a, mu = delta_a + step[:n_a], mu + step[n_a:]
        size = float(np.linalg.norm(local.to_xi @ step[:n_a]))
        if size < 1e-10:
            return delta_a, actuation.offset + C.T @ mu
        if size > 2 * smallest:
            return None
        smallest = min(smallest, size)
    return None


def _degree(knots: int, n_a: int) -> int:
    """Largest degree, at least 1, with enough equations."""
    degree = 1
    while degree < MAX_DEGREE and knots * (1 + n_a) >= _EQUATIONS_PER_TERM * len(_exponents(n_a, degree + 1)):
        degree += 1
    return degree


@lru_cache(maxsize=64)
def _exponents(n_a: int, degree: int) -> np.ndarray:
    """(terms, n_a) of all monomials up to the degree."""
    terms = [term for order in range(degree + 1) for term in combinations_with_replacement(range(n_a), order)]
    return np.array([[term.count(axis) for axis in range(n_a)] for term in terms])


def _monomials(xi: np.ndarray, exponents: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(m, n_a) -> values (m, terms) and gradients (m, n_a, terms)."""
    powers = xi[:, None, :] ** exponents
    gradients = np.empty((len(xi), xi.shape[1], len(exponents)))
    for axis in range(xi.shape[1]):
        lowered = powers.copy()
        lowered[:, :, axis] = exponents[:, axis] * xi[:, None, axis] ** np.maximum(exponents[:, axis] - 1, 0)
        gradients[:, axis] = lowered.prod(axis=2)
    return powers.prod(axis=2), gradients
