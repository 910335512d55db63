"""Start of a solve: Hermite prediction from solved states nearby.

Every solved state knows x, lambda and their derivatives by delta: dx/ddelta = dx/dlambda W^-1, dlambda/ddelta = W^-1
(of the actuators, and of the contacts where they are prescribed as well). A polynomial in delta, fitted to all of them
by weighted least squares, has an error of order degree + 1 in the distance. Its degree grows with the number of
neighbours, from the tangent of a single one. Where few are known, it is a polynomial of rotations and stretches
(system/rotation_strain.py), else of positions. Where the robots themselves differ, it is one in delta and in the
coordinates q of their parameters, by which a solve gives derivatives too (parameter_slopes.py)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import combinations_with_replacement

import numpy as np
from scipy.linalg import block_diag

from cfem.equilibrium import complementarity
from cfem.equilibrium.system.actuation import Actuation
from cfem.equilibrium.system.rotation_strain import RotationStrain
from cfem.equilibrium.system.solution import Equilibrium, State

NEIGHBOURS = 20
MAX_DEGREE = 6
# Equations a coefficient: values and gradients at scattered points are not independent of each other.
_EQUATIONS_PER_TERM = 1.5
# Degree of the polynomial up to which rotations and stretches are worth their time: above, positions are as near.
_SPARSE = 3
_TURNED = 10  # neighbours whose rotations and stretches are combined: 20 are no nearer, for twice the time
NO_PARAMETERS = np.zeros(0)


@dataclass(frozen=True)
class Knot:
    """A solved state.

    place: coordinates by which nearness is judged (those of the plan, or delta); delta (n_a,) mm; lam (n_a,) N;
    stiffness (n_a, n_a + n_q) N/mm: dlambda/ddelta = W_aa^-1, then dlambda/dq; x (n, 3) mm; dx (n, 3, n_a + n_q) its
    derivatives likewise; q (n_q,) coordinates of the robot's parameters. n_a counts the rows involved."""

    place: np.ndarray
    delta: np.ndarray
    lam: np.ndarray
    stiffness: np.ndarray
    x: np.ndarray
    dx: np.ndarray
    q: np.ndarray = field(default_factory=lambda: NO_PARAMETERS)

    @property
    def inputs(self) -> np.ndarray:
        """Inputs (n_a + n_q,) that the state is a function of."""
        return np.concatenate([self.delta, self.q])


def is_new(knots: Sequence[Knot], candidate: Knot, distance: float) -> bool:
    """True where no known state is within `distance` of the candidate: states that crowd together add cost, and
    noise."""
    return all(float(np.linalg.norm(known.place - candidate.place)) > distance for known in knots)


def knot(place: np.ndarray, solved: Equilibrium, contacts: bool = False, q: np.ndarray = NO_PARAMETERS) -> Knot:
    """Knot of a converged, condensed equilibrium, with slopes by q where there is any; contacts: whether their rows are
    involved, or free of force."""
    rows = solved.condensed.rows.active if contacts else solved.condensed.rows.a
    stiffness = np.linalg.inv(solved.condensed.W[rows, rows])
    n = len(stiffness)
    dx = np.einsum("nia,ab->nib", solved.response[:, :, :n], stiffness)
    if len(q):
        stiffness = np.hstack([stiffness, solved.slopes.lam])
        dx = np.concatenate([dx, solved.slopes.x], axis=2)
    return Knot(place, solved.delta[:n], solved.state.lam[:n], stiffness, solved.state.x, dx, q)


def predict(
    knots: Sequence[Knot],
    place: np.ndarray,
    actuation: Actuation,
    q: np.ndarray = NO_PARAMETERS,
    shape: RotationStrain | None = None,
) -> State | None:
    """State near the equilibrium under `actuation` of the robot at q, which is at `place`; None where nothing is solved
    yet. shape: coordinates in which states are combined, for robots without parameters; None: their positions.

    The pressure is left to the solver (empty): its derivatives are not among what a solve gives."""
    if not knots:
        return None
    distance = [float(((known.place - place) ** 2).sum()) for known in knots]
    nearest = np.argsort(distance, kind="stable")[:NEIGHBOURS]
    around = [knots[index] for index in nearest]
    turned = shape is not None and _degree(len(around), len(around[0].inputs)) <= _SPARSE
    around = around[:_TURNED] if turned else around
    for members in (around, around[:1]):
        local = _fit(members)
        matched = _match(local, actuation, q)
        if matched is not None:
            inputs, lam = matched
            x = local.combined(inputs, shape) if turned else local.x(inputs)
            if x is not None:
                return State(x, np.empty(0), lam)
    return State(around[0].x, np.empty(0), around[0].lam)


def following(
    solve: Callable[[Actuation, State | None], Equilibrium],
    start: Callable[[Sequence[Knot], np.ndarray, Actuation], State | None] = predict,
) -> Callable[[Actuation], Equilibrium]:
    """A solver of actuations that differ in their targets alone, from `solve` (actuation, start): it predicts the start
    of each state from the states that it has solved before."""
    knots: list[Knot] = []

    def from_those_before(actuation: Actuation) -> Equilibrium:
        solved = solve(actuation, start(knots, actuation.target, actuation))
        if solved.converged:
            knots.append(knot(actuation.target, solved))
        return solved

    return from_those_before


def nearest(knots: Sequence[Knot], place: np.ndarray) -> State | None:
    """The solved state nearest to `place`, as it is: in equilibrium, which a predicted one is not. Sections in a row
    step from it in their relative motions, farther than a polynomial of positions reaches."""
    if not knots:
        return None
    closest = min(knots, key=lambda known: float(((known.place - place) ** 2).sum()))
    return State(closest.x, np.empty(0), closest.lam)


@dataclass(frozen=True)
class _Local:
    """Polynomial in xi = to_xi (inputs - centre) as weights of the knots' values and xi-derivatives; n inputs.

    solution (terms, m (1 + n)) takes those to coefficients."""

    knots: Sequence[Knot]
    centre: np.ndarray
    to_xi: np.ndarray
    from_xi: np.ndarray
    exponents: np.ndarray
    solution: np.ndarray

    def weights(self, inputs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Weights (m,) of the values and (m, n) of the derivatives, whose sum is the polynomial at the inputs (n,)."""
        basis, _ = _monomials((self.to_xi @ (inputs - self.centre))[None], self.exponents)
        weights = (basis[0] @ self.solution).reshape(len(self.knots), -1)
        return weights[:, 0], weights[:, 1:] @ self.from_xi.T

    def lam(self, inputs: np.ndarray) -> np.ndarray:
        value, slope = self.weights(inputs)
        terms = zip(self.knots, value, slope, strict=True)
        return sum(w * known.lam + known.stiffness @ v for known, w, v in terms)

    def x(self, inputs: np.ndarray) -> np.ndarray:
        value, slope = self.weights(inputs)
        terms = zip(self.knots, value, slope, strict=True)
        first = self.knots[0].x  # relative to it, so that held nodes do not move by the rounding of the weights
        return first + sum(w * (known.x - first) + known.dx @ v for known, w, v in terms)

    def combined(self, inputs: np.ndarray, shape: RotationStrain) -> np.ndarray | None:
        """Positions (n, 3) mm by rotations and stretches; None where the knots are too far apart."""
        value, slope = self.weights(inputs)
        motions = np.stack([known.dx @ v for known, v in zip(self.knots, slope, strict=True)])
        return shape.combined(np.stack([known.x for known in self.knots]), motions, value)


def _fit(knots: Sequence[Knot]) -> _Local:
    """Polynomial around knots[0], the nearest. Distances are measured in energy, d^T W_aa^-1 d, which has the same unit
    for cables and chambers and stretches the directions in which the robot is stiff, and along each q by the farthest
    knot; near knots weigh more."""
    n_a, n = len(knots[0].delta), len(knots[0].inputs)
    offsets = np.array([known.inputs - knots[0].inputs for known in knots])
    root = _root(knots[0].stiffness[:, :n_a])
    size = np.sqrt(((offsets[:, :n_a] @ root.T) ** 2).sum(axis=1).max()) or 1.0
    reach = np.abs(offsets[:, n_a:]).max(axis=0)
    to_xi = block_diag(root / size, np.diag(1 / np.where(reach > 0, reach, 1.0)))
    from_xi = np.linalg.inv(to_xi)
    exponents = _exponents(n, _degree(len(knots), n))
    xi = offsets @ to_xi.T
    values, gradients = _monomials(xi, exponents)
    system = np.concatenate([values[:, None], gradients], axis=1)  # (m, 1 + n, terms)
    weight = (0.03 + (xi**2).sum(axis=1)) ** -3.0
    weighted = (weight[:, None, None] * system).reshape(-1, len(exponents))
    solution = np.linalg.pinv(weighted, rcond=1e-10) * np.repeat(weight, 1 + n)
    return _Local(knots, knots[0].inputs, to_xi, from_xi, exponents, solution)


def _root(stiffness: np.ndarray) -> np.ndarray:
    """Root R (n_a, n_a) of the stiffness, R^T R. Where contacts hold a robot that would buckle without them, the
    stiffness has negative eigenvalues, which count by their size: distances need no sign."""
    try:
        return np.linalg.cholesky(stiffness).T
    except np.linalg.LinAlgError:
        values, vectors = np.linalg.eigh((stiffness + stiffness.T) / 2)
        return np.sqrt(np.maximum(np.abs(values), 1e-12 * np.abs(values).max()))[:, None] * vectors.T


def _match(local: _Local, actuation: Actuation, q: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """(delta, q) and lam with lambda(delta, q) = offset + C^T mu and C delta = target, no one-sided row pushing, by
    Newton's method with the nearest knot's derivative throughout; None where it does not converge."""
    C, n_a, first = actuation.C, actuation.n, local.knots[0]
    yields = np.linalg.inv(first.stiffness[:, :n_a])
    S, unilateral = C @ yields @ C.T, actuation.unilateral
    delta, mu = first.delta, np.linalg.lstsq(C.T, first.lam - actuation.offset, rcond=None)[0]
    mu[unilateral] = np.maximum(mu[unilateral], 0.0)
    held = ~unilateral | (mu > 0) | (C @ delta <= actuation.target)
    smallest = np.inf
    for _ in range(30):
        free = yields @ (actuation.offset + C.T @ mu - local.lam(np.concatenate([delta, q])))
        gap = C @ (delta + free) - actuation.target
        try:
            dmu, held = complementarity.change(S, gap, mu, unilateral, held, np.zeros(len(C)))
        except np.linalg.LinAlgError:
            return None
        step = free + yields @ (C.T @ dmu)
        delta, mu = delta + step, mu + dmu
        size = float(np.linalg.norm(local.to_xi[:n_a, :n_a] @ step))
        if size < 1e-10:
            return np.concatenate([delta, q]), actuation.offset + C.T @ mu
        if size > 2 * smallest:
            return None
        smallest = min(smallest, size)
    return None


def _degree(knots: int, n: int) -> int:
    """Largest degree, at least 1, with enough equations."""
    degree = 1
    while degree < MAX_DEGREE and knots * (1 + n) >= _EQUATIONS_PER_TERM * len(_exponents(n, degree + 1)):
        degree += 1
    return degree


@lru_cache(maxsize=64)
def _exponents(n: int, degree: int) -> np.ndarray:
    """Exponents (terms, n) of all monomials up to the degree."""
    terms = [term for order in range(degree + 1) for term in combinations_with_replacement(range(n), order)]
    return np.array([[term.count(axis) for axis in range(n)] for term in terms])


def _monomials(xi: np.ndarray, exponents: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Values (m, terms) and gradients (m, n, terms) of the monomials at points (m, n)."""
    powers = xi[:, None, :] ** exponents
    gradients = np.empty((len(xi), xi.shape[1], len(exponents)))
    for axis in range(xi.shape[1]):
        lowered = powers.copy()
        lowered[:, :, axis] = exponents[:, axis] * xi[:, None, axis] ** np.maximum(exponents[:, axis] - 1, 0)
        gradients[:, axis] = lowered.prod(axis=2)
    return powers.prod(axis=2), gradients
