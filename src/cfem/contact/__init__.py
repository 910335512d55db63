"""Contact at a few points, on one linearisation: who is open, who sticks and who slides, and with what force;
and how far points are from rigid obstacles. Knows matrices and vectors only."""

from cfem.contact.check import Check, check
from cfem.contact.enumerate import all_modes
from cfem.contact.modes import Mode, ModeSolution, solve_mode
from cfem.contact.problem import ContactProblem, Law
from cfem.contact.solve import ContactSolution, ContactStatus, solve_contact

__all__ = [
    "Check",
    "ContactProblem",
    "ContactSolution",
    "ContactStatus",
    "Law",
    "Mode",
    "ModeSolution",
    "all_modes",
    "check",
    "solve_contact",
    "solve_mode",
]
