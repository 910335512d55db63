"""What the inverse step through contact knows, what it aims at, and what it answers."""

from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from cfem.contact import Check, ContactProblem, Mode


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
