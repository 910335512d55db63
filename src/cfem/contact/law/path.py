"""Forces of many points by following them from no friction to the friction that is asked for.

Where Newton's method on the law F(lambda, mu) = 0 fails (`cfem.contact.law.newton`), its solutions are followed as a
curve z = (lambda, mu), by the length along it: where the curve turns back towards less friction, so does the walk
(Allgower and Georg, *Numerical Continuation Methods*, 1990). The curve has corners where a point opens, sticks or
slips: there the determinant of the equations, bordered by the tangent, keeps its sign, which says where it goes on.

Where W is positive definite, there is a state at every friction, and the curve can neither end nor grow without bound
before it gets there. Friction does no positive work and normal forces act at no gap, so that lambda . (W lambda + free)
<= 0: no state is larger than |free| over the smallest eigenvalue of W. The same holds for the one state of the convex
problem whose friction is bounded by given numbers instead of mu lambda_n. It changes continuously with these numbers,
so that by Brouwer's theorem some of them are mu times its own normal forces."""

import numpy as np

from cfem.contact.law.newton import by_friction, newton, normal_forces, projected, scaled

STEPS = 20000  # systems
CORRECTIONS = 8  # of Newton's method back to the curve
LONGEST, FIRST, SHORTEST = 1.0, 0.1, 1e-7  # steps, in units of the largest force; the longest times a friction above 1
ACROSS, ONWARDS = 1e-5, 1e-4  # beyond a corner: where the derivatives of the next piece are asked, and first step on it
FARTHEST = 1.2  # of a step: how far the curve may be from where it began, so that no other branch is taken for it
CLOSE = 1e-10


def along_friction(W: np.ndarray, free: np.ndarray, mu: float) -> tuple[np.ndarray | None, int]:
    """Forces (m, 3) N in the frames of the surface, None where the path was lost or the systems allowed were used up,
    and how many were solved. W (3m, 3m) mm/N, free (3m,) mm: see `cfem.contact.law.problem`; mu: of friction."""
    equation = scaled(W, free)
    begin = normal_forces(W, free) if mu == 0 or definite(W) else None  # else there may be no state, and no end
    if equation is None or begin is None or mu == 0 or not begin.any():
        return begin, 1
    size = np.abs(begin).max()
    curve = _Curve(equation[0], equation[1] / size)
    z, step = np.append(begin.ravel() / size, 0.0), FIRST
    tangent = curve.tangent(z, None)
    while curve.systems < STEPS:
        candidate = curve.near(z, tangent, step)
        if candidate is None and step > SHORTEST:
            step /= 2
            continue
        if candidate is None:  # a corner, at which the curve turns by more than a right angle
            tangent = curve.tangent(z + ACROSS * tangent, tangent)
            candidate = None if tangent is None else curve.near(z, tangent, ONWARDS)
            step = ONWARDS
            if candidate is None:
                break
        if candidate[-1] >= mu:
            share = (mu - z[-1]) / (candidate[-1] - z[-1])
            lam, systems = newton(W, free, mu, (z + share * (candidate - z))[:-1].reshape(-1, 3) * size)
            curve.systems += systems
            if lam is not None:
                return lam, curve.systems
            if step <= SHORTEST:
                break
            step /= 4
            continue
        z, step = candidate, min(1.5 * step, LONGEST * max(1.0, candidate[-1]))
        tangent = curve.tangent(z, tangent)
        if tangent is None or z[-1] < 0:
            break
    return None, curve.systems


def definite(W: np.ndarray) -> bool:
    """True where W is positive definite."""
    try:
        np.linalg.cholesky(W)
    except np.linalg.LinAlgError:
        return False
    return True


class _Curve:
    """F(lambda, mu) = lambda - P(A lambda - constant; mu) = 0 and the sign of its bordered determinant."""

    def __init__(self, A: np.ndarray, constant: np.ndarray):
        self.A, self.constant, self.m, self.systems, self.sign = A, constant, len(A) // 3, 0, 0.0

    def _at(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """F (n,), and its derivatives (n, n + 1)."""
        n, p, mu = len(self.A), self.A @ z[:-1] - self.constant, max(z[-1], 0.0)
        P, D = projected(p, mu)
        J = np.empty((n, n + 1))
        J[:, :n] = np.eye(n) - (D @ self.A.reshape(self.m, 3, n)).reshape(n, n)
        J[:, n] = -by_friction(p, mu)
        return z[:-1] - P.ravel(), J

    def tangent(self, z: np.ndarray, last: np.ndarray | None) -> np.ndarray | None:
        """Tangent (n + 1,) of length 1, onwards from the direction `last`, at first towards more friction."""
        J, along = self._at(z)[1], np.eye(len(z))[-1]
        bordered = np.vstack([J, along if last is None else last])
        self.systems += 1
        try:
            direction = np.linalg.solve(bordered, along)
        except np.linalg.LinAlgError:
            return None
        direction /= np.linalg.norm(direction)
        bordered[-1] = direction
        sign = np.linalg.slogdet(bordered)[0]
        self.sign = self.sign or sign
        return direction * sign * self.sign

    def near(self, z: np.ndarray, tangent: np.ndarray, step: float) -> np.ndarray | None:
        """The point of the curve whose way from z has `step` along the tangent, None where Newton finds none near."""
        point = z + step * tangent
        for _ in range(CORRECTIONS):
            F, J = self._at(point)
            residual = np.append(F, tangent @ (point - z) - step)
            if np.abs(F).max() < CLOSE and abs(residual[-1]) < CLOSE * max(1.0, step):
                return point
            self.systems += 1
            try:
                point = point - np.linalg.solve(np.vstack([J, tangent]), residual)
            except np.linalg.LinAlgError:
                return None
            if not np.linalg.norm(point - z) <= FARTHEST * step:
                return None
        return None
