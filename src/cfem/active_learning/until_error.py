"""`cfem sample --until-error`: rounds of FE states, each where the error of the model so far is largest.

The training split is a pool; its first rows are solved, a model is fitted, and batches follow until every state of two
batches in a row was predicted within the error asked for, before it was solved. Test rows are solved too and take no
part. Interrupted, the same command goes on: the rows of a round depend on those of the rounds before alone."""

import shutil
import time
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from cfem.active_learning.choose import choose, disagreement
from cfem.active_learning.place import effectors, place
from cfem.condensed.parameters import completed, from_shares, sampled
from cfem.core.console.progress import doing
from cfem.dataset.reader import Dataset, as_dataset, column_array
from cfem.dataset.schema import parameters_of
from cfem.dataset.writer import content_hash, write_table
from cfem.predict.load import build
from cfem.predict.protocol import Predictor
from cfem.sample import artefact
from cfem.sample.overlap import read_overlap
from cfem.sample.plan import actuation, skeleton
from cfem.sample.processes.pool import with_workers
from cfem.sample.processes.workers import Workers
from cfem.sample.runner import Job, make_job, merge, solve_rows, solve_skeleton
from cfem.sample.solver import SolverFactory
from cfem.sample.spec import SampleSpec, Until
from cfem.surrogate.model_card import model_card
from cfem.surrogate.series.spectral import fit

COMMITTEE = 4  # models, each of the data without a part
PIECES = 4  # of a batch, whatever the number of workers


@dataclass(frozen=True)
class Round:
    """Round of sampling.

    samples: training states before it
    rows: it added
    expected, observed: mm, largest error of the effectors at its rows, as the committee guessed and as FE showed
    seconds: of fitting and choosing"""

    samples: int
    rows: int
    expected: float
    observed: float
    seconds: float


def fill(folder: Path, spec: SampleSpec, factory: SolverFactory, made_from: str, workers: Workers) -> dict[str, Any]:
    """Writes one Parquet file a split into `folder`, by rounds until spec.until.error; returns results for the
    manifest."""
    begin = time.perf_counter()
    tables, rounds = with_workers(
        workers,
        lambda executor: explore(spec, factory, folder / "shards", executor, made_from, workers.timeout),
    )
    artefact.keep_skin(folder / "shards", folder)
    for split, table in tables.items():
        write_table(folder / f"{split}.parquet", table)
    plain = artefact.results(tables, artefact.kept_skin(folder), read_overlap(folder / "shards"))
    shutil.rmtree(folder / "shards")
    outcome = verdict(spec.until, tables, rounds)
    return {
        **plain,
        "until": outcome,
        "headline": [*headline(outcome), *artefact.skin_line(plain["skin"])],
        "wall_seconds": time.perf_counter() - begin,
        "content": content_hash(tables),
    }


def explore(
    spec: SampleSpec,
    factory: SolverFactory,
    folder: Path,
    executor: Executor,
    made_from: str,
    timeout: float | None = None,
) -> tuple[dict[str, pa.Table], list[Round]]:
    """Tables of all splits, and what the rounds gave."""
    until = spec.until
    job = make_job(spec, factory, folder, executor, made_from, timeout)
    pool = np.flatnonzero(np.array(job.split) == "train")
    known = np.union1d(pool[: until.first], np.flatnonzero(np.array(job.split) != "train"))
    rounds: list[Round] = []
    first = known[skeleton(job.u[known], spec.skeleton)]
    job = solve_skeleton(job, first)
    files = [job.skeleton_rows, *solve_rows(job, np.setdiff1d(known, first), spec.shard)]
    chosen = pool[: until.first]
    while len(chosen) < min(until.largest, len(pool)) and not settled(rounds, until):
        doing(f"choosing the next states, {len(chosen)} of at most {min(until.largest, len(pool))} solved")
        begin = time.perf_counter()
        training = as_dataset(merge(files, ["train"])["train"])
        full_model, parts = committee(training, until)
        unsolved = np.setdiff1d(pool, chosen)
        batch, expected = next_batch(
            job, training, full_model, parts, unsolved, min(until.batch, until.largest - len(chosen))
        )
        seconds = time.perf_counter() - begin
        round_job = replace(job, folder=folder / f"round-{len(rounds):03d}")
        new = solve_rows(round_job, batch, -(-len(batch) // PIECES))
        observed = largest_error(full_model, as_dataset(merge(new, ["train"])["train"]))
        rounds.append(Round(len(training), len(batch), expected, observed, seconds))
        files, chosen = files + new, np.concatenate([chosen, batch])
    return merge(files, list(spec.splits)), rounds


def settled(rounds: list[Round], until: Until) -> bool:
    """True if the last two batches were known before they were solved."""
    return len(rounds) >= 2 and all(finished.observed <= until.error for finished in rounds[-2:])


def committee(training: Dataset, until: Until) -> tuple[Predictor, list[Predictor]]:
    """The model of all states, and those of all but every fourth."""
    number = np.arange(len(training))
    parts = [training.take(number % COMMITTEE != fold) for fold in range(COMMITTEE)]
    return model(training, until), [model(part, until) for part in parts]


def model(training: Dataset, until: Until) -> Predictor:
    return build(
        model_card("spectral", training, until.form), fit(training, until.form, max_terms=until.max_terms).arrays
    )


def next_batch(
    job: Job, training: Dataset, full_model: Predictor, parts: list[Predictor], candidates: np.ndarray, count: int
) -> tuple[np.ndarray, float]:
    """Batch of `count` of the candidates (indices into job.u), and the largest disagreement among them, mm."""
    u = job.u[candidates]
    n_a = full_model.rows.n_a
    nearest = np.array([np.argmin(((training.u - row) ** 2).sum(axis=1)) for row in u])
    start = (training.delta_a if full_model.form == "displacement" else training.lambda_a)[nearest]
    learned = sampled(parameters_of(training.meta))
    p = completed(full_model.parameters, from_shares(learned, u[:, n_a:]))
    compliance = np.array(training.meta["compliance"])
    actuations = [actuation(job.space, row[:n_a], full_model.reach, compliance, together=job.together) for row in u]
    if job.space == "pulling":
        rows = np.array([row_actuation.C[0] if len(row_actuation.C) else np.ones(n_a) for row_actuation in actuations])
        target = np.array([row_actuation.target[0] if len(row_actuation.C) else 0.0 for row_actuation in actuations])
        s, solved = place(full_model, rows, target, p, start)
        s = np.where(solved[:, None], s, start)
    else:
        s = np.array([row_actuation.target for row_actuation in actuations])
        if full_model.form == "force":
            s = np.array([full_model.at_displacement(*state).lambda_a for state in zip(s, p, strict=True)])
    score = disagreement(full_model, parts, s, p)
    failed = column_array(training.failed, "u") if len(training.failed) else None
    picked = choose(u, score, count, failed)
    return candidates[picked], float(np.nanmax(score))


def largest_error(predictor: Predictor, states: Dataset) -> float:
    """Largest distance mm between an effector by the model and by FE."""
    if not len(states):
        return np.inf
    s = states.delta_a if predictor.form == "displacement" else states.lambda_a
    apart = effectors(predictor, s, completed(predictor.parameters, states.p)) - states.delta_e
    return float(np.linalg.norm(apart.reshape(len(states), -1, 3), axis=2).max())


def verdict(until: Until, tables: dict[str, pa.Table], rounds: list[Round]) -> dict[str, Any]:
    """Outcome of the loop, and, by a model of all its states, the error at the test states that it never saw."""
    training = as_dataset(tables["train"])
    test = largest_error(model(training, until), as_dataset(tables["test"])) if "test" in tables else None
    return {
        "error": until.error,
        "reached": settled(rounds, until),
        "samples": len(training),
        "test_error": test,
        "rounds": [vars(finished) for finished in rounds],
    }


def headline(outcome: dict[str, Any]) -> list[str]:
    how = "reached" if outcome["reached"] else "NOT reached: allow more rows (until.largest, the split's rows)"
    judged = "" if outcome["test_error"] is None else f"; {outcome['test_error']:.2g} mm at most on the test states"
    return [f"error of {outcome['error']:g} mm {how}, with {outcome['samples']} training states{judged}"]
