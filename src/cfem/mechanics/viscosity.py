"""Viscosity of a material: an overstress Q beside the elastic second Piola-Kirchhoff stress, in the frame at rest.

S is the part of the elastic stress that resists shear: d psi_rest / dE of a law (law.py), the whole of a rod's.

    Kelvin-Voigt, relaxation time tau:      Q = tau dS/dt
    Prony series, terms (g_i, tau_i):       dQ_i/dt + Q_i / tau_i = g_i dS/dt,    Q = sum_i Q_i

(Simo, Comput. Methods Appl. Mech. Eng. 60, 1987). A rigid rotation changes neither, and a volume change without shear
is elastic: pressure stays a matter of the element, so that nothing locks. `young` is the modulus after a long time.

A step of time dt makes it an elastic stress: Q = a S(x) + B with a and B known before. Prony terms follow the
exponential exactly where S is linear in time; Kelvin-Voigt takes the backward difference of second order."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cfem.condensed.viscosity import Viscosity
from cfem.mechanics.body import Body, BodyResponse
from cfem.mechanics.further_stress import add_stress, add_stress_stiffness, stress_form
from cfem.mechanics.rod import region as rods


@dataclass(frozen=True)
class ViscousMemory:
    """Memory of the overstress at the end of a step, of each region of a body (its solids, then its rod).

    S: at the end of the step
    before: S one step before, None at first
    terms: Q_i of the Prony terms (terms, ...)
    dt: s of that step"""

    S: tuple[np.ndarray, ...]
    before: tuple[np.ndarray, ...] | None
    terms: tuple[np.ndarray, ...]
    dt: float = 0.0


@dataclass(frozen=True)
class Overstress:
    """Q = a S + B of each region: a number (solids) or (m, 1) (rods), B (m q, 3, 3) MPa or (m, 6) N, N mm. A solid
    without viscosity has None."""

    parts: tuple[tuple[float | np.ndarray, np.ndarray] | None, ...]


def settled(body: Body, viscosity: Sequence[Viscosity], state: BodyResponse) -> ViscousMemory:
    """Memory of a body that has been in `state` for long. viscosity: of each material, in the order of the body's."""
    S = stresses(body, state)
    counts = [max((len(viscosity[number].prony) for number in numbers), default=0) for numbers in _numbers(body)]
    terms = tuple(np.zeros((count, *stress.shape)) for count, stress in zip(counts, S, strict=True))
    return ViscousMemory(S, None, terms)


def stresses(body: Body, state: BodyResponse) -> tuple[np.ndarray, ...]:
    """Stress S of each region, MPa at the quadrature points (m q, 3, 3); N and N mm of a rod's elements (m, 6)."""
    solids = tuple(np.linalg.solve(np.eye(3) + response.D, response.P) for response in state.solids)
    return solids if state.rod is None else (*solids, state.rod.stress)


def overstress(body: Body, viscosity: Sequence[Viscosity], memory: ViscousMemory, dt: float) -> Overstress:
    """Overstress of a step of dt seconds after `memory`."""
    parts: list[tuple[float | np.ndarray, np.ndarray] | None] = []
    solids = len(body.solids)
    for index, (numbers, S) in enumerate(zip(_numbers(body), memory.S, strict=True)):
        before = S if memory.before is None else memory.before[index]
        if index < solids:
            material = viscosity[numbers[0]]
            parts.append(None if material.none else _of_step(material, S, before, memory.terms[index], dt, memory.dt))
            continue
        a, B = np.zeros((len(S), 1)), np.zeros_like(S)
        for number in numbers:
            elements = body.rod.numbers == number
            terms = memory.terms[index][:, elements]
            a[elements], B[elements] = _of_step(viscosity[number], S[elements], before[elements], terms, dt, memory.dt)
        parts.append((a, B))
    return Overstress(tuple(parts))


def _of_step(
    viscosity: Viscosity, S: np.ndarray, before: np.ndarray, terms: np.ndarray, dt: float, last: float
) -> tuple[float, np.ndarray]:
    """Factor a and constant B of one region: Kelvin-Voigt by differences of second order, Prony terms by exact
    integration of linear S."""
    r = dt / last if last else 0.0  # the first step takes the difference of first order
    a = viscosity.relaxation / dt * (1 + 2 * r) / (1 + r)
    B = viscosity.relaxation / dt * (r**2 / (1 + r) * before - (1 + r) * S)
    for (g, tau), Q in zip(viscosity.prony, terms, strict=False):
        share = -g * tau / dt * np.expm1(-dt / tau)
        a += share
        B = B + np.exp(-dt / tau) * Q - share * S
    return a, B


def remembered(
    body: Body, viscosity: Sequence[Viscosity], memory: ViscousMemory, dt: float, state: BodyResponse
) -> ViscousMemory:
    """Memory after a step of dt seconds that ended in `state`."""
    S = stresses(body, state)
    terms = []
    for index, (numbers, now, was) in enumerate(zip(_numbers(body), S, memory.S, strict=True)):
        Q = memory.terms[index].copy()
        for number in numbers:
            elements = body.rod.numbers == number if index == len(body.solids) else slice(None)
            for i, (g, tau) in enumerate(viscosity[number].prony):
                share = -g * tau / dt * np.expm1(-dt / tau)
                Q[i, elements] = np.exp(-dt / tau) * Q[i, elements] + share * (now[elements] - was[elements])
        terms.append(Q)
    return ViscousMemory(S, memory.S, tuple(terms), dt)


def solid_force(body: Body, state: BodyResponse, over: Overstress) -> np.ndarray:
    """Nodal forces (n, 3) N of the solids' overstress."""
    force = np.zeros_like(body.mesh.X)
    for solid, response, part in zip(body.solids, state.solids, over.parts, strict=False):
        if part is not None and response.min_J > 0:
            a, B = part
            add_stress(solid, response, a * response.P + (np.eye(3) + response.D) @ B, force)
    return force


def add_solid_stiffness(body: Body, state: BodyResponse, over: Overstress, slots: np.ndarray, data: np.ndarray) -> None:
    """Adds d force / dx of the solids' overstress to the lower triangle `data`, slots as in body.tangent."""
    for (solid, place), response, part in zip(body.parts(), state.solids, over.parts, strict=False):
        if part is not None:
            add_stress_stiffness(solid, response, *part, slots[place], data)


def solid_form(body: Body, state: BodyResponse, over: Overstress, motions: np.ndarray) -> np.ndarray:
    """Form (k, k) N mm of motions (n, 3, k) mm in the stiffness of the solids' overstress."""
    form = np.zeros((motions.shape[2], motions.shape[2]))
    for solid, response, part in zip(body.solids, state.solids, over.parts, strict=False):
        if part is not None:
            form += stress_form(solid, response, *part, motions)
    return form


def rod_stress(body: Body, state: BodyResponse, over: Overstress) -> np.ndarray:
    """Overstress Q (m, 6) N and N mm of the rod."""
    a, B = over.parts[-1]
    return a * state.rod.stress + B


def rod_stiffness(body: Body, state: BodyResponse, over: Overstress) -> np.ndarray:
    """Stiffness (m, 12, 12) N/mm of the rod's overstress alone."""
    a, _ = over.parts[-1]
    return rods.stiffness_of(body.rod.stiffness * a, rod_stress(body, state, over), body.rod, state.rod)


def damping(body: Body, state: BodyResponse, number: int) -> Overstress:
    """The overstress whose stiffness is that of S's material part in the regions of one material: dQ = dS there, with
    no stress; times Viscosity.modulus it is storage and loss."""
    parts: list[tuple[float | np.ndarray, np.ndarray] | None] = []
    for index, S in enumerate(stresses(body, state)):
        if index < len(body.solids):
            parts.append((1.0, -S) if body.solids[index].number == number else None)
        else:
            weight = (body.rod.numbers == number).astype(float)[:, None]
            parts.append((weight, -weight * S))
    return Overstress(tuple(parts))


def _numbers(body: Body) -> list[list[int]]:
    """Materials of each region."""
    solids = [[part.number] for part in body.solids]
    return solids if body.rod is None else [*solids, np.unique(body.rod.numbers).tolist()]
