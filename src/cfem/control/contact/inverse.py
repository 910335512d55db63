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

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from cfem.contact import Check, Law, Mode, solve_contact
from cfem.contact.modes import modes_of, understood
from cfem.control.contact.linearisation import ContactAim, ContactInverse, ContactInverseStatus, ContactLinearisation
from cfem.control.contact.program import Program
from cfem.control.inverse import Limits

EXHAUSTIVE = 3  # points up to which every choice of modes is tried


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
    program = Program(now, law, aim, limits)
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
