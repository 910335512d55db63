"""Every state of contact of a few points, by trying every choice of modes: a reference of `cfem.contact.law.solve`."""

from itertools import product

import numpy as np

from cfem.contact.law.check import check
from cfem.contact.law.modes import distinct, modes_of, solve_mode
from cfem.contact.law.problem import ContactProblem, Law
from cfem.contact.law.solve import LawfulState


def all_modes(problem: ContactProblem, law: Law) -> list[LawfulState]:
    """The distinct valid states of a few points. Where a state belongs to several choices (a point that just
    touches), the first of them is named. With two slipping points and more, as complete as Newton
    from 144 and more starts is; where a choice leaves its state undetermined, only its smallest state is tried."""
    u, states = problem.units, []
    for modes in product(modes_of(problem, law), repeat=problem.m):
        solution = solve_mode(problem, law, modes)
        if solution.valid:
            states += [
                LawfulState(lam, xi, modes, check(problem, law, lam, xi))
                for lam, xi in zip(solution.lam, solution.xi, strict=True)
            ]
    if not states:
        return []
    numbers = np.array([np.concatenate([state.lam / u.force, state.xi / u.motion]) for state in states])
    return [states[i] for i in distinct(numbers)]
