"""One unit of work: rows solved one after the other, each started from those before it and from the skeleton."""

import io
import pickle  # nosec B403
import time
import zipfile
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from cfem.condensed import Condensed, pack_upper
from cfem.condensed.parameters import sampled, slopes
from cfem.condensed.pose import Patch
from cfem.condensed.restrict import onto_patch, slopes_onto_patch
from cfem.core.errors import InputError, NumericalError
from cfem.dataset.writer import table_bytes
from cfem.equilibrium.actuation import Actuation
from cfem.equilibrium.predictor import Knot, knot, nearest, predict
from cfem.equilibrium.solution import Equilibrium, ParameterSlopes, State
from cfem.sample import tally
from cfem.sample.contact import ContactPlan
from cfem.sample.parameters import drawn, place
from cfem.sample.plan import actuation
from cfem.sample.solver import Facts, Solver


@dataclass(frozen=True, kw_only=True)
class Piece:
    """Rows to be solved, picklable.

    u: (m, n_a + n_p) rows; split, id: (m,) where each belongs; schema: of their table; contact: what is drawn instead
    of a space, None without contact"""

    space: str
    u: np.ndarray
    split: tuple[str, ...]
    id: tuple[int, ...]
    schema: pa.Schema
    contact: ContactPlan | None = None


@lru_cache(maxsize=1)
def _solver(robot: bytes) -> Solver:
    """The robot of this process: its symbolic factorisation is worth keeping from shard to shard."""
    # what the process that started this work pickled: as its executor itself pickles all that it is given
    return pickle.loads(robot)()  # nosec B301


def facts(robot: bytes) -> Facts:
    """robot: a pickled SolverFactory, as in all functions that workers call: they need no file of the one that asks."""
    return _solver(robot).facts


def solve_skeleton(robot: bytes, piece: Piece) -> tuple[bytes, bytes]:
    """The Parquet file of the rows, and that of their states, from which all others start."""
    records, knots = _solve_rows(_solver(robot), piece, [])
    return _file(records, piece.schema), knots_bytes(knots)


def solve_shard(robot: bytes, skeleton: bytes, piece: Piece) -> bytes:
    """The Parquet file of the rows, started from the states of `skeleton`."""
    return _file(_solve_rows(_solver(robot), piece, read_knots(io.BytesIO(skeleton)))[0], piece.schema)


def _file(records: list[dict[str, Any]], schema: pa.Schema) -> bytes:
    return table_bytes(pa.Table.from_pylist(records, schema=schema))


def _solve_rows(solver: Solver, piece: Piece, known: Sequence[Knot]) -> tuple[list[dict[str, Any]], list[Knot]]:
    """Records of the rows, and the states that are known after them."""
    facts, knots, records = solver.facts, list(known), []
    n_a, parameters = facts.rows.n_a, sampled(facts.parameters)
    for index, u in enumerate(piece.u):
        begin = time.perf_counter()
        if piece.contact:
            (asked, X), p = piece.contact.actuation(u, facts.patch, facts.compliance), np.zeros(0)
        else:
            asked, X = actuation(piece.space, u[:n_a], facts.reach, facts.compliance, facts.forces), None
            p = drawn(parameters, u[n_a:])
        q = place(parameters, p)
        solved = solver.solve(asked, _start(facts, knots, u, asked, q), p)
        record = _record(piece, index, solved, None if X is None else (facts.patch, X))
        if parameters:
            record["p"] = p
        if parameters and solved.converged:
            record |= _slopes(solved.slopes, slopes(parameters, p))
        if solved.converged:
            knots.append(knot(u, solved, contacts=piece.contact is not None, q=q))
        records.append(record | {"seconds": time.perf_counter() - begin})
        tally.add_one()
    return records, knots


def _slopes(by_q: ParameterSlopes, dq_dp: np.ndarray) -> dict[str, np.ndarray]:
    """Columns of the derivatives by p, from those by its coordinates q."""
    by_p = {"dpsi_dp": by_q.psi, "dlambda_dp": by_q.lam, "ddelta_e_dp": by_q.delta_e}
    return {name: (values * dq_dp).ravel() for name, values in by_p.items()}


def _start(facts: Facts, knots: Sequence[Knot], u: np.ndarray, asked: Actuation, q: np.ndarray) -> State | None:
    """Sections in a row go farthest from an equilibrium: the nearest of the same robot, else rest."""
    if not facts.in_a_row:
        return predict(knots, u, asked, q)
    return None if len(q) else nearest(knots, u)


def _record(piece: Piece, index: int, solved: Equilibrium, held: tuple[Patch, np.ndarray] | None) -> dict[str, Any]:
    """One row of the dataset. held: the patch and its pose, where one holds the contact points. A failed solve has no
    state: its columns stay empty and its reason says why."""
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
    if solved.converged and solved.dW is not None:
        n = solved.condensed.rows.n_e + solved.n_a
        dW = solved.dW[: solved.n_a, :n, :n] if held is None else slopes_onto_patch(solved.condensed, solved.dW, *held)
        row["dW"] = pack_upper(dW).ravel()
    return row


def _without_contacts(condensed: Condensed) -> Condensed:
    """Where nothing holds the contact points."""
    n = condensed.rows.n_e + condensed.rows.n_a
    rows, n_a = replace(condensed.rows, contacts=()), condensed.rows.n_a
    return Condensed(rows, condensed.W[:n, :n], condensed.delta_free[:n], condensed.lam[:n_a])


def knots_bytes(knots: Sequence[Knot]) -> bytes:
    """An .npz, one array a field, the knots along its first axis. Raises NumericalError where there is none."""
    if not knots:
        raise NumericalError(
            "none of the first states converged", do="check the scene; the usual cause is a reach that is too large"
        )
    stacked = {name: np.stack([getattr(known, name) for known in knots]) for name in Knot.__dataclass_fields__}
    buffer = io.BytesIO()
    np.savez(buffer, **stacked)
    return buffer.getvalue()


def read_knots(file: Path | io.BytesIO) -> list[Knot]:
    """What `knots_bytes` made. Raises InputError where it is missing or damaged."""
    try:
        with np.load(file, allow_pickle=False) as stacked:
            arrays = {name: stacked[name] for name in Knot.__dataclass_fields__}
    except (OSError, EOFError, ValueError, KeyError, zipfile.BadZipFile, zlib.error) as error:
        raise InputError(f"is damaged: {error}", where=str(file), do="remove it and run again") from None
    return [Knot(*row) for row in zip(*arrays.values(), strict=True)]
