"""The quadratic programs of one choice of contact modes: the contact's unknowns follow from lambda_a, exactly where its
equations are linear, by sequential programs where points slip on a circle."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np

from cfem.contact import ContactProblem, Law, Mode, check, solve_contact
from cfem.contact.modes import CONDITION, directions, linear_equations, slip_equations, start_angles, with_angles
from cfem.control.contact.bounds import Inequality, both, demands, near, opposed, tangent
from cfem.control.contact.linearisation import ContactAim, ContactInverse, ContactInverseStatus, ContactLinearisation
from cfem.control.inverse import Limits
from cfem.control.qp import QpStatus, solve_qp

_CUTS, _STEPS, _TURN = 40, 40, 0.5  # rounds of cutting a circle, of linearising a slip; rad a step
_CORNERS = 3  # actuators up to which the corners of their box are starts


@dataclass(frozen=True)
class _Answer:
    """lambda_a and the normalised contact unknowns (lam, xi, ...) of one choice of modes."""

    lambda_a: np.ndarray
    y: np.ndarray


class Program:
    """What all choices of modes share. rest: (n_a,) N, the actuation nearest to none."""

    def __init__(self, now: ContactLinearisation, law: Law, aim: ContactAim, limits: Limits) -> None:
        self.now, self.law, self.aim, self.limits = now, law, aim, limits
        self.p, self.units = now.contact.normalised, now.contact.units
        self.by_actuation = now.W_ac.T / self.units.length  # of the normalised free gaps
        self.rest = np.clip(np.zeros(len(now.free_a)), *limits.lambda_a.T)

    def best(self, modes: tuple[Mode, ...]) -> ContactInverse | None:
        """The best answer with these modes, None where there is none."""
        found = [self._result(modes, each) for each in self._answers(modes)]
        return min((each for each in found if each.check.valid()), key=lambda each: each.objective, default=None)

    def _answers(self, modes: tuple[Mode, ...]) -> Iterator[_Answer]:
        slipping = modes.count(Mode.SLIP) if self.law == "coulomb" and self.p.mu > 0 else 0
        if slipping and self.p.cone == "exact":
            for angles in start_angles(slipping, quick=True):
                yield from self._follow(modes, *self._start(modes, angles))
            for x, y in self._states.get(modes, []):
                yield from self._follow(modes, x, y)
            return
        sides = range(2 * self.p.sides) if slipping else range(0)
        for piece in product(sides, repeat=slipping):
            angles, corners = directions(self.p, np.array(piece, int))
            bounds = demands(self.p, self.law, modes, piece, 0)
            yield from self._linear(modes, angles, corners, bounds)

    def _linear(
        self, modes: tuple[Mode, ...], angles: np.ndarray, corners: np.ndarray, bounds: Inequality
    ) -> Iterator[_Answer]:
        M, c, S = (each[0] for each in linear_equations(self.p, modes, angles[None], corners[None]))
        if np.linalg.cond(M) < CONDITION:
            y = np.linalg.solve(M, np.column_stack([c, -S @ self.by_actuation]))
            yield from self._minimise(y[:, 0], y[:, 1:], bounds, self._sticking(modes))

    def _start(self, modes: tuple[Mode, ...], angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """lambda_a and contact unknowns: where friction along these directions alone, whatever the slip, would put
        the actuation."""
        along = both(demands(self.p, self.law, modes, (), 0), opposed(self.p, modes, angles))
        started = next(self._linear(modes, angles, np.ones(len(angles), bool), along), None)
        x = self.rest if started is None else started.lambda_a
        return x, with_angles(self._at(x), modes, angles[None])[0]

    @cached_property
    def _states(self) -> dict[tuple[Mode, ...], list[tuple[np.ndarray, np.ndarray]]]:
        """Slipping states of the contacts at rest and at the corners of a bounded box of a few actuators, by modes."""
        corners = [self.rest]
        if len(self.rest) <= _CORNERS and np.isfinite(self.limits.lambda_a).all():
            corners += [np.array(corner) for corner in product(*self.limits.lambda_a)]
        states: dict[tuple[Mode, ...], list[tuple[np.ndarray, np.ndarray]]] = {}
        for x in corners:
            found = solve_contact(self.now.at(x), self.law)
            friction = found.lam.reshape(-1, 3)[[i for i, mode in enumerate(found.modes) if mode is Mode.SLIP], 1:]
            if len(friction):
                angles = np.arctan2(friction[:, 1], friction[:, 0])
                y = with_angles(self._at(x), found.modes, angles[None])[0]
                states.setdefault(found.modes, []).append((x, y))
        return states

    def _follow(self, modes: tuple[Mode, ...], x: np.ndarray, y: np.ndarray) -> Iterator[_Answer]:
        """Sequential quadratic programming in lambda_a and the directions of slip, without the constraint's
        curvature; the shrinking turn ends what that leaves oscillating, and a last Newton makes it a state."""
        s = modes.count(Mode.SLIP)
        plain, turning = demands(self.p, self.law, modes, (), s), slice(len(y) - 2 * s, len(y) - s)
        either = replace(plain, low=np.where(plain.rest.any(axis=1), -np.inf, plain.low))
        for step in range(_STEPS):
            F, J, S = slip_equations(self._at(x), modes, y[None])
            if not np.linalg.cond(J[0]) < CONDITION:
                return
            moves = np.linalg.solve(J[0], np.column_stack([-F[0], -S @ self.by_actuation]))
            Y = moves[:, 1:]
            close = near(self.p, y[turning], turning, len(y), _TURN * min(1.0, 0.8 ** (step - 8)))
            # Far from the equations' solutions these may leave no room: then any turn, or alpha < 0, for this once.
            for bounds in (both(plain, close), plain, both(either, close), either):
                found = next(self._minimise(y + moves[:, 0] - Y @ x, Y, bounds, self._sticking(modes)), None)
                if found is not None:
                    break
            else:
                return
            change = np.abs(found.y - y).max() / (1 + np.abs(y).max())
            x, y = found.lambda_a, found.y
            if change < 1e-11:
                break
        for _ in range(5):
            F, J, _ = slip_equations(self._at(x), modes, y[None])
            if not np.linalg.cond(J[0]) < CONDITION:
                return
            y = y - np.linalg.solve(J[0], F[0])
        yield _Answer(x, y)

    def _at(self, lambda_a: np.ndarray) -> ContactProblem:
        return replace(self.p, free=self.p.free + self.by_actuation @ lambda_a)

    def _result(self, modes: tuple[Mode, ...], found: _Answer) -> ContactInverse:
        now, x = self.now, found.lambda_a
        n3, k = len(self.p.free), self.p.k
        lam, xi = found.y[:n3] * self.units.force, found.y[n3 : n3 + k] * self.units.motion
        e = now.effectors(x, lam, xi)
        account = check(now.at(x), self.law, lam, xi)
        return ContactInverse(
            x,
            lam,
            xi,
            e,
            now.course(x, lam),
            modes,
            self.aim.cost(e, x),
            account,
            ContactInverseStatus.SOLVED,
            0,
        )

    def _minimise(self, y: np.ndarray, Y: np.ndarray, bounds: Inequality, sticking: list[int]) -> Iterator[_Answer]:
        """The best lambda_a where the contact's unknowns are y + Y lambda_a; nothing where there is none. The
        circles of sticking points are cut by tangents where the answer exceeds them, until it does not."""
        now, n3, k = self.now, len(self.p.free), self.p.k
        force, motion = self.units.force, self.units.motion
        y_c, Y_c, y_x, Y_x = y[:n3] * force, Y[:n3] * force, y[n3 : n3 + k] * motion, Y[n3 : n3 + k].T * motion
        E = np.zeros((len(now.free_e), k)) if now.E is None else now.E
        pull = self.aim.weights[:, None] * (now.W_ea + now.W_ec @ Y_c + E @ Y_x.T)
        wanted = self.aim.weights * (self.aim.goal - now.free_e - now.W_ec @ y_c - E @ y_x)
        M, d = np.vstack([pull, np.diag(self.aim.ridge)]), np.concatenate([wanted, np.zeros(len(now.free_a))])
        course = now.W_aa + now.W_ac @ Y_c
        low, high = self.limits.delta_a.T - (now.free_a + now.W_ac @ y_c)
        gap, by_gap = self._gap(y, Y)
        for _ in range(_CUTS):
            rows = bounds.gap @ by_gap + bounds.force @ Y[:n3] + bounds.rest @ Y[n3 + k :]
            at = bounds.gap @ gap + bounds.force @ y[:n3] + bounds.rest @ y[n3 + k :]
            qp = solve_qp(
                M,
                d,
                np.vstack([course, rows]),
                np.concatenate([low, bounds.low - at]),
                np.concatenate([high, np.full(len(rows), np.inf)]),
                self.limits.lambda_a,
            )
            if qp.status is not QpStatus.OPTIMAL:
                return
            state = y + Y @ qp.x
            cuts = [cut for i in sticking if (cut := tangent(self.p, state, i)) is not None]
            if not cuts:
                break
            bounds = both(bounds, *cuts)
        yield _Answer(qp.x, state)

    def _gap(self, y: np.ndarray, Y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(3m,) and (3m, n_a): the gaps of y + Y lambda_a."""
        n3, k = len(self.p.free), self.p.k
        rows = np.hstack([self.p.W, -self.p.motion])
        return rows @ y[: n3 + k] + self.p.free, rows @ Y[: n3 + k] + self.by_actuation

    def _sticking(self, modes: tuple[Mode, ...]) -> list[int]:
        """The points whose friction is bound by a circle."""
        if self.law != "coulomb" or self.p.cone != "exact":
            return []
        return [i for i, mode in enumerate(modes) if mode is Mode.STICK]
