"""What a choice of contact modes demands of a contact's state, as linear inequalities."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cfem.contact import ContactProblem, Law, Mode

ROUNDED = 1e-10  # friction beyond the circle that is left, in the contact problem's own unit of force


@dataclass(frozen=True)
class Inequality:
    """gap_rows @ gap + force_rows @ lam + extra @ rest >= low for y = (lam, xi, rest), normalised."""

    gap: np.ndarray
    force: np.ndarray
    rest: np.ndarray
    low: np.ndarray


def demands(p: ContactProblem, law: Law, modes: tuple[Mode, ...], piece: tuple[int, ...], unknown: int) -> Inequality:
    """Of a normalised problem. piece: corners and faces of the slipping points on the pyramid; unknown: slipping points
    whose angle and alpha are unknowns."""
    rows, half, slipping = _Rows(len(p.free), 2 * unknown), np.pi / p.sides, 0
    if law == "bilateral":
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


def opposed(p: ContactProblem, modes: tuple[Mode, ...], angles: np.ndarray) -> Inequality:
    """The slip has a component against the friction at `angles`."""
    rows = _Rows(len(p.free), 0)
    sliding = [i for i, mode in enumerate(modes) if mode is Mode.SLIP]
    for i, direction in zip(sliding, _turned(angles), strict=True):
        rows.gap(3 * i + 1, -direction)
    return rows.done()


def tangent(p: ContactProblem, state: np.ndarray, i: int) -> Inequality | None:
    """To the circle of friction of point i, where the state's (n,) exceeds it."""
    friction, normal = state[3 * i + 1 : 3 * i + 3], state[3 * i]
    size = float(np.linalg.norm(friction))
    if size <= p.mu * normal + ROUNDED * max(1.0, size):
        return None
    rows = _Rows(len(p.free), len(state) - len(p.free) - p.k)
    rows.friction(i, friction / size, p.mu)
    return rows.done()


def near(p: ContactProblem, angles: np.ndarray, turning: slice, n: int, turn: float) -> Inequality:
    """The unknowns `turning` of n are within `turn` rad of the angles."""
    n3, k = len(p.free), p.k
    rows = np.zeros((2 * len(angles), n))
    rows[: len(angles), turning], rows[len(angles) :, turning] = np.eye(len(angles)), -np.eye(len(angles))
    nothing = np.zeros((len(rows), n3))
    return Inequality(nothing, nothing, rows[:, n3 + k :], np.concatenate([angles, -angles]) - turn)


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

    def done(self) -> Inequality:
        blocks = [np.zeros((len(self.found), size)) for size in self.sizes]
        for row, (block, at, weights) in enumerate(self.found):
            blocks[block][row, at : at + len(weights)] = weights
        return Inequality(*blocks, np.zeros(len(self.found)))


def both(*parts: Inequality) -> Inequality:
    return Inequality(
        *(np.concatenate([getattr(part, name) for part in parts]) for name in ("gap", "force", "rest", "low"))
    )


def _turned(angles: np.ndarray) -> np.ndarray:
    return np.column_stack([np.cos(angles), np.sin(angles)])
