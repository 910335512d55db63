"""One unit of work: rows solved one after the other, each started from those before it and from the skeleton."""

import io
import time
import zipfile
import zlib
from collections.abc import Iterable, Sequence
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
from cfem.core.files import write_whole
from cfem.dataset.writer import write_rows
from cfem.equilibrium.actuation import Actuation
from cfem.equilibrium.predictor import Knot, knot, nearest, predict
from cfem.equilibrium.solution import Equilibrium, State
from cfem.sample.contact import ContactPlan
from cfem.sample.parameters import drawn, place
from cfem.sample.plan import actuation
from cfem.sample.solver import Facts, Solver, SolverFactory


@dataclass(frozen=True)
class Job:
    """All that a worker needs, picklable.

    u: (m, n_a + n_p) rows; split, id: (m,) where each belongs; schema: of the files; skeleton: folder of the states
    that all rows start from; folder: of the rows; contact: what is drawn instead of a space, None without contact"""

    factory: SolverFactory
    space: str
    u: np.ndarray
    split: tuple[str, ...]
    id: tuple[int, ...]
    schema: pa.Schema
    skeleton: Path
    folder: Path
    contact: ContactPlan | None = None

    @property
    def skeleton_states(self) -> Path:
        return self.skeleton / "skeleton.npz"

    @property
    def skeleton_rows(self) -> Path:
        return self.skeleton / "skeleton.parquet"

    def shard_rows(self, number: int) -> Path:
        return self.folder / f"shard-{number:05d}.parquet"


@lru_cache(maxsize=1)
def _solver(factory: SolverFactory) -> Solver:
    """The robot of this process: its symbolic factorisation is worth keeping from shard to shard."""
    return factory()


def facts(factory: SolverFactory) -> Facts:
    return _solver(factory).facts


def solve_skeleton(job: Job, indices: np.ndarray) -> None:
    """Writes the skeleton's rows, and before them its states."""
    records, knots = _solve_rows(job, indices, [])
    write_knots(job.skeleton_states, knots)
    write_rows(job.skeleton_rows, records, job.schema)


def solve_shard(job: Job, number: int, indices: np.ndarray) -> int:
    """Writes the rows of one shard; how many they are."""
    records, _ = _solve_rows(job, indices, read_knots(job.skeleton_states))
    write_rows(job.shard_rows(number), records, job.schema)
    return len(records)


def _solve_rows(job: Job, indices: Iterable[int], known: Sequence[Knot]) -> tuple[list[dict[str, Any]], list[Knot]]:
    """Records of the rows, and the states that are known after them."""
    solver, knots, records = _solver(job.factory), list(known), []
    n_a, parameters = solver.facts.rows.n_a, sampled(solver.facts.parameters)
    for index in indices:
        begin = time.perf_counter()
        u = job.u[index]
        if job.contact:
            (asked, X), p = job.contact.actuation(u, solver.facts.patch, solver.facts.compliance), np.zeros(0)
        else:
            facts = solver.facts
            asked, X = actuation(job.space, u[:n_a], facts.reach, facts.compliance, facts.forces), None
            p = drawn(parameters, u[n_a:])
        q = place(parameters, p)
        start = _start(solver.facts, knots, u, asked, q)
        solved = solver.solve(asked, start, p)
        record = _record(job, index, solved, None if X is None else (solver.facts.patch, X))
        if parameters:
            record["p"] = p
        if parameters and solved.converged:
            record["dpsi_dp"] = solved.slopes.psi * slopes(parameters, p)
        if solved.converged:
            knots.append(knot(u, solved, contacts=job.contact is not None, q=q))
        records.append(record | {"seconds": time.perf_counter() - begin})
    return records, knots


def _start(facts: Facts, knots: Sequence[Knot], u: np.ndarray, asked: Actuation, q: np.ndarray) -> State | None:
    """Sections in a row go farthest from an equilibrium: the nearest of the same robot, else rest."""
    if not facts.in_a_row:
        return predict(knots, u, asked, q)
    return None if len(q) else nearest(knots, u)


def _record(job: Job, index: int, solved: Equilibrium, held: tuple[Patch, np.ndarray] | None) -> dict[str, Any]:
    """One row of the dataset. held: the patch and its pose, where one holds the contact points. A failed solve has no
    state: its columns stay empty and its reason says why."""
    row: dict[str, Any] = {
        "id": job.id[index],
        "split": job.split[index],
        "status": solved.status.name.lower(),
        "reason": "" if solved.converged else solved.status.value,
        "u": job.u[index],
        "iterations": solved.iterations,
        "factorizations": solved.factorizations,
        "steps": solved.steps,
        "residual": solved.residual,
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


def write_knots(path: Path, knots: Sequence[Knot]) -> None:
    """One array a field, the knots along its first axis. Raises NumericalError where there is none."""
    if not knots:
        raise NumericalError("none of the states solved first converged", do="check the scene, its reach first")
    stacked = {name: np.stack([getattr(known, name) for known in knots]) for name in Knot.__dataclass_fields__}
    buffer = io.BytesIO()
    np.savez(buffer, **stacked)
    write_whole(path, buffer.getvalue())


def read_knots(path: Path) -> list[Knot]:
    """What `write_knots` wrote. Raises InputError where it is missing or damaged."""
    try:
        with np.load(path, allow_pickle=False) as stacked:
            arrays = {name: stacked[name] for name in Knot.__dataclass_fields__}
    except (OSError, EOFError, ValueError, KeyError, zipfile.BadZipFile, zlib.error) as error:
        raise InputError(f"is damaged: {error}", where=str(path), do="remove it and run again") from None
    return [Knot(*row) for row in zip(*arrays.values(), strict=True)]
