"""The inverse step through contact: which actuation, on one linearisation and under the contact law, brings the
effectors to their goal.

    minimise over lambda_a   |w (e - goal)|^2 / 2 + |r lambda_a|^2 / 2
    subject to               e = W_ea lambda_a + W_ec lambda_c + free_e + E xi
                             bounds of lambda_a and of delta_a = W_aa lambda_a + W_ac lambda_c + free_a
                             lambda_c, xi: a state of the contacts with gap rows
                             W_cc lambda_c + W_ca lambda_a + free_c - G xi

A mathematical program with equilibrium constraints (Luo, Pang, Ralph 1996): for every choice of modes the contact's
unknowns follow from lambda_a, which leaves a small quadratic program; the best choice wins. Where the law
allows several states at one lambda_a, the answer is the best of them: the plant may take another."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property
from itertools import product

import numpy as np

from cfem.contact import Check, ContactProblem, Law, Mode, check, solve_contact
from cfem.contact.modes import (
    CONDITION,
    directions,
    linear_equations,
    modes_of,
    slip_equations,
    start_angles,
    understood,
    with_angles,
)
from cfem.control.inverse import Limits
from cfem.control.qp import QpStatus, solve_qp

EXHAUSTIVE = 3  # points up to which every choice of modes is tried
_CUTS, _STEPS, _TURN = 40, 40, 0.5  # rounds of cutting a circle, of linearising a slip; rad a step
_CORNERS = 3  # actuators up to which the corners of their box are starts
_ROUNDED = 1e-10  # friction beyond the circle that is left, in the contact problem's own unit of force


@dataclass(frozen=True)
class ContactLinearisation:
    """W_ea (n_e, n_a), W_ec (n_e, 3m), W_aa (n_a, n_a), W_ac (n_a, 3m) mm/N; free_e (n_e,), free_a (n_a,) mm, at zero
    actuation and contact force; contact: its `free` is that of zero actuation; E (n_e, k): motion of the effector
    rows with the object's coordinates (an effector that is the object itself has W rows 0), None where they do not
    move."""

    W_ea: np.ndarray
    W_ec: np.ndarray
    W_aa: np.ndarray
    W_ac: np.ndarray
    free_e: np.ndarray
    free_a: np.ndarray
    contact: ContactProblem
    E: np.ndarray | None = None

    def at(self, lambda_a: np.ndarray) -> ContactProblem:
        """The contact problem at this actuation (n_a,) N."""
        return replace(self.contact, free=self.contact.free + self.W_ac.T @ lambda_a)

    def effectors(self, lambda_a: np.ndarray, lambda_c: np.ndarray, xi: np.ndarray) -> np.ndarray:
        """e (n_e,) mm."""
        moved = 0.0 if self.E is None else self.E @ xi
        return self.W_ea @ lambda_a + self.W_ec @ lambda_c + self.free_e + moved

    def course(self, lambda_a: np.ndarray, lambda_c: np.ndarray) -> np.ndarray:
        """delta_a (n_a,) mm."""
        return self.W_aa @ lambda_a + self.W_ac @ lambda_c + self.free_a


@dataclass(frozen=True)
class ContactAim:
    """goal (n_e,) mm; weights (n_e,), 0 for rows that do not matter; ridge (n_a,) mm/N, the regularisation r."""

    goal: np.ndarray
    weights: np.ndarray
    ridge: np.ndarray

    def cost(self, e: np.ndarray, lambda_a: np.ndarray) -> float:
        """mm^2."""
        missing, effort = self.weights * (e - self.goal), self.ridge * lambda_a
        return 0.5 * float(missing @ missing + effort @ effort)


class ContactInverseStatus(Enum):
    """How a solve ended; the value is the sentence that the user reads."""

    SOLVED = "solved"
    NONE = "no choice of contact modes that was tried has a state within the bounds"


@dataclass(frozen=True)
class ContactInverse:
    """lambda_a (n_a,), lambda_c (3m,) N, xi (k,), e (n_e,), delta_a (n_a,) mm, NaN and no modes where there is no
    answer; objective mm^2; check: of the contact state, by itself; tried: choices of modes."""

    lambda_a: np.ndarray
    lambda_c: np.ndarray
    xi: np.ndarray
    e: np.ndarray
    delta_a: np.ndarray
    modes: tuple[Mode, ...]
    objective: float
    check: Check
    status: ContactInverseStatus
    tried: int


@dataclass(frozen=True)
class _Answer:
    """lambda_a and the normalised contact unknowns (lam, xi, ...) of one choice of modes."""

    lambda_a: np.ndarray
    y: np.ndarray


@dataclass(frozen=True)
class _Inequality:
    """gap_rows @ gap + force_rows @ lam + extra @ rest >= low for y = (lam, xi, rest), normalised."""

    gap: np.ndarray
    force: np.ndarray
    rest: np.ndarray
    low: np.ndarray


def contact_inverse(
    now: ContactLinearisation,
    law: Law,
    aim: ContactAim,
    limits: Limits,
    start_modes: Sequence[Mode] | None = None,
    exhaustive: bool | None = None,
) -> ContactInverse:
    """start_modes: a guess, the present modes; exhaustive: try every choice of modes (by default up to three
    points), else descend from the guess to better neighbours, which differ in one point, while there are any.

    On the exact cone the directions of slip are optimised locally, from a few starts; all else is exact, but for
    modes which leave the contact's state undetermined at given lambda_a: those are passed over."""
    program = _Program(now, law, aim, limits)
    contact, known = now.contact, modes_of(now.contact, law)
    guess = understood(contact, law, start_modes or _guess(now, law, program.rest))
    tried: dict[tuple[Mode, ...], ContactInverse | None] = {}

    def cost(modes: tuple[Mode, ...]) -> float:
        if modes not in tried:
            tried[modes] = program.best(modes)
        found = tried[modes]
        return np.inf if found is None else found.objective

    if exhaustive or (exhaustive is None and contact.m <= EXHAUSTIVE):
        best = min([guess, *product(known, repeat=contact.m)], key=cost)
    else:
        best = guess
        while True:
            neighbours = [(*best[:i], other, *best[i + 1 :]) for i in range(contact.m) for other in known]
            nearest = min(neighbours, key=cost)
            if not cost(nearest) < cost(best):
                break
            best = nearest
    found = tried.get(best)
    return replace(found or _nothing(now), tried=len(tried))


def _guess(now: ContactLinearisation, law: Law, rest: np.ndarray) -> Sequence[Mode]:
    return solve_contact(now.at(rest), law).modes or [Mode.STICK] * now.contact.m


def _nothing(now: ContactLinearisation) -> ContactInverse:
    n_e, n_a = now.W_ea.shape
    sizes = (n_a, len(now.contact.free), now.contact.k, n_e, n_a)
    nan = float("nan")
    return ContactInverse(
        *(np.full(size, nan) for size in sizes), (), nan, Check(*[nan] * 6), ContactInverseStatus.NONE, 0
    )


class _Program:
    """What all choices of modes share."""

    def __init__(self, now: ContactLinearisation, law: Law, aim: ContactAim, limits: Limits) -> None:
        self.now, self.law, self.aim, self.limits = now, law, aim, limits
        self.p, self.units = now.contact.normalised, now.contact.units
        self.by_actuation = now.W_ac.T / self.units.length  # of the normalised free gaps
        self.rest = np.clip(np.zeros(len(now.free_a)), *limits.lambda_a.T)

    def best(self, modes: tuple[Mode, ...]) -> ContactInverse | None:
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
            bounds = self._inequalities(modes, piece, 0)
            yield from self._linear(modes, angles, corners, bounds)

    def _linear(
        self, modes: tuple[Mode, ...], angles: np.ndarray, corners: np.ndarray, bounds: _Inequality
    ) -> Iterator[_Answer]:
        M, c, S = (each[0] for each in linear_equations(self.p, modes, angles[None], corners[None]))
        if np.linalg.cond(M) < CONDITION:
            y = np.linalg.solve(M, np.column_stack([c, -S @ self.by_actuation]))
            yield from self._minimise(y[:, 0], y[:, 1:], bounds, self._sticking(modes))

    def _start(self, modes: tuple[Mode, ...], angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """lambda_a and contact unknowns: where friction along these directions alone, whatever the slip, would put
        the actuation."""
        along = _both(self._inequalities(modes, (), 0), self._opposed(modes, angles))
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
        plain, turning = self._inequalities(modes, (), s), slice(len(y) - 2 * s, len(y) - s)
        either = replace(plain, low=np.where(plain.rest.any(axis=1), -np.inf, plain.low))
        for step in range(_STEPS):
            F, J, S = slip_equations(self._at(x), modes, y[None])
            if not np.linalg.cond(J[0]) < CONDITION:
                return
            moves = np.linalg.solve(J[0], np.column_stack([-F[0], -S @ self.by_actuation]))
            Y = moves[:, 1:]
            near = self._near(y[turning], turning, len(y), _TURN * min(1.0, 0.8 ** (step - 8)))
            # Far from the equations' solutions these may leave no room: then any turn, or alpha < 0, for this once.
            for bounds in (_both(plain, near), plain, _both(either, near), either):
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

    def _opposed(self, modes: tuple[Mode, ...], angles: np.ndarray) -> _Inequality:
        """The slip has a component against the friction at `angles`."""
        rows = _Rows(len(self.p.free), 0)
        sliding = [i for i, mode in enumerate(modes) if mode is Mode.SLIP]
        for i, direction in zip(sliding, _turned(angles), strict=True):
            rows.gap(3 * i + 1, -direction)
        return rows.done()

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

    def _minimise(self, y: np.ndarray, Y: np.ndarray, bounds: _Inequality, sticking: list[int]) -> Iterator[_Answer]:
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
            cuts = [cut for i in sticking if (cut := self._cut(state, i, len(y))) is not None]
            if not cuts:
                break
            bounds = _both(bounds, *cuts)
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

    def _cut(self, state: np.ndarray, i: int, n: int) -> _Inequality | None:
        friction, normal = state[3 * i + 1 : 3 * i + 3], state[3 * i]
        size = float(np.linalg.norm(friction))
        if size <= self.p.mu * normal + _ROUNDED * max(1.0, size):
            return None
        rows = _Rows(len(self.p.free), n - len(self.p.free) - self.p.k)
        rows.friction(i, friction / size, self.p.mu)
        return rows.done()

    def _near(self, angles: np.ndarray, turning: slice, n: int, turn: float) -> _Inequality:
        n3, k = len(self.p.free), self.p.k
        rows = np.zeros((2 * len(angles), n))
        rows[: len(angles), turning], rows[len(angles) :, turning] = np.eye(len(angles)), -np.eye(len(angles))
        nothing = np.zeros((len(rows), n3))
        return _Inequality(nothing, nothing, rows[:, n3 + k :], np.concatenate([angles, -angles]) - turn)

    def _inequalities(self, modes: tuple[Mode, ...], piece: tuple[int, ...], unknown: int) -> _Inequality:
        """piece: corners and faces of the slipping points on the pyramid; unknown: slipping points whose angle
        and alpha are unknowns."""
        p, rows, half, slipping = self.p, _Rows(len(self.p.free), 2 * unknown), np.pi / self.p.sides, 0
        if self.law == "bilateral":
            return rows.done()
        for i, mode in enumerate(modes):
            if mode is Mode.OPEN:
                rows.gap(3 * i, [1.0])
                continue
            rows.force(3 * i, [1.0])
            if mode is Mode.STICK:
                sides = p.corners if p.cone == "exact" else _turned(np.arange(1, 2 * p.sides, 2) * half)
                for side in sides:
                    rows.friction(i, side, p.mu * (1.0 if p.cone == "exact" else np.cos(half)))
            elif unknown:
                rows.rest(unknown + slipping, 1.0)
                slipping += 1
            elif piece:
                at = piece[slipping]
                slipping += 1
                before, here, after = _turned(half * (at + np.array([-2, 0, 2])))
                if at % 2 == 0:
                    rows.gap(3 * i + 1, before - here)
                    rows.gap(3 * i + 1, after - here)
                else:
                    rows.gap(3 * i + 1, -here)
                    across = np.array([-here[1], here[0]])
                    rows.friction(i, across, p.mu * np.sin(half))
                    rows.friction(i, -across, p.mu * np.sin(half))
        return rows.done()


class _Rows:
    """Collects inequalities >= 0."""

    def __init__(self, n3: int, rest: int) -> None:
        self.sizes = (n3, n3, rest)
        self.found: list[tuple[int, int, np.ndarray]] = []

    def gap(self, at: int, weights: Sequence[float] | np.ndarray) -> None:
        self.found.append((0, at, np.asarray(weights)))

    def force(self, at: int, weights: Sequence[float] | np.ndarray) -> None:
        self.found.append((1, at, np.asarray(weights)))

    def rest(self, at: int, weight: float) -> None:
        self.found.append((2, at, np.array([weight])))

    def friction(self, i: int, direction: np.ndarray, limit: float) -> None:
        """direction . lambda_t <= limit lambda_n."""
        self.force(3 * i, [limit, -direction[0], -direction[1]])

    def done(self) -> _Inequality:
        blocks = [np.zeros((len(self.found), size)) for size in self.sizes]
        for row, (block, at, weights) in enumerate(self.found):
            blocks[block][row, at : at + len(weights)] = weights
        return _Inequality(*blocks, np.zeros(len(self.found)))


def _both(*parts: _Inequality) -> _Inequality:
    return _Inequality(
        *(np.concatenate([getattr(part, name) for part in parts]) for name in ("gap", "force", "rest", "low"))
    )


def _turned(angles: np.ndarray) -> np.ndarray:
    return np.column_stack([np.cos(angles), np.sin(angles)])
