"""Protocol of a plant: it takes a command and says what became of it."""

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike

from cfem.core.console.shown import counted
from cfem.core.errors import InputError

Command = Literal["displacement", "force"]
Changing = list[tuple[object, tuple[str, ...]]]  # objects, and the names of their attributes that a run changes


@dataclass(frozen=True)
class Measurement:
    """What a plant answers to a command.

    x_e: (n_e,) mm, absolute positions of the effectors
    delta_a, lambda_a: (n_a,) mm and N, None where no sensor gives them
    t: number of the step
    status: 'converged', or the sentence that says why not (numbers are then NaN)
    markers: (m, 3) mm where they are seen, nan for one that is not; None where nobody asked
    surface: (k, 3) mm of other points of the surface, known of a simulated robot; None where nobody asked"""

    x_e: np.ndarray
    delta_a: np.ndarray | None
    lambda_a: np.ndarray | None
    t: int
    status: str
    markers: np.ndarray | None = None
    surface: np.ndarray | None = None

    @classmethod
    def failed(cls, n_e: int, n_a: int, t: int, why: str) -> "Measurement":
        """Measurement of a step that has no answer."""
        nothing = np.full(n_a, np.nan)
        return cls(np.full(n_e, np.nan), nothing, nothing, t, why)


class Plant(Protocol):
    """The robot, or what stands for it."""

    def step(self, u: np.ndarray, kind: Command = "displacement") -> Measurement:
        """Command the actuators: u (n_a,), displacements in mm or forces in N."""
        ...


def command_of(u: ArrayLike, n_a: int) -> np.ndarray:
    """A command as numbers (n_a,). InputError where it has another number of them."""
    numbers = np.asarray(u, float)
    if numbers.shape != (n_a,):
        raise InputError(f"a command is {counted(n_a, 'number')}, one for each actuator; got {u!r:.60}")
    return numbers
