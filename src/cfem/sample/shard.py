"""One unit of work: rows solved one after the other, each started from those before it and from the skeleton."""

import io
import pickle  # nosec B403
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
import pyarrow as pa

from cfem.condensed import Condensed, Rows, pack_upper
from cfem.condensed.packing import packed_indices
from cfem.condensed.parameters import coordinates, from_shares, sampled, slopes
from cfem.condensed.pose import Patch, onto_patch, slopes_onto_patch
from cfem.condensed.skin import Skin, skin_bytes, skin_from
from cfem.dataset.writer import table_bytes
from cfem.equilibrium.motion.inertia import Inertia
from cfem.equilibrium.predictor import NO_PARAMETERS, Knot, following, knot, nearest, predict
from cfem.equilibrium.system.actuation import Actuation, pulling_only
from cfem.equilibrium.system.solution import Equilibrium, ParameterSlopes, State
from cfem.mechanics.self_contact import is_deep
from cfem.sample import overlap
from cfem.sample.contact import ContactPlan
from cfem.sample.knots_file import demand_states, knots_bytes, read_knots
from cfem.sample.plan import actuation, borne_together
from cfem.sample.processes import tally
from cfem.sample.skin import SkinSample, find_skin, patches, probed, shown_nodes
from cfem.sample.solver import Facts, Solver
from cfem.sample.spec import SkinSpec


@dataclass(frozen=True, kw_only=True)
class Piece:
    """Rows to be solved, picklable.

    u: (m, n_a + n_p) rows
    split, id: (m,) where each belongs
    schema: of their table
    contact: what is drawn instead of a space, None without contact
    together: share of their reach to which all actuators can be pulled at once"""

    space: str
    u: np.ndarray
    split: tuple[str, ...]
    id: tuple[int, ...]
    schema: pa.Schema
    contact: ContactPlan | None = None
    together: float = 1.0


@lru_cache(maxsize=1)
def _solver(robot: bytes) -> Solver:
    """The robot of this process: its symbolic factorisation is worth keeping from shard to shard."""
    # what the process that started this work pickled: as its executor itself pickles all that it is given
    return pickle.loads(robot)()  # nosec B301


def facts(robot: bytes) -> Facts:
    """Facts of a robot. robot: a pickled SolverFactory, as in all functions that workers call: they need no file of the
    one that asks."""
    return _solver(robot).facts


def pull_together(robot: bytes) -> float:
    """See `borne_together`; where the robot has parameters, at the middle of their ranges."""
    solver = _solver(robot).roughly()
    parameters, high = sampled(solver.facts.parameters), solver.facts.reach[:, 1]
    middle = from_shares(parameters, np.full(len(parameters), 0.5))

    def start(knots: Sequence[Knot], place: np.ndarray, command: Actuation) -> State | None:
        return _start(solver, knots, place, command, NO_PARAMETERS)  # all are the robot of the middle

    solve = following(lambda command, state: solver.solve(command, state, middle), start)
    return borne_together(solve, high, solver.facts.compliance)


@lru_cache(maxsize=1)
def _watching(robot: bytes, skin: bytes) -> tuple[Solver, Skin | None]:
    """Solver of this process with the rows of a skin; as it is where that is empty."""
    if not skin:
        return _solver(robot), None
    skin_rows = skin_from(skin)
    return _solver(robot).watching(skin_rows), skin_rows


Record = dict[str, Any]


def solve_skeleton(
    robot: bytes, piece: Piece, asked: SkinSpec | None, known: bytes | None = None
) -> tuple[list[Record], bytes, bytes]:
    """The records of the rows; the file of their states, from which all others start; that of the skin which they show,
    empty where none is asked for. known: that file where there are rows already. Which rows the skin has is known once
    all these states are, roughly. Each is then solved again with them, for less than a factorisation more."""
    if asked is None or known is not None:
        records, knots = _solve_rows(*_watching(robot, known or b""), piece, [])
        if known is None:
            demand_states(knots)
        return records, knots_bytes(knots), known or b""
    solver = _solver(robot)
    surface = solver.facts.surface
    rough, pushing = solver.roughly(), solver.roughly(patches(surface))
    inside = solver.facts.inside if asked.inner else None
    nodes, rest = shown_nodes(surface, inside)
    pushed = set(probed(len(piece.u)).tolist())
    begun, knots, seen = [], [], []
    for index in range(len(piece.u)):
        row = _solve_row(pushing if index in pushed else rough, piece, index, knots)
        begun.append(row)
        if row.solved.converged:
            knots.append(row.knot)
            seen.append(_skin_sample(nodes, rest, row.solved))
        tally.add(not row.solved.converged, row.solved.factorizations)
    demand_states(knots)
    skin = find_skin(surface, seen, asked, solver.facts.length, inside)
    watching = solver.watching(skin)
    rows = []
    for index, row in enumerate(begun):
        tally.begin(piece.split[index], piece.id[index])
        rows.append(_solve_with_skin(watching, piece, row))
        tally.add(False, rows[-1].solved.factorizations - row.solved.factorizations)
    records = [_record(solver.facts, skin, piece, index, row) for index, row in enumerate(rows)]
    states = knots_bytes([row.knot for row in rows if row.solved.converged])
    return records, states, skin_bytes(skin)


def overlaps(robot: bytes, skeleton: bytes) -> dict[str, Any] | None:
    """Figures on parts of the body that pass through each other in the states of `skeleton`; None where nobody can
    tell."""
    boundary = _solver(robot).facts.boundary
    states = [known.x for known in read_knots(io.BytesIO(skeleton))]
    return overlap.overlaps(boundary, states) if boundary and states else None


def solve_shard(robot: bytes, skin: bytes, skeleton: bytes, piece: Piece) -> bytes:
    """The Parquet file of the rows, started from the states of `skeleton`."""
    return rows_bytes(_solve_rows(*_watching(robot, skin), piece, read_knots(io.BytesIO(skeleton)))[0], piece.schema)


def solve_alone(robot: bytes, skin: bytes, piece: Piece) -> bytes:
    """Rows as of `solve_shard`, the first one from rest."""
    return rows_bytes(_solve_rows(*_watching(robot, skin), piece, [])[0], piece.schema)


def rows_bytes(records: list[Record], schema: pa.Schema) -> bytes:
    """Bytes of a Parquet file of records."""
    return table_bytes(pa.Table.from_pylist(records, schema=schema))


@dataclass(frozen=True)
class SolvedRow:
    """A row u of the plan, solved.

    asked, X: the actuation that it prescribes, and its pose, if any
    p: its parameters
    seconds: time of the solve"""

    u: np.ndarray
    asked: Actuation
    X: np.ndarray | None
    p: np.ndarray
    solved: Equilibrium
    knot: Knot | None
    seconds: float


def _solve_rows(solver: Solver, skin: Skin | None, piece: Piece, known: Sequence[Knot]) -> tuple[list[Record], list]:
    """Records of the rows, and the states that are known after them."""
    knots, records = list(known), []
    for index in range(len(piece.u)):
        row = _solve_row(solver, piece, index, knots)
        records.append(_record(solver.facts, skin, piece, index, row))
        if row.solved.converged:
            knots.append(row.knot)
        tally.add(not row.solved.converged, row.solved.factorizations)
    return records, knots


def _solve_row(solver: Solver, piece: Piece, index: int, knots: Sequence[Knot]) -> SolvedRow:
    """Row of the plan, solved from the knots nearest to it."""
    begin, facts, u = time.perf_counter(), solver.facts, piece.u[index]
    n_a, parameters = facts.rows.n_a, sampled(facts.parameters)
    if piece.contact:
        (asked, X), p = piece.contact.actuation(u, facts.patch, facts.compliance), np.zeros(0)
    else:
        asked, X = actuation(piece.space, u[:n_a], facts.reach, facts.compliance, facts.forces, piece.together), None
        p = from_shares(parameters, u[n_a:])
    asked, q = pulling_only(asked, facts.unilateral), coordinates(parameters, p)
    tally.begin(piece.split[index], piece.id[index])
    solved = solver.solve(asked, _start(solver, knots, u, asked, q), p)
    known = _knot(facts, piece, u, p, solved)
    return SolvedRow(u, asked, X, p, solved, known, time.perf_counter() - begin)


def _skin_sample(nodes: np.ndarray, rest: np.ndarray, solved: Equilibrium) -> SkinSample:
    yields = solved.push_response
    return SkinSample(
        solved.state.x[nodes] - rest,
        solved.response[nodes][:, :, : solved.n_a],
        solved.lambda_a,
        None if yields is None else yields[nodes],
    )


def _solve_with_skin(solver: Solver, piece: Piece, row: SolvedRow) -> SolvedRow:
    """A state of the skeleton with the rows of the skin, at the cost of both times. One that was not found stays so."""
    if not row.solved.converged:
        return row
    begin, first = time.perf_counter(), row.solved
    solved = solver.solve(row.asked, first.state, row.p)
    solved = replace(
        solved,
        iterations=solved.iterations + first.iterations,
        factorizations=solved.factorizations + first.factorizations,
        steps=solved.steps + first.steps,
    )
    known = replace(row, solved=solved, knot=_knot(solver.facts, piece, row.u, row.p, solved))
    return replace(known, seconds=row.seconds + time.perf_counter() - begin)


def _knot(facts: Facts, piece: Piece, u: np.ndarray, p: np.ndarray, solved: Equilibrium) -> Knot | None:
    q = coordinates(sampled(facts.parameters), p)
    return knot(u, solved, contacts=piece.contact is not None, q=q) if solved.converged else None


def _slopes(by_q: ParameterSlopes, dq_dp: np.ndarray) -> dict[str, np.ndarray]:
    """Columns of the derivatives by p, from those by its coordinates q."""
    by_p = {"dpsi_dp": by_q.psi, "dlambda_dp": by_q.lam, "ddelta_e_dp": by_q.delta_e}
    by_p |= {"ddelta_s_dp": by_q.delta_s} if by_q.delta_s.size else {}
    return {name: (values * dq_dp).ravel() for name, values in by_p.items()}


def _start(solver: Solver, knots: Sequence[Knot], u: np.ndarray, asked: Actuation, q: np.ndarray) -> State | None:
    """Sections in a row go farthest from an equilibrium: the nearest of the same robot, else rest. So do walls that a
    prediction has pushed through each other."""
    facts = solver.facts
    shape = None if len(q) or facts.in_a_row else solver.rotation_strain
    predicted = None if facts.in_a_row else predict(knots, u, asked, q, shape)
    passed = predicted is not None and facts.contact is not None and is_deep(facts.contact, predicted.x)
    if passed or facts.in_a_row:
        return None if len(q) else nearest(knots, u)
    return predicted


def _record(facts: Facts, skin: Skin | None, piece: Piece, index: int, row_solved: SolvedRow) -> Record:
    """Record of one row of the dataset. A failed solve has no state: its columns stay empty and its reason says why."""
    solved, parameters = row_solved.solved, sampled(facts.parameters)
    row = _state(piece, index, solved, None if row_solved.X is None else (facts.patch, row_solved.X))
    if parameters:
        row["p"] = row_solved.p
    if parameters and solved.converged:
        row |= _slopes(solved.slopes, slopes(parameters, row_solved.p))
    if skin and solved.converged:
        rms, largest = skin.left(solved.state.x[skin.nodes] - skin.rest)
        row |= {"delta_s": solved.delta_s, "skin_rms": rms, "skin_max": largest}
    return row | {"seconds": row_solved.seconds}


def _state(piece: Piece, index: int, solved: Equilibrium, held: tuple[Patch, np.ndarray] | None) -> Record:
    """Record of a solved state. held: the patch and its pose, where one holds the contact points."""
    row: dict[str, Any] = {
        "id": piece.id[index],
        "split": piece.split[index],
        "status": solved.status.name.lower(),
        "reason": "" if solved.converged else solved.status.value,
        "u": piece.u[index],
        "iterations": solved.iterations,
        "factorizations": solved.factorizations,
        "steps": solved.steps,
        "residual": solved.residual,
        "tolerance": solved.tolerance,
    }
    if solved.converged:
        condensed = _without_contacts(solved.condensed) if held is None else onto_patch(solved.condensed, *held)
        row |= {
            "delta_a": solved.delta_a,
            "delta_e": solved.delta_e,
            "lambda_a": solved.lambda_a,
            "W": pack_upper(condensed.W),
            "delta_free": condensed.delta_free,
            "energy": solved.energy,
            "slack": solved.slack,
        }
    if solved.converged and held:
        row |= {"delta_c": held[1], "lambda_c": condensed.lam[solved.n_a :]}
    if solved.converged and solved.inertia is not None:
        row |= _motion(solved.inertia, solved.condensed.rows)
    if solved.converged and solved.dW is not None:
        n = solved.condensed.rows.c.start
        dW = solved.dW[: solved.n_a, :n, :n] if held is None else slopes_onto_patch(solved.condensed, solved.dW, *held)
        row["dW"] = pack_upper(dW).ravel()
    if solved.converged and solved.dC is not None:
        row["dC"] = solved.dC[*packed_indices(solved.dC.shape[-1], 3)]
    if solved.converged and solved.d2C is not None:
        row["d2C"] = solved.d2C
    return row


def _motion(inertia: Inertia, rows: Rows) -> Record:
    """Columns of the mass and viscosity of all rows but the contacts'."""
    n = rows.c.start
    record = {"V": pack_upper(inertia.V[:n, :n])}
    if (inner := inertia.inner) is not None:
        record |= {"inner_K": pack_upper(inner.K), "inner_M": pack_upper(inner.M), "inner_e": inner.e.ravel()}
        name, loss = "inner_loss", inner.loss
    else:
        record |= {name: pack_upper(getattr(inertia, name)[:n, :n]) for name in ("V2", "V3")}
        on_motions = np.r_[0:n, rows.n : rows.n + n]  # (Z, Y) of these rows
        name, loss = "loss", inertia.loss[:, on_motions[:, None], on_motions]
    if len(loss):
        record[name] = pack_upper(loss).ravel()
    if inertia.dV is not None:
        record["dV"] = pack_upper(inertia.dV[: rows.n_a, :n, :n]).ravel()
    return record


def _without_contacts(condensed: Condensed) -> Condensed:
    """Condensed state where nothing holds the contact points."""
    n = condensed.rows.c.start
    rows, n_a = replace(condensed.rows, contacts=()), condensed.rows.n_a
    return Condensed(rows, condensed.W[:n, :n], condensed.delta_free[:n], condensed.lam[:n_a])
